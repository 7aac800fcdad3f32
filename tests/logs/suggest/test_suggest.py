"""Suggested maps of logs, and refusal of a map that is not filled in."""

import gzip
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from auvid_cli.config.log_map import load_map
from auvid_cli.errors import ConfigError
from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.logs.formats.open_log import open_log
from auvid_cli.logs.suggest.suggest import suggest
from auvid_cli.text import quoted
from auvid_cli.vehicle.parameters import PARAMETERS

TIME = np.arange(200) * 0.1
WAVE = np.sin(TIME)
NOISE = np.random.default_rng(1).standard_normal(TIME.size)


def written(path: Path, **columns: np.ndarray) -> Path:
    header = ",".join(name.replace("__", " ") for name in columns)
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header=header, comments="", fmt="%.9g")
    return path


@pytest.fixture
def suggested(tmp_path):
    """Function: the suggested map of CSV columns, as text and as YAML."""

    def run(**columns):
        text = suggest([open_log(written(tmp_path / "dive 7.csv", **columns))], tmp_path)
        return text, yaml.safe_load(text)

    return run


def test_names_and_values_give_sensors_units_and_inputs(suggested):
    text, found = suggested(
        **{"timestamp": 1e3 * TIME, "gyro_x": 9 * WAVE, "gyro_y": WAVE, "gyro_z": WAVE, "acc_z": -9.8 + 0.1 * NOISE},
        **{"roll": 20 * WAVE, "pitch": 10 * WAVE, "true_heading (deg)": 180 + 90 * WAVE, "depth": -3 + WAVE},
        **{"rudder": 15 * WAVE, "rpm": 600 + WAVE},
    )
    assert found["name"] == "dive_7"
    assert found["logs"] == {"dive_7": "dive 7.csv"}
    gyroscope = found["sensors"]["gyroscope"]
    assert gyroscope["columns"] == {"p": "gyro_x", "q": "gyro_y", "r": "gyro_z"}
    assert (gyroscope["unit"], gyroscope["time"]) == ("deg/s", {"column": "timestamp", "unit": "ms"})
    assert found["sensors"]["attitude"]["columns"] == {"phi": "roll", "theta": "pitch", "psi": "true_heading"}
    assert found["sensors"]["attitude"]["unit"] == "deg"
    assert found["sensors"]["depth"]["columns"]["down"] == {"column": "depth", "sign": -1}
    assert found["sensors"]["accelerometer"]["frame"] == "FRD"
    assert "no column found for fx, fy" in text
    assert found["inputs"]["rudder"] == {"column": "rudder", "unit": "deg"}
    assert found["inputs"]["thrust"]["revolutions"] == {"column": "rpm", "unit": "rpm"}
    assert "dvl" not in found["sensors"]


def test_log_of_navigation_filter_alone_requires_sensors(suggested):
    text, found = suggested(time=TIME, ekf_u=WAVE, ekf_roll=WAVE, ekf_yaw=WAVE)
    assert found["sensors"] is None
    (line,) = (line for line in text.splitlines() if "looks like a sensor" in line)
    assert "outputs of a navigation filter do not count" in line
    assert "velocities u, v, w of a DVL" in line


def test_absurd_numbers_do_not_count(suggested):
    wild = WAVE.copy()
    wild[[50, 51]] = 1.7e308, -1.7e308
    _, found = suggested(timestamp=TIME, u=wild, v=WAVE, w=WAVE)
    assert found["sensors"]["dvl"]["columns"] == {"u": "u", "v": "v", "w": "w"}


def test_comment_gives_scatter_of_signal(suggested):
    text, found = suggested(**{"t": TIME, "u (m/s)": 2.0 + 0.03 * NOISE, "rudder": 0.1 * WAVE})
    assert found["sensors"]["dvl"]["standard_deviation"] == "estimate"
    assert "scatter of the signals: 0.03" in text or "scatter of the signals: 0.02" in text


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("one", "other", "pair"),
    [
        ("fin_right", "fin_left", "right and left"),
        ("fin_stbd", "fin_port", "right and left"),
        ("fin_top", "fin_bottom", "top and bottom"),
    ],
)
def test_opposite_fins_are_reported(suggested, one, other, pair, sign):
    text, found = suggested(t=TIME, u=WAVE, **{one: 20 * WAVE, other: sign * 20 * WAVE + 0.1 * NOISE})
    keys = pair.split(" and ")
    assert [found["inputs"]["fins"][key]["column"] for key in keys] == [one, other]
    assert (f"{pair} move in opposite directions" in text) == (sign < 0)


def test_endings_of_names_give_units_of_sensors(suggested):
    """The numbers are small enough for radians."""
    _, found = suggested(
        **{"t_ins": TIME, "p_dps": 0.1 * WAVE, "q_dps": 0.1 * WAVE, "r_dps": 0.1 * WAVE, "roll_deg": 0.1 * WAVE},
        **{"u_kn": WAVE, "depth_cm": 5 + WAVE, "acc_x_g": WAVE, "acc_z_g": -1 + 0.01 * WAVE, "rudder_deg": 20 * WAVE},
    )
    units = {name: (sensor["unit"], *sensor["columns"].values()) for name, sensor in found["sensors"].items()}
    assert units == {
        "gyroscope": ("deg/s", "p_dps", "q_dps", "r_dps"),
        "accelerometer": ("g", "acc_x_g", "acc_z_g"),
        "dvl": ("knot", "u_kn"),
        "attitude": ("deg", "roll_deg"),
        "depth": ("cm", "depth_cm"),
    }
    assert all(sensor["time"]["column"] == "t_ins" for sensor in found["sensors"].values())
    # By the direction of gravity.
    assert found["sensors"]["accelerometer"]["frame"] == "FRD"


def test_names_of_sensor_and_component_are_found(suggested):
    names = "gyro_p", "gyroscope_r", "accelerometer_fx", "dvl_u", "attitude_psi"
    _, found = suggested(t=TIME, **{name: WAVE for name in names})
    assert {column for sensor in found["sensors"].values() for column in sensor["columns"].values()} == {*names}


def test_names_with_owner_unit_and_filter_are_found(suggested):
    names = (
        "platform_pitch_angle_degree",
        "platform_roll_angle",
        "platform_orientation",
        "depth_filt",
        "pitch_rate-rad_s",
    )
    _, found = suggested(t=TIME, **{name: 0.1 * WAVE for name in names}, platform_rudder_angle=0.15 * WAVE)
    columns = {column for sensor in found["sensors"].values() for column in sensor["columns"].values()}
    assert columns == {*names}
    assert found["inputs"]["rudder"]["column"] == "platform_rudder_angle"


def test_platform_velocities_and_revolutions_have_units(suggested):
    names = [f"platform_{axis}_velocity_wrt_ground_meter_per_second" for axis in "xyz"]
    rate = "platform_propeller_rotation_rate_radian_per_second"
    _, found = suggested(t=TIME, **{name: 1.5 + 0.1 * WAVE for name in names}, **{rate: 30 + WAVE})
    assert [*found["sensors"]["dvl"]["columns"].values()] == names
    assert found["inputs"]["thrust"]["revolutions"] == {"column": rate, "unit": "rad/s"}


def test_fins_named_by_side_are_found(suggested):
    _, found = suggested(t=TIME, u=WAVE, top=WAVE, bottom=WAVE, port=WAVE, starboard=WAVE)
    fins = {key: fin["column"] for key, fin in found["inputs"]["fins"].items()}
    assert fins == {"top": "top", "bottom": "bottom", "left": "port", "right": "starboard"}


def test_escaped_underscore_is_understood(suggested):
    _, found = suggested(t=TIME, u=WAVE, **{r"pitch\_input": 0.1 * WAVE, r"yaw\_input": 0.1 * WAVE})
    assert [found["inputs"][key]["column"] for key in ("elevator", "rudder")] == [r"pitch\_input", r"yaw\_input"]


@pytest.mark.parametrize(
    ("thruster", "signal"),
    [
        (0.5 + 0.5 * WAVE, {"unit": "1"}),
        (50 + 50 * WAVE, {"unit": "percent"}),
        (128 + 100 * WAVE, {"centre": 128, "scale": "0.787 percent"}),
        (1500 + 400 * WAVE, {"centre": 1500, "scale": "0.25 percent"}),
    ],
)
def test_numbers_give_unit_of_thruster(suggested, thruster, signal):
    _, found = suggested(t=TIME, u=WAVE, thruster=thruster)
    assert found["inputs"]["thrust"]["share"] == {"column": "thruster", **signal}


@pytest.mark.parametrize(
    ("heading", "signal"),
    [
        ("Thruster (rpm)", {"column": "Thruster"}),
        ("Throttle [rev/s]", {"column": "Throttle"}),
        ("prop_rpm", {"column": "prop_rpm", "unit": "rpm"}),
        ("PropRPM", {"column": "PropRPM", "unit": "rpm"}),
        ("motor_rps", {"column": "motor_rps", "unit": "turn/s"}),
        ("rps", {"column": "rps", "unit": "turn/s"}),
    ],
)
def test_revolutions_are_found_by_name_or_unit(suggested, heading, signal):
    _, found = suggested(**{"t": TIME, "u": WAVE, heading: 600 + 100 * WAVE})
    assert found["inputs"]["thrust"] == {"revolutions": signal, "a": None}


def test_endings_of_names_give_units_of_inputs(suggested):
    _, found = suggested(t=TIME, u=WAVE, rudder_deg=0.5 * WAVE, thruster_pct=0.5 + 0.5 * WAVE)
    assert found["inputs"]["rudder"] == {"column": "rudder_deg", "unit": "deg"}
    assert found["inputs"]["thrust"]["share"] == {"column": "thruster_pct", "unit": "percent"}


@pytest.mark.parametrize(("hold", "share"), [(4, "75 % of the rows repeat"), (1, None)])
def test_repeated_rows_are_reported(suggested, hold, share):
    text, _ = suggested(t=TIME, u=2 + NOISE[(np.arange(TIME.size) // hold) * hold], rudder=WAVE)
    assert share in text if share else "repeat" not in text


class Topics(Log):
    """A bag of topics, each a dictionary of fields."""

    def __init__(self, **topics):
        super().__init__(Path("dive.mcap"))
        self.topics = {name.replace("__", "/"): {"@log_time": TIME} | fields for name, fields in topics.items()}

    def tables(self):
        return {name: tuple(map(LogColumn, fields)) for name, fields in self.topics.items()}

    def read(self, table, columns):
        return {name: self.topics[table][name] for name in columns}


def test_topics_of_bare_numbers_are_found_by_topic():
    log = Topics(
        **{"__auv__depth": {"data": 3 + WAVE}, "__gyro": {f"data[{k}]": 0.1 * WAVE for k in range(3)}},
        **{"__fins__top": {"data": 20 * WAVE}, "__fins__stbd": {"data": 20 * WAVE}, "__rpm": {"data": 600 + WAVE}},
    )
    found = yaml.safe_load(suggest([log], Path()))
    assert (found["sensors"]["depth"]["table"], found["sensors"]["depth"]["columns"]) == (
        "/auv/depth",
        {"down": "data"},
    )
    assert found["sensors"]["gyroscope"]["columns"] == {"p": "data[0]", "q": "data[1]", "r": "data[2]"}
    inputs = found["inputs"]
    signals = {**inputs["fins"], "rpm": inputs["thrust"]["revolutions"]}
    places = {key: signal.get("table", inputs["table"]) for key, signal in signals.items()}
    assert places == {"top": "/fins/top", "right": "/fins/stbd", "rpm": "/rpm"}
    assert {signal["column"] for signal in signals.values()} == {"data"}


def test_px4_vectors_and_quaternion_are_found():
    vectors = {f"xyz[{k}]": 0.1 * WAVE for k in range(3)}
    half = 0.1 * WAVE
    quaternion = {"q[0]": np.cos(half), "q[1]": np.sin(half), "q[2]": 0.0 * half, "q[3]": 0.0 * half}
    topics = {"vehicle_angular_velocity": vectors, "vehicle_acceleration": vectors, "vehicle_attitude": quaternion}
    wanted = {"vehicle_attitude_setpoint": quaternion, "vehicle_local_position": {"vx": WAVE, "vy": WAVE, "vz": WAVE}}
    text = suggest([Topics(**topics, **wanted)], Path())
    sensors = yaml.safe_load(text)["sensors"]
    assert {name: sensors[name]["table"] for name in ("gyroscope", "accelerometer", "attitude")} == {
        "gyroscope": "vehicle_angular_velocity",
        "accelerometer": "vehicle_acceleration",
        "attitude": "vehicle_attitude",
    }
    assert list(sensors["gyroscope"]["columns"].values()) == ["xyz[0]", "xyz[1]", "xyz[2]"]
    assert sensors["attitude"]["quaternion"] == {"w": "q[0]", "x": "q[1]", "y": "q[2]", "z": "q[3]"}
    assert "vehicle_attitude_setpoint (PX4: set-points)" in text


def test_validity_of_message_is_preferred_to_that_of_part():
    dvl = {"beams[0].valid": np.ones(TIME.size), "velocity_valid": np.ones(TIME.size), "velocity.x": WAVE}
    found = yaml.safe_load(suggest([Topics(__dvl=dvl)], Path()))
    assert found["sensors"]["dvl"]["valid"]["column"] == "velocity_valid"


def test_time_and_fin_of_slocum_glider_are_found(suggested):
    headings = {"m_present_time (timestamp)": 1.6e9 + TIME, "m_depth (m)": 5 + WAVE, "c_fin (rad)": 0.2 * WAVE}
    text, found = suggested(**headings)
    assert found["sensors"]["depth"]["time"] == {"column": "m_present_time", "unit": "s"}
    assert "check: the log states the unit 'timestamp'" in text
    assert found["inputs"]["rudder"] == {"column": "c_fin"}


def test_possible_fins_are_listed_without_known_fin(suggested):
    text, _ = suggested(t=TIME, u=WAVE, rudder_left=WAVE, fin1=WAVE, confined=WAVE)
    assert "no column looks like a fin or a propeller; possible fins: rudder_left, fin1\n" in text


def test_list_of_possible_fins_is_listed():
    text = suggest([Topics(__fins={"data[0]": WAVE, "data[1]": WAVE}, __rpm={"data": 600 + WAVE})], Path())
    assert "possible fins: /fins data[0], /fins data[1]" in text


IMU = [f"orientation.{axis}" for axis in "wxyz"]
IMU += [f"{stem}.{axis}" for stem in ("angular_velocity", "linear_acceleration") for axis in "xyz"]


@pytest.mark.parametrize(("gravity", "frame", "reference"), [(9.8, "FLU", "ENU"), (-9.8, "FRD", "NED")])
def test_sensors_of_standard_message_have_same_axes(gravity, frame, reference):
    fields = {name: 0.1 * WAVE for name in IMU} | {"linear_acceleration.z": gravity + 0.1 * WAVE}
    odometry = {"pose.pose.orientation.w": np.ones(TIME.size), "twist.twist.linear.x": 1 + WAVE}
    text = suggest([Topics(__imu=fields, __odometry=odometry)], Path())
    found = yaml.safe_load(text)["sensors"]
    assert {found[name]["frame"] for name in ("gyroscope", "accelerometer", "attitude")} == {frame}
    assert found["attitude"]["reference"] == reference
    assert found["dvl"]["frame"] == "FLU"
    assert "sensor_msgs/Imu is FLU by REP 103" in text


def test_upside_down_sensor_and_validity_flag_are_found(suggested):
    # A sensor mounted upside down: roll near +-180 degrees.
    roll = np.degrees(np.arctan2(np.sin(np.pi + 0.1 * WAVE), np.cos(np.pi + 0.1 * WAVE)))
    _, found = suggested(t=TIME, roll=roll, att_valid=np.ones(TIME.size), rudder=WAVE)
    assert found["sensors"]["attitude"]["mount"] == "upside down"
    assert found["sensors"]["attitude"]["valid"] == {"column": "att_valid", "values": [True, 1]}


def test_column_without_numbers_is_left_out(suggested):
    text, found = suggested(t=TIME, u=WAVE, v=np.full(TIME.size, np.nan), rudder=WAVE)
    assert found["sensors"]["dvl"]["columns"] == {"u": "u"}
    assert "no column found for v, w" in text


def test_fins_in_counts_get_centre_and_scale(suggested):
    _, found = suggested(t=TIME, u=WAVE, **{"Fin Yaw T": 128 + 90 * WAVE, "Fin Pitch R": 128 + 5 * WAVE})
    assert found["inputs"]["fins"]["top"] == {"column": "Fin Yaw T", "centre": 128, "scale": None}
    assert found["inputs"]["fins"]["right"]["scale"] is None


def test_changing_quaternion_is_preferred(tmp_path):
    still, moving = {axis: np.ones(TIME.size) for axis in "wxyz"}, {axis: WAVE for axis in "wxyz"}
    first = written(tmp_path / "a.csv", t=TIME, **{f"orientation.{axis}": q for axis, q in still.items()})
    second = written(tmp_path / "b.csv", t=TIME, **{f"orientation.{axis}": q for axis, q in moving.items()})
    found = yaml.safe_load(suggest([open_log(first), open_log(second)], tmp_path))
    attitude = found["sensors"]["attitude"]
    assert (attitude["log"], attitude["frame"], attitude["reference"]) == ("b", "FLU", "ENU")
    assert attitude["quaternion"]["w"] == "orientation.w"


def test_compressed_log_with_text_clock_is_read(tmp_path):
    path = tmp_path / "log.csv.gz"
    rows = "\n".join(f"59:{40 + k}.0,{k}.5,{k}" for k in range(20))
    path.write_bytes(gzip.compress(f"Time,Vehicle depth (m),depth (m)\n{rows}\n".encode()))
    found = yaml.safe_load(suggest([open_log(path)], tmp_path))
    assert found["sensors"]["depth"]["time"] == {"column": "Time"}
    assert found["sensors"]["depth"]["unit"] == "m"


class OneColumn(Log):
    """A log of times and one wave, of any names and unit."""

    def __init__(self, path, table, column):
        super().__init__(path)
        self.table, self.column = table, column

    def tables(self):
        return {self.table: (LogColumn("time"), self.column)}

    def read(self, table, columns):
        return {name: TIME if name == "time" else WAVE for name in columns}


NAMES = st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Zl", "Zp", "Cn", "Co")), max_size=12)


@pytest.mark.slow
@given(
    NAMES, NAMES, st.sampled_from(["roll", "u", "rudder", "depth"]), st.sampled_from(["", "%", "deg", "m", "#", "°"])
)
def test_map_with_any_names_is_valid_yaml(table, stem, ending, unit):
    column = LogColumn(f"{stem}.{ending}", unit)
    found = yaml.safe_load(suggest([OneColumn(Path(f"{stem.replace('/', '')}7.csv"), table, column)], Path()))
    assert isinstance(next(iter(found["logs"])), str)
    rows = found["inputs"] if ending == "rudder" else next(iter(found["sensors"].values()))
    signals = rows["rudder"] if ending == "rudder" else next(iter(rows["columns"].values()))
    assert rows.get("table", "") == table
    assert (signals["column"] if isinstance(signals, dict) else signals) == column.name


def test_map_with_missing_values_raises_config_error(suggested, tmp_path):
    text, _ = suggested(t=TIME, u=2.0 + WAVE, rudder=0.1 * WAVE)
    path = tmp_path / "map.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_map(path)
    for missing in ("vehicle.parameters.m: ", "vehicle.size.length: ", "sensors.dvl.unit: "):
        assert missing in str(caught.value)
    assert str(caught.value).count("got nothing") == text.count(": null # required") == len(PARAMETERS) + 2 + 1


@given(st.text(st.characters(exclude_categories=["Cs"])))
@example('\n" a: b\x1b\\\u202e')
def test_quoted_name_survives_yaml(name):
    written = quoted(name)
    assert written.isprintable()
    assert yaml.safe_load(f"column: {written} # check\n") == {"column": name}
