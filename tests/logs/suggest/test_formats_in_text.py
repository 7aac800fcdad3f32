"""Text logs in the form of known formats: file names, senders, vectors in structs, and the bottom's velocity."""

import numpy as np
import pytest
import yaml
from scipy.io import savemat

from auvid_cli.api.data import suggest_map
from auvid_cli.logs.suggest.relations import Track, fit_relations
from tests.logs.suggest.test_evidence import GROUND, TIME, TRUTH

MICROSECONDS = 12_345_678 + 1e6 * TIME


@pytest.fixture
def suggested(tmp_path):
    """Function: write logs of columns by their names, and return text and content of a map for them."""

    def run(logs):
        paths = []
        for name, columns in logs.items():
            paths.append(tmp_path / f"{name}.csv")
            rows = zip(*(np.asarray(values).tolist() for values in columns.values()), strict=True)
            paths[-1].write_text("\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)]) + "\n")
        text = suggest_map(paths, tmp_path)
        return text, yaml.safe_load(text)

    return run


def test_file_name_of_ulog_topic_gives_its_frame_and_role(suggested):
    velocity = dict(zip(("vx", "vy", "vz"), GROUND.T, strict=True))
    acceleration = {"ax": TRUTH["u"], "ay": TRUTH["v"], "az": TRUTH["w"]}
    text, found = suggested(
        {
            "log_7_sensor_gyro_0": {"timestamp": MICROSECONDS}
            | {axis: TRUTH[symbol] for axis, symbol in zip("xyz", "pqr", strict=True)},
            "log_7_vehicle_local_position_0": {"timestamp": MICROSECONDS, "v_xy_valid": np.ones(TIME.size)}
            | velocity
            | acceleration,
        }
    )
    sensors = found["sensors"]
    assert (sensors["gyroscope"]["unit"], sensors["gyroscope"]["frame"]) == ("rad/s", "FRD")
    assert (sensors["dvl"]["frame"], sensors["dvl"]["unit"]) == ("NED", "m/s")
    assert "accelerometer" not in sensors
    assert "(PX4: output of a navigation filter)" in text


def test_one_of_several_senders_is_chosen(suggested):
    both = np.concatenate([TIME, TIME + 0.003])
    order = np.argsort(both, kind="stable")
    columns = {"timestamp": 1.7e9 + both[order], "entity": np.repeat(["AHRS", "IMU"], TIME.size)[order]}
    for symbol, error in {"phi": 0.02, "theta": -0.03, "psi": 0.1}.items():
        columns[f"{symbol} (rad)"] = np.concatenate([TRUTH[symbol], TRUTH[symbol] + error])[order]
    _, found = suggested({"EulerAngles": columns})
    attitude = found["sensors"]["attitude"]
    assert attitude["rows"] == {"column": "entity", "values": ["AHRS"]}
    assert attitude["time"]["unit"] == "s"


def test_rows_of_different_sensors_are_no_senders(suggested):
    is_imu = np.arange(TIME.size) % 2 == 0
    columns = {"time": TIME, "source": np.where(is_imu, "imu", "dvl")}
    columns |= {name: np.where(is_imu, TRUTH[name], np.nan) for name in ("p", "q", "r")}
    columns |= {name: np.where(is_imu, np.nan, TRUTH[name]) for name in ("u", "v", "w")}
    _, found = suggested({"dive": columns})
    assert {"gyroscope", "dvl"} <= {*found["sensors"]}
    assert not [name for name, sensor in found["sensors"].items() if "rows" in sensor]


@pytest.mark.slow
def test_measured_servos_are_preferred_to_set_points(suggested):
    angles = np.column_stack([TRUTH[name] for name in ("rudder", "elevator", "elevator", "rudder")])
    servos = {"timestamp": np.repeat(TIME, 4), "id": np.tile(np.arange(4), TIME.size), "value (rad)": angles.ravel()}
    motion = {"timestamp": TIME} | {name: TRUTH[name] for name in ("p", "q", "r", "phi", "theta", "psi", "u")}
    _, found = suggested({"SetServoPosition": servos, "ServoPosition": servos, "nav": motion})
    inputs = found["inputs"]
    assert inputs["log"] == "ServoPosition"
    assert {name: fin["rows"]["values"] for name, fin in inputs["fins"].items()} == {
        "top": [0],
        "right": [1],
        "left": [2],
        "bottom": [3],
    }


@pytest.mark.slow
def test_velocity_of_the_bottom_has_reversed_signs(suggested):
    """PD0 by the guide: along starboard, ahead and up, and the bottom moves against the vehicle."""
    velocity = {"BT_vel_x_mms": -TRUTH["v"], "BT_vel_y_mms": -TRUTH["u"], "BT_vel_z_mms": TRUTH["w"]}
    columns = {"time": TIME} | {name: np.round(1000.0 * values) for name, values in velocity.items()}
    motion = {"time": TIME} | {name: TRUTH[name] for name in ("phi", "theta", "psi", "down")}
    _, found = suggested({"bt": columns, "nav": motion})
    dvl = found["sensors"]["dvl"]
    assert dvl["columns"] == {
        "u": {"column": "BT_vel_y_mms", "sign": -1},
        "v": {"column": "BT_vel_x_mms", "sign": -1},
        "w": "BT_vel_z_mms",
    }
    assert (dvl["unit"], dvl["frame"]) == ("mm/s", "FRD")


@pytest.mark.slow
def test_structs_of_structs_have_their_own_times_and_vectors(tmp_path):
    def vectors(*symbols):
        return np.column_stack([TRUTH[symbol] for symbol in symbols])

    imu = {"t": TIME, "gyro": vectors("p", "q", "r"), "rpy": vectors("phi", "theta", "psi")}
    dvl = {"t": TIME + 0.04, "vel": vectors("u", "v", "w")}
    savemat(tmp_path / "dive.mat", {"data": {"imu": imu, "dvl": dvl}})
    sensors = yaml.safe_load(suggest_map([tmp_path / "dive.mat"], tmp_path))["sensors"]
    assert (sensors["gyroscope"]["table"], sensors["dvl"]["table"]) == ("data.imu", "data.dvl")
    assert sensors["dvl"]["time"]["column"] == "t"
    assert [*sensors["attitude"]["columns"].values()] == ["rpy[0]", "rpy[1]", "rpy[2]"]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_current_shows_the_sign_of_sway(sign):
    """Four steady legs in a current of 0.3 m/s, without sway through the water."""
    time = 0.1 * np.arange(4000)
    psi = np.repeat([0.0, 1.6, 3.1, 4.6], 1000)
    north, east = 0.3 * np.cos(0.7), 0.3 * np.sin(0.7)
    noise = 0.02 * np.random.default_rng(1).standard_normal((2, time.size))
    u = 1.5 + north * np.cos(psi) + east * np.sin(psi) + noise[0]
    v = east * np.cos(psi) - north * np.sin(psi) + noise[1]
    fits = fit_relations({"u": Track(time, u), "v": Track(time, sign * v), "psi": Track(time, psi)})
    weights = [fit.weight for fit in fits if fit.words == "v shows the current that u shows"]
    assert len(weights) == 1
    assert weights[0] * sign > 2.5
