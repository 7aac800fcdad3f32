"""Inputs by a map: fins, servos, thrusters and propellers."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.errors import ConfigError
from tests.logs.memory_log import (
    DVL,
    GYROSCOPE,
    INPUTS,
    TIME,
    MemoryLog,
    dvl,
    imu,
    motion,
)


def test_revolutions_and_voltage_follow_other_inputs(converted):
    _, rates, angles = motion()
    turns = {"rpm": 60.0 * np.cos(TIME), "u": 24.0 - 0.1 * TIME}
    log = MemoryLog(**{"imu": imu(rates, angles), "in": INPUTS | turns})
    inputs = "{table: in, rudder: dr, revolutions: {column: rpm, unit: rpm}, voltage: u}"
    found = converted(log, GYROSCOPE % "", inputs=inputs)
    assert [quantity.symbol for quantity in found.inputs.quantities][4:] == ["revolutions", "voltage"]
    assert_allclose(found.inputs.values[:, 4], np.cos(TIME))
    assert_allclose(found.inputs.values[:, 5], turns["u"])
    assert np.array_equal(found.inputs.values[:, 0], INPUTS["dr"])


def test_revolutions_without_unit_raise_config_error(converted):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, angles), "in": INPUTS | {"n": np.cos(TIME)}})
    with pytest.raises(ConfigError, match="rpm or turn/s"):
        converted(log, GYROSCOPE % "", inputs="{table: in, revolutions: n}")


@pytest.mark.parametrize("named", [False, True])
def test_id_separates_rows_of_servos(converted, named):
    velocity, *_ = motion()
    ids = np.tile([0.0, 1.0, 2.0], TIME.size)
    written = np.array(["Top", "right ", "left"])[ids.astype(int)] if named else ids
    servo = {"t": np.repeat(TIME, 3), "id": written, "value": np.repeat(0.1 * np.sin(TIME), 3) + 0.01 * ids}
    top, right = ("top", "Right") if named else (0, 1)
    fin = "{column: value, rows: {column: id, values: [%s]}}"
    found = converted(
        MemoryLog(dvl=dvl(velocity), servo=servo),
        DVL % "",
        inputs=f"{{table: servo, rudder: {fin % top}, elevator: {fin % right}}}",
    )
    assert_allclose(found.inputs.values[:, 0], 0.1 * np.sin(TIME))
    assert_allclose(found.inputs.values[:, 1], 0.1 * np.sin(TIME) + 0.01)
    assert not any("without a time" in remark for summary in found.summaries for remark in summary.remarks)


def test_unknown_id_raises_config_error(converted):
    velocity, *_ = motion()
    log = MemoryLog(**{"dvl": dvl(velocity), "in": {**INPUTS, "id": np.arange(TIME.size) % 3}})
    with pytest.raises(ConfigError, match=r"inputs\.rudder: no row with such a 'id'.*0, 1, 2"):
        converted(log, DVL % "", inputs="{table: in, rudder: dr, rows: {column: id, values: [7]}}")


def test_counts_of_fins_and_percent_of_a_thruster(converted):
    _, rates, angles = motion()
    table = {"t": TIME, "top": 128 - 2 * TIME, "right": 140 + 0 * TIME, "left": 116 + 0 * TIME, "cmd": 50 + 0 * TIME}
    fin = "{column: %s, centre: 128, scale: 0.5 deg, sign: %d}"
    fins = f"{{top: {fin % ('top', -1)}, right: {fin % ('right', 1)}, left: {fin % ('left', -1)}}}"
    log = MemoryLog(**{"imu": imu(rates, angles), "in": table})
    inputs = f"{{table: in, fins: {fins}, thrust: {{share: cmd, full: 8 N}}, roll_moment: propeller}}"
    found = converted(log, GYROSCOPE % "", inputs=inputs)
    assert found.inputs.values[:, 0] == pytest.approx(np.radians(TIME), abs=1e-14)
    assert found.inputs.values[:, 1] == pytest.approx(np.full(TIME.size, np.radians(6.0)))
    assert found.inputs.values[:, 2] == pytest.approx(np.full(TIME.size, 2.0))


@pytest.mark.parametrize("share", ["{column: cmd, unit: '1'}", "{column: cmd, unit: 1}", "fraction"])
def test_share_of_a_thruster_as_a_fraction(converted, share):
    """Half of the command is a quarter of the force."""
    _, rates, angles = motion()
    table = {"t": TIME, "cmd": np.full(TIME.size, 0.5), "fraction": (np.full(TIME.size, 0.5), "1")}
    log = MemoryLog(**{"imu": imu(rates, angles), "in": table})
    found = converted(log, GYROSCOPE % "", inputs=f"{{table: in, thrust: {{share: {share}, full: 8 N}}}}")
    assert found.inputs.values[:, 2] == pytest.approx(np.full(TIME.size, 2.0))


@pytest.mark.parametrize(
    ("largest", "share", "refused"), [(1.5, "cmd", True), (1.5, "stated", False), (0, "cmd", False)]
)
def test_thruster_share_without_unit_must_look_like_percent(converted, largest, share, refused):
    _, rates, angles = motion()
    wave = largest * np.cos(np.linspace(0, 3, TIME.size))
    log = MemoryLog(**{"imu": imu(rates, angles), "in": {"t": TIME, "cmd": wave, "stated": (wave, "%")}})
    inputs = f"{{table: in, thrust: {{share: {share}, full: 8 N}}}}"
    if refused:
        with pytest.raises(ConfigError, match=r"inputs\.thrust\.share: .*1\.5.* `unit: '1'`"):
            converted(log, GYROSCOPE % "", inputs=inputs)
    else:
        found = converted(log, GYROSCOPE % "", inputs=inputs)
        assert np.abs(found.inputs.values[:, 2]).max() == pytest.approx(8.0 * (0.01 * largest) ** 2)


@pytest.mark.parametrize(
    ("column", "unit", "refused"),
    [("n", "", True), ("n", ", unit: rpm", False), ("stated", "", False), ("n", ", scale: 1 rpm", False)],
)
def test_revolutions_of_a_propeller_need_a_unit(converted, column, unit, refused):
    velocity, _, _ = motion()
    turns = np.full(TIME.size, 600.0)
    log = MemoryLog(**{"dvl": dvl(velocity), "in": {"t": TIME, "n": turns, "stated": (turns, "rpm")}})
    law = f"{{table: in, thrust: {{revolutions: {{column: {column}{unit}}}, a: 0.05 N*s^2}}}}"
    if refused:
        with pytest.raises(ConfigError, match=r":\d+:\d+: inputs\.thrust\.revolutions: has no unit.*rpm"):
            converted(log, DVL % "", inputs=law)
    else:
        assert converted(log, DVL % "", inputs=law).inputs.values[:, 2] == pytest.approx(np.full(TIME.size, 5.0))


def test_propeller_that_loses_thrust_with_speed(converted):
    velocity, _, _ = motion()
    log = MemoryLog(**{"dvl": dvl(velocity), "in": {"t": TIME, "n": np.full(TIME.size, 600.0)}})
    law = "{table: in, thrust: {revolutions: {column: n, unit: rpm}, a: 0.05 N*s^2, b: -0.1 N*s^2/m}}"
    found = converted(log, DVL % "", inputs=law)
    assert found.inputs.values[:, 2] == pytest.approx(0.05 * 100.0 - 0.1 * 10.0 * velocity[:, 0])


def test_zero_inputs_are_distinguished_from_unmapped(converted):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, angles), "in": INPUTS | {"none": 0 * TIME}})
    found = converted(log, GYROSCOPE % "", inputs="{table: in, fins: {right: none}, surge_force: none}")
    assert found.remarks == ("elevator, surge_force: zero all the time", "rudder, roll_moment: not in the map, so zero")


def test_input_may_be_constant(converted):
    velocity, *_ = motion()
    log = MemoryLog(**{"dvl": dvl(velocity), "in": INPUTS})
    found = converted(log, DVL % "", inputs="{table: in, rudder: dr, elevator: 0, surge_force: {constant: 10.9 N}}")
    assert_allclose(found.inputs.values[:, 0], INPUTS["dr"])
    assert found.inputs.values[:, 1:3].tolist() == [[0.0, 10.9]] * TIME.size
    alone = converted(log, DVL % "", inputs="{surge_force: {constant: 10.9 N}, rudder: {constant: 2 deg}}").inputs
    assert_allclose(alone.values, [[np.radians(2.0), 0.0, 10.9, 0.0]] * 2)
    # They hold as long as the sensors measure, and estimators take them to.
    assert_allclose(alone.time, [0.0, np.ptp(TIME)])
    assert not alone.ends_before(float(alone.time[-1]))
    with pytest.raises(ConfigError, match="'column' or 'constant'"):
        converted(log, DVL % "", inputs="{table: in, rudder: {column: dr, constant: 0 deg}}")


@pytest.mark.parametrize(("silent", "said"), [(0.5, False), (1.5, True)])
def test_fins_that_end_early_are_reported(converted, silent, said):
    velocity, *_ = motion()
    fins = {"t": TIME - silent, "dr": INPUTS["dr"]}
    remarks = converted(
        MemoryLog(**{"dvl": dvl(velocity), "in": fins}), DVL % "", inputs="{table: in, rudder: dr}"
    ).remarks
    assert any("rudder ends at t = 0.45 s, 1.5 s before the sensors" in remark for remark in remarks) == said
