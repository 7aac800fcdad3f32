from math import pi
from pathlib import Path

import pytest

from auvid_cli.config.enums import shipped_configs
from auvid_cli.config.log_columns import unit_factor
from auvid_cli.config.log_map import load_map, plain_map
from auvid_cli.errors import ConfigError

HEAD = f"""\
name: run
vehicle: {shipped_configs() / "vehicles" / "remus100.yaml"}
logs: {{log: run.csv}}
"""
GYROSCOPE = "  gyroscope: {columns: {p: gx, r: {column: gz, unit: deg/s, sign: -1}}, standard_deviation: 0.2 deg/s}\n"
INPUTS = "inputs: {rudder: dr}\n"


@pytest.fixture
def load(tmp_path):
    """Function: the map of a text."""
    path = tmp_path / "map.yaml"

    def run(text):
        path.write_text(text)
        return load_map(path)[0]

    return run


def test_short_and_long_forms_are_equal(load):
    short = load(HEAD + "use: [1 s, 2 s]\ntime: t\nsensors:\n" + GYROSCOPE + INPUTS)
    gyroscope = short.sensors.gyroscope
    assert gyroscope.columns.p.column == "gx"
    assert gyroscope.columns.r.sign == -1
    assert list(gyroscope.signals()) == ["p", "r"]
    assert gyroscope.standard_deviation == pytest.approx((0.00349066,) * 3, rel=1e-5)
    assert short.use == ((1.0, 2.0),)
    assert (short.time.column, short.time.offset) == ("t", 0.0)
    assert short.logs["log"].file == "run.csv"
    long = HEAD.replace("run.csv", "{file: run.csv}") + "use: [[1, 2]]\ntime: {column: t}\nsensors:\n"
    assert load(long + GYROSCOPE.replace("p: gx", "p: {column: gx}") + "inputs: {rudder: {column: dr}}\n") == short


def test_bare_quaternion_and_mount_are_expanded(load):
    attitude = load(
        HEAD + "sensors:\n  attitude: {quaternion: pose.q, mount: upside down, standard_deviation: estimate}\n" + INPUTS
    ).sensors.attitude
    assert [signal.column for signal in attitude.signals().values()] == [
        "pose.q.w",
        "pose.q.x",
        "pose.q.y",
        "pose.q.z",
    ]
    assert attitude.mount.angles() == pytest.approx((3.14159265, 0.0, 0.0))


@pytest.mark.parametrize(
    ("stated", "unit", "size"),
    [
        ("Kn", "m/s", 1852 / 3600),
        ("deg", "rad", 0.017453292519943295),
        ("Degrees", "rad", 0.017453292519943295),
        ("rpm", "turn/s", 1 / 60),
        ("%", "percent", 1.0),
        ("us", "s", 1e-6),
        ("1", "percent", 100.0),
    ],
)
def test_unit_factor_of_log_units(stated, unit, size):
    assert unit_factor(stated, unit) == pytest.approx(size)


def test_files_of_command_replace_those_of_map(load, tmp_path):
    two = load(HEAD.replace("{log: run.csv}", "{a: a.csv, b: {delimiter: ';'}}") + "sensors:\n" + GYROSCOPE + INPUTS)
    assert two.files(tmp_path, ["b=x.csv"]) == {"a": (tmp_path / "a.csv",), "b": (Path("x.csv"),)}
    goes_on = two.files(tmp_path, ["a=1.csv", "b=x.csv", "a=2.csv"])
    assert goes_on == {"a": (Path("1.csv"), Path("2.csv")), "b": (Path("x.csv"),)}
    assert list(two.files(tmp_path, ["1.csv", "2.csv"]).values()) == [(Path("1.csv"),), (Path("2.csv"),)]
    with pytest.raises(ConfigError, match="no file for the log 'b'"):
        two.files(tmp_path)
    with pytest.raises(ConfigError, match=r"c=x\.csv: unknown log 'c'"):
        two.files(tmp_path, ["c=x.csv"])
    with pytest.raises(ConfigError, match=r"3\.csv: one file too many"):
        two.files(tmp_path, ["1.csv", "2.csv", "3.csv"])


@pytest.mark.parametrize(
    ("sensors", "inputs", "messages"),
    [
        ("  gyroscope: {columns: {p: gx}}\n", INPUTS, ["5:3: sensors.gyroscope: missing key 'standard_deviation'"]),
        (
            GYROSCOPE.replace("0.2 deg/s", "null"),
            INPUTS,
            ["5:93: sensors.gyroscope.standard_deviation: expected an ang"],
        ),
        (GYROSCOPE.replace("0.2 deg/s", "0"), INPUTS, ["standard deviations greater than 0"]),
        (
            GYROSCOPE.replace("deg/s, sign", "kn, sign"),
            INPUTS,
            ["columns.r.unit: 'kn': not a unit of an angular rate; expected"],
        ),
        (
            GYROSCOPE.replace("deg/s, sign", "degg/s, sign"),
            INPUTS,
            ["5:54: sensors.gyroscope.columns.r.unit: 'degg/s': not a unit of an angular rate; did you mean 'deg/s'?"],
        ),
        (
            GYROSCOPE.replace("}\n", ", frame: FLUU}\n"),
            INPUTS,
            ["frame: unknown axes 'FLUU'; did you mean 'FLU'?"],
        ),
        (GYROSCOPE.replace("}\n", ", frame: NED}\n"), INPUTS, ["frame: expected 'FRD' or 'FLU', got 'NED'"]),
        (
            "  dvl: {columns: {u: {column: u, unit: knts}}, frame: ned, standard_deviation: null}\n",
            INPUTS,
            [
                "columns.u.unit: 'knts': not a unit of a speed; did you mean 'knots'?",
                "frame: unknown axes 'ned'; did you mean 'NED'?",
                "got nothing; 'estimate'",
            ],
        ),
        (GYROSCOPE, "inputs: {rudder: dr, time: {column: t, unit: mss}}\n", ["did you mean 'ms'?"]),
        (GYROSCOPE.replace("-1", "-2"), INPUTS, ["5:67: sensors.gyroscope.columns.r.sign: expected 1 or -1, got -2"]),
        (GYROSCOPE.replace("p: gx", "pp: gx"), INPUTS, ["unknown key 'pp'; did you mean 'p'?"]),
        (GYROSCOPE.replace("p: gx, ", "").replace("r: {", "r: {scale: 2, "), INPUTS, ["expected 'unit' or 'scale'"]),
        ("  dvl: {columns: {}, standard_deviation: 1}\n", INPUTS, ["expected a column for at least one of u, v, w"]),
        (
            "  dvl: {columns: {u: u}, frame: NED, mount: sideways, position: 3, standard_deviation: 1}\n",
            INPUTS,
            ["dvl.mount: expected upside down, backward, or angles", "position: expected [forward, starboard, down]"],
        ),
        (
            "  dvl: {columns: {u: u}, frame: ENU, mount: backward, standard_deviation: 1}\n",
            INPUTS,
            ["mount: not"],
        ),
        (
            "  attitude: {standard_deviation: 1}\n",
            INPUTS,
            ["expected either 'columns' (phi, theta, psi) or 'quaternion'"],
        ),
        ("  attitude: {quaternion: q, unit: deg, standard_deviation: 1}\n", INPUTS, ["a quaternion has no unit"]),
        (
            GYROSCOPE.replace("}\n", ", exclude: [2, 1]}\n"),
            INPUTS,
            ["exclude: span [2, 1] s"],
        ),
        (GYROSCOPE.replace("p: gx", "p: {column: gx, limits: [2, 1]}"), INPUTS, ["the lowest must be less"]),
        ("", INPUTS, ["sensors: expected at least one of gyroscope, accelerometer"]),
        (GYROSCOPE, "inputs: {}\n", ["inputs: expected at least one of"]),
        (GYROSCOPE, "inputs: {fins: {top: a}, rudder: b}\n", ["expected 'fins', or 'rudder' and 'elevator', not both"]),
        (
            GYROSCOPE,
            "inputs: {fins: {top: a, upper_left: b}}\n",
            ["inputs.fins: an X tail has upper_right, lower_right"],
        ),
        (
            GYROSCOPE,
            "inputs: {thrust: {share: a, a: 1}}\n",
            ["expected 'revolutions' with 'a', or 'share' with 'full'"],
        ),
        (GYROSCOPE, "inputs: {thrust: {share: a, full: 1, b: -1}}\n", ["'b' is only possible with 'revolutions'"]),
        (GYROSCOPE, "inputs: {surge_force: f, thrust: {share: a, full: 1}}\n", ["'thrust' or 'surge_force', not both"]),
    ],
)
def test_mistakes_are_reported_with_position(load, sensors, inputs, messages):
    with pytest.raises(ConfigError) as caught:
        load(HEAD + ("sensors:\n" + sensors if sensors else "sensors: {}\n") + inputs)
    for message in messages:
        assert message in str(caught.value)


def test_plain_map_has_unit_and_components_of_sensor():
    """A sensor that is added to the table of sensors gets such a map."""
    plain = plain_map("gyroscope")
    sensor = plain.model_validate({"columns": {"q": "gy"}, "unit": "deg/s", "standard_deviation": "0.2 deg/s"})
    assert sensor.signals()["q"].column == "gy"
    assert sensor.standard_deviation == pytest.approx((0.2 * pi / 180.0,) * 3)
    with pytest.raises(ValueError, match=r"columns\.u"):
        plain.model_validate({"columns": {"u": "gy"}, "standard_deviation": "0.2 deg/s"})


# A map of the first version; the lag of the fins has moved to the vehicle since.
OLD_MAP = """\
name: run
vehicle: VEHICLE_FILE
identification: {fin_time_constant: 0.1 s, integration_step: 0.02 s, prior: {factor: 0.3}}
logs:
  main: {file: run.csv, delimiter: ";", header_row: 2, decimal: ",", missing: ["-"]}
  second: more.csv
time: {column: t, unit: ms, offset: -0.1 s}
use: [[0 s, 60 s]]
exclude: [[5 s, 6 s]]
sensors:
  gyroscope:
    log: main
    table: imu
    columns:
      p: gx
      q: {column: gy, unit: deg/s, sign: -1}
      r: {column: gz, scale: 0.1 deg/s, centre: 512, offset: 0.01 rad/s}
    frame: FLU
    mount: {yaw: 90 deg}
    standard_deviation: [0.2 deg/s, 0.2 deg/s, 0.3 deg/s]
  accelerometer:
    {log: main, unit: g, columns: {fx: ax, fy: ay, fz: az}, mount: upside down, standard_deviation: 0.1 m/s^2}
  magnetometer: {log: main, columns: {heading: {column: compass, unit: deg}}, reference: ENU, standard_deviation: 1 deg}
  dvl:
    log: second
    time: {column: stamp, table: other, unit: s}
    columns: {u: vx, v: vy, w: {column: vz, limits: [-1 m/s, 1 m/s]}}
    unit: Kn
    frame: NED
    position: [0.3 m, 0 m, 0.1 m]
    valid: {column: ok, values: [1]}
    repeats: drop
    exclude: [[1, 2]]
    standard_deviation: estimate
  attitude: {log: main, quaternion: pose.q, reference: ENU, frame: FLU, standard_deviation: 0.5 deg}
  depth: {log: main, columns: {down: {column: pressure, scale: 1.02 m}}, standard_deviation: 2 cm}
inputs:
  log: main
  fins:
    top: {column: f1, unit: deg}
    bottom: {column: f2, unit: deg, sign: -1}
    right: {column: f3, scale: 0.35 deg, centre: 128}
    left: f4
  thrust: {revolutions: {column: rpm, unit: rpm}, a: 0.02 N*s^2, b: -1e-4 N*s^2/m}
  roll_moment: propeller
"""


def test_map_of_first_version_is_still_read(load):
    found = load(OLD_MAP.replace("VEHICLE_FILE", str(shipped_configs() / "vehicles" / "remus100.yaml")))
    assert list(found.sensors.given()) == ["gyroscope", "accelerometer", "magnetometer", "dvl", "attitude", "depth"]
    assert {path for path in found.inputs.channels() if path[0] == "fins"} == {
        ("fins", fin) for fin in ("top", "bottom", "right", "left")
    }
    assert found.vehicle.actuators.fins.time_constant == 0.1
    assert (found.sensors.dvl.repeats, found.sensors.dvl.frame, found.sensors.attitude.reference) == (
        *("drop", "NED"),
        "ENU",
    )
