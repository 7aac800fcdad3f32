"""Messages of known formats in suggested maps: built here from one motion, in the forms of the formats."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from auvid_cli.logs.formats.log import LOG_TIME, Log, LogColumn
from auvid_cli.logs.suggest.known_formats import KNOWN_MESSAGES, Role, known_message
from auvid_cli.logs.suggest.suggest import suggest

TIME = 0.1 * np.arange(600)
WAVE = np.sin(0.4 * TIME)
HEADING = 0.5 * np.sin(0.1 * TIME)


class Tables(Log):
    """Tables of columns in memory, with the time of the log."""

    def __init__(self, tables):
        super().__init__(Path("dive.log"))
        self.content = {table: {LOG_TIME: TIME} | columns for table, columns in tables.items()}

    def tables(self):
        return {table: tuple(map(LogColumn, columns)) for table, columns in self.content.items()}

    def read(self, table, columns):
        return {name: self.content[table][name] for name in columns}


def suggested(tables):
    text = suggest([Tables(tables)], Path())
    return text, yaml.safe_load(text)


def test_px4_local_position_is_filter_output_over_ground():
    position = {
        "v_xy_valid": np.ones(TIME.size),
        "vx": 1.5 * np.cos(HEADING),
        "vy": 1.5 * np.sin(HEADING),
        "vz": 0.01 * WAVE,
        "ax": WAVE,
        "ay": WAVE,
        "az": WAVE,
    }
    attitude = dict(zip(("q[0]", "q[1]", "q[2]", "q[3]"), np.ones((4, 1)) * WAVE, strict=True))
    text, found = suggested({"vehicle_local_position": position, "vehicle_attitude": attitude})
    dvl = found["sensors"]["dvl"]
    assert (dvl["frame"], dvl["unit"], dvl["valid"]["column"]) == ("NED", "m/s", "v_xy_valid")
    assert text.count("output of a navigation filter, not a measurement") == 2
    # Its acceleration is without gravity.
    assert "accelerometer" not in found["sensors"]
    assert found["sensors"]["attitude"]["frame"] == "FRD"
    assert found["sensors"]["attitude"]["reference"] == "NED"


def test_moos_thrust_is_percent_and_turn_rate_no_gyroscope():
    tables = {"DESIRED_THRUST": 50 + 9 * WAVE, "DESIRED_RUDDER": 20 * WAVE, "TURN_RATE": 30 * WAVE}
    text, found = suggested({name: {"value": values} for name, values in tables.items()} | {"x": {"u": 1.5 + WAVE}})
    assert found["inputs"]["thrust"]["share"]["unit"] == "percent"
    assert "surge_force" not in found["inputs"]
    assert "gyroscope" not in found["sensors"]
    assert "# not used of TURN_RATE (MOOS: set-points): value" in text


def test_imc_velocity_has_unit_frame_and_flag_of_its_format():
    velocity = {"x": 1.5 + WAVE, "y": 0.1 * WAVE, "z": 0.1 * WAVE, "validity": np.where(WAVE > 0, 7.0, 0.0)}
    _, found = suggested({"GroundVelocity[30.23]": velocity, "Rpm": {"value": 1200 + 50 * WAVE}})
    dvl = found["sensors"]["dvl"]
    assert (dvl["frame"], dvl["unit"]) == ("FRD", "m/s")
    assert dvl["valid"] == {"column": "validity", "values": [7]}
    assert found["inputs"]["thrust"]["revolutions"]["unit"] == "rpm"


@pytest.mark.parametrize("fields", [("vx", "vy", "vz"), ("velocity.x", "velocity.y", "velocity.z")])
def test_water_linked_report_is_frd_with_its_flag(fields):
    report = dict(zip(fields, (1.5 + WAVE, 0.1 * WAVE, 0.1 * WAVE), strict=True))
    report |= dict.fromkeys(("fom", "altitude", "velocity_valid"), np.ones(TIME.size))
    _, found = suggested({"/dvl/data": report})
    dvl = found["sensors"]["dvl"]
    assert (dvl["frame"], dvl["unit"], dvl["valid"]["column"]) == ("FRD", "m/s", "velocity_valid")
    assert [*dvl["columns"].values()] == [*fields]


def test_other_table_with_name_of_known_message_is_not_known():
    assert known_message("EulerAngles", [LogColumn("roll"), LogColumn("pitch")]) is None
    assert known_message("sensor_gyro[1]", [LogColumn("x"), LogColumn("y"), LogColumn("z")]) is not None


@pytest.mark.parametrize("message", KNOWN_MESSAGES, ids=lambda message: f"{message.source} {message.table}")
def test_known_message_is_recognised_by_name_or_fields(message):
    assert message.table or message.marks or message.source == "RDI"
    assert message.fields or message.role is not Role.MEASURED or message.table == "WaterVelocity"
