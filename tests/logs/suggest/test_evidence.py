"""The suggested map restores one motion from logs in many conventions, by the evidence of the data."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
import yaml

from auvid_cli.arrays import wrap
from auvid_cli.config.enums import shipped_configs
from auvid_cli.config.log_map import load_map
from auvid_cli.logs.convert import convert
from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.logs.suggest.suggest import suggest
from auvid_cli.vehicle.rigid_body import GRAVITY, body_rates, body_to_earth

# The loader in C, where PyYAML has it, is ten times as fast.
safe_load = partial(yaml.load, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
STEP = 0.1
TIME = STEP * np.arange(2000)
VEHICLE = shipped_configs() / "vehicles" / "vt690.yaml"
SENSORS = {
    "gyroscope": ("p", "q", "r"),
    "accelerometer": ("fx", "fy", "fz"),
    "dvl": ("u", "v", "w"),
    "attitude": ("phi", "theta", "psi"),
    "depth": ("down",),
}


def moving(seed=1):
    """Columns of a torpedo that steers and dives by steps of its fins, forward-right-down, in SI."""
    rng = np.random.default_rng(seed)
    rudder, elevator = (np.repeat(0.2 * rng.uniform(-1, 1, 40), 50) for _ in range(2))
    r, q, theta, psi = np.zeros((4, TIME.size))
    for k in range(TIME.size - 1):
        r[k + 1] = r[k] + STEP * (-r[k] / 1.5 - 0.6 * rudder[k])
        q[k + 1] = q[k] + STEP * (-q[k] - 0.5 * elevator[k] - 0.5 * theta[k])
        theta[k + 1], psi[k + 1] = theta[k] + STEP * q[k], psi[k] + STEP * r[k]
    phi = 0.3 * r + 0.05 * np.sin(1.1 * TIME)
    angles = np.column_stack((phi, theta, psi))
    u = 1.6 + 0.2 * np.sin(0.21 * TIME) - 0.3 * np.abs(r)
    velocity = np.column_stack((u, -0.5 * r, 1.5 * q))
    rates = body_rates(TIME, angles)
    p, q, r = rates.T
    u_dot, v_dot, w_dot = np.gradient(velocity, TIME, axis=0).T
    ground = body_to_earth(angles, velocity)
    force = {
        "fx": u_dot + q * velocity[:, 2] - r * velocity[:, 1] + GRAVITY * np.sin(theta),
        "fy": v_dot + r * u - p * velocity[:, 2] - GRAVITY * np.cos(theta) * np.sin(phi),
        "fz": w_dot + p * velocity[:, 1] - q * u - GRAVITY * np.cos(theta) * np.cos(phi),
    }
    columns = {"p": p, "q": q, "r": r, **force, "phi": phi, "theta": theta, "psi": psi}
    columns |= dict(zip("uvw", velocity.T, strict=True))
    columns["down"] = 30.0 + np.cumsum(ground[:, 2]) * STEP
    sizes = dict.fromkeys(columns, 2e-3) | dict.fromkeys("uvw", 0.01) | dict.fromkeys(force, 0.05) | {"down": 0.02}
    noisy = {name: values + sizes[name] * rng.standard_normal(TIME.size) for name, values in columns.items()}
    return noisy | {"rudder": rudder, "elevator": elevator}, ground


TRUTH, GROUND = moving()


class Columns(Log):
    """One table of columns in memory."""

    def __init__(self, columns):
        super().__init__(Path("dive.csv"))
        self.columns = {"t": TIME} | columns

    def tables(self):
        return {"": tuple(map(LogColumn, self.columns))}

    def read(self, table, columns):
        return {name: self.columns[name] for name in columns}


def turned(*names, factor=-1.0, offset=0.0):
    """A mutation: columns by a factor and an offset."""
    return lambda log: log | {name: factor * log[name] + offset for name in names}


def late(*names, seconds):
    return lambda log: log | {name: np.interp(TIME - seconds, TIME, log[name]) for name in names}


def renamed(old, new):
    return lambda log: {new if name == old else name: values for name, values in log.items()}


def exchanged(log):
    return log | {"rudder": log["elevator"], "elevator": log["rudder"]}


def over_ground(log):
    return log | dict(zip("uvw", GROUND.T, strict=True))


def upside_down(log):
    return log | {"phi": np.mod(log["phi"], 2 * np.pi) - np.pi}


MUTATIONS = {
    "as it is": lambda log: log,
    "rudder reversed": turned("rudder"),
    "elevator reversed": turned("elevator"),
    "fins exchanged": exchanged,
    "fins in degrees": turned("rudder", "elevator", factor=57.29578),
    "gyroscope FLU": turned("q", "r"),
    "r reversed": turned("r"),
    "q reversed": turned("q"),
    "gyroscope in degrees": turned("p", "q", "r", factor=57.29578),
    "attitude in degrees": turned("phi", "theta", "psi", factor=57.29578),
    "attitude FLU from ENU": lambda log: turned("psi", offset=np.pi / 2)(turned("theta")(log)),
    "heading ENU": turned("psi", offset=np.pi / 2),
    "theta reversed": turned("theta"),
    "phi reversed": turned("phi"),
    "upside down": upside_down,
    "depth as height": turned("down"),
    "depth in mm": turned("down", factor=1000.0),
    "depth in feet": turned("down", factor=1 / 0.3048),
    "knots": turned("u", "v", "w", factor=1 / 0.514444),
    "mm/s": turned("u", "v", "w", factor=1000.0),
    "dvl FLU": turned("v", "w"),
    "w reversed": turned("w"),
    "u reversed": turned("u"),
    "dvl NED": over_ground,
    "accelerometer FLU": turned("fy", "fz"),
    "g": turned("fx", "fy", "fz", factor=1 / GRAVITY),
    "fx reversed": turned("fx"),
    "attitude late": late("phi", "theta", "psi", seconds=0.3),
}
PAIRS = [
    ("rudder reversed", "r reversed"),
    ("fins exchanged", "rudder reversed"),
    ("gyroscope FLU", "gyroscope in degrees"),
    ("attitude in degrees", "q reversed"),
    ("attitude FLU from ENU", "dvl NED"),
    ("heading ENU", "dvl FLU"),
    ("heading ENU", "accelerometer FLU"),
    ("depth in mm", "knots"),
    ("depth in feet", "knots"),
    ("depth as height", "theta reversed"),
    ("upside down", "gyroscope FLU"),
    ("attitude late", "dvl NED"),
]


@pytest.mark.slow
@pytest.mark.parametrize("names", [*((name,) for name in MUTATIONS), *PAIRS], ids=" and ".join)
def test_suggested_map_restores_motion(names, tmp_path):
    columns = TRUTH
    for name in names:
        columns = MUTATIONS[name](columns)
    log = Columns(columns)
    found = safe_load(suggest([log], Path()))
    found["vehicle"] = str(VEHICLE)
    for sensor in found["sensors"].values():
        sensor["standard_deviation"] = "estimate"
    path = tmp_path / "map.yaml"
    path.write_text(yaml.safe_dump(found))
    restored = convert(*load_map(path), {"dive": log})
    for name, symbols in SENSORS.items():
        record = restored.sensors[name]
        for symbol, values in zip(symbols, record.values.T, strict=True):
            error = np.interp(TIME, record.time + restored.origin, values) - TRUTH[symbol]
            if symbol in ("phi", "psi"):
                error = wrap(error)
            assert np.sqrt(np.nanmean(np.square(error[20:-20]))) < 0.3 * np.std(TRUTH[symbol]), symbol
    for symbol, values in zip(("rudder", "elevator"), restored.inputs.values.T, strict=False):
        assert np.std(np.interp(TIME, restored.inputs.time + restored.origin, values) - TRUTH[symbol]) < 0.02, symbol


def suggested(columns):
    text = suggest([Columns(columns)], Path())
    return text, safe_load(text)


@pytest.mark.slow
def test_reference_is_not_asked_if_heading_is_turned():
    text, found = suggested(TRUTH | {"psi": 0.5 * np.pi - TRUTH["psi"]})
    attitude = found["sensors"]["attitude"]
    assert attitude["columns"]["psi"] == {"column": "psi", "sign": -1, "offset": "90 deg"}
    assert attitude["reference"] == "NED"
    assert "reference: NED # psi is clockwise from north" in text
    assert "reference: NED # check" in suggested(TRUTH)[0]


@pytest.mark.slow
def test_velocity_in_cm_keeps_depth_in_m():
    """Velocities above 200 are first assumed to be in mm/s."""
    _, found = suggested(TRUTH | {name: 150.0 * TRUTH[name] for name in "uvw"} | {"down": 1.5 * TRUTH["down"]})
    assert (found["sensors"]["dvl"]["unit"], found["sensors"]["depth"]["unit"]) == ("cm/s", "m")


@pytest.mark.slow
def test_heading_from_east_gets_sign_and_offset():
    columns = renamed("psi", "Yaw_ENU")(MUTATIONS["heading ENU"](TRUTH))
    text, found = suggested(columns)
    assert found["sensors"]["attitude"]["columns"]["psi"] == {"column": "Yaw_ENU", "sign": -1, "offset": "90 deg"}
    assert "psi: {column: Yaw_ENU, sign: -1, offset: 90 deg} # check: opposite sign; strong evidence" in text


@pytest.mark.slow
@pytest.mark.parametrize("left_out", [(), ("p", "q", "r"), ("p", "q", "r", "u", "v", "w")])
def test_negative_depth_keeps_signs_of_vertical_plane(left_out):
    own = {name: values for name, values in TRUTH.items() if name not in ("fx", "fy", "fz", *left_out)}
    _, found = suggested(own | {"down": own["down"] - own["down"].max() - 0.5})
    assert found["sensors"]["depth"]["columns"] == {"down": "down"}
    assert found["sensors"]["attitude"]["columns"]["theta"] == "theta"
    assert found["sensors"]["attitude"]["frame"] == "FRD"
    assert "sign" not in found["inputs"]["elevator"]


def test_velocity_named_north_and_east_is_over_ground():
    called = ("vel_north", "vel_east", "vel_down")
    kept = {name: TRUTH[name] for name in (*SENSORS["gyroscope"], *SENSORS["attitude"], "down", "rudder", "elevator")}
    text, found = suggested(kept | dict(zip(called, GROUND.T, strict=True)))
    dvl = found["sensors"]["dvl"]
    assert (dvl["frame"], tuple(dvl["columns"].values())) == ("NED", called)
    assert "check: velocity over ground by its names" in text
    assert "not used" not in text


@pytest.mark.slow
def test_comment_states_evidence_of_line():
    text, _ = suggested(TRUTH)
    line = next(line for line in text.splitlines() if "rudder: {" in line)
    assert "strong evidence for the sign of rudder: r responds to rudder (correlation 0.9" in line


def test_comment_states_missing_evidence():
    text, _ = suggested({"u": TRUTH["u"], "rudder": TRUTH["rudder"]})
    assert "rudder: {column: rudder, unit: rad} # check: unit and sign;" in text
    assert "no evidence for the sign of rudder" in text


@pytest.mark.slow
def test_flag_of_dvl_is_not_used_for_other_sensors():
    _, found = suggested(TRUTH | {"dvl_valid": np.ones(TIME.size)})
    assert [name for name, sensor in found["sensors"].items() if "valid" in sensor] == ["dvl"]
    _, found = suggested(TRUTH | {"valid": np.ones(TIME.size)})
    assert not [name for name, sensor in found["sensors"].items() if "valid" in sensor]


def test_rows_without_bottom_lock_are_no_evidence():
    lost = np.arange(TIME.size) % 300 > 250
    log = MUTATIONS["heading ENU"]({name: TRUTH[name] for name in (*"uvw", "theta", "psi", "rudder")})
    log = renamed("psi", "Yaw_ENU")(MUTATIONS["dvl FLU"](log))
    without = {name: np.where(lost, 30.0, log[name]) for name in "uvw"}
    text, found = suggested(log | without | {"bottom_lock": np.where(lost, 0.0, 1.0)})
    dvl = found["sensors"]["dvl"]
    assert (dvl["frame"], dvl["valid"]["column"]) == ("FLU", "bottom_lock")
    assert "not used" not in text


def test_heading_from_east_leaves_axes_of_pitch():
    log = renamed("psi", "Yaw_ENU")(
        MUTATIONS["heading ENU"]({name: TRUTH[name] for name in ("theta", "psi", "rudder")})
    )
    text, found = suggested(log)
    attitude = found["sensors"]["attitude"]
    assert (attitude["frame"], attitude["columns"]["theta"]) == ("FRD", "theta")
    assert "no evidence for the sign of theta" in text


def test_weakly_correlated_signals_give_no_delay():
    heaving = np.convolve(np.random.default_rng(3).standard_normal(TIME.size), np.full(30, 0.025), "same")
    log = {name: TRUTH[name] for name in ("u", "theta", "w")}
    later = np.interp(TIME - 0.4, TIME, TRUTH["down"])
    _, found = suggested(log | {"depth": later + heaving})
    assert "offset" not in found["sensors"]["depth"]["time"]


@pytest.mark.slow
def test_unused_columns_are_listed():
    more = {"battery": TIME, "desired_depth": TIME, "target.roll": TIME, "mode": 0.0 * TIME, "p2": TRUTH["p"]}
    text, found = suggested(TRUTH | more | {"yaw_copy": TRUTH["phi"], "pitch_angle": 0.5 * TRUTH["u"]})
    assert found["sensors"]["attitude"]["columns"]["phi"] == "phi"
    reasons = {
        "a set-point?": "desired_depth, target.roll",
        "constant": "mode",
        "same as p": "p2",
        "same as phi": "yaw_copy",
        "another attitude": "pitch_angle",
        "no name of a signal that a map has": "battery",
    }
    for reason, columns in reasons.items():
        assert f"{columns} ({reason})" in text.replace("\n#  ", "")


class Topics(Columns):
    """Several tables of columns in memory."""

    def tables(self):
        return {
            table: tuple(map(LogColumn, ("t", *columns))) for table, columns in self.columns.items() if table != "t"
        }

    def read(self, table, columns):
        return {name: ({"t": TIME} | self.columns[table])[name] for name in columns}


def test_word_within_name_marks_set_point():
    log = Topics({"DesiredHeading": {"value": TRUTH["psi"]}, "nav": {"yaw": TRUTH["psi"], "depthRef": TRUTH["down"]}})
    text = suggest([log], Path())
    assert "# not used of DesiredHeading (IMC: set-points): value" in text
    assert "depthRef (a set-point?)" in text


def test_one_letter_names_of_inertial_sensors_are_found():
    names = {"ax": "fx", "ay": "fy", "az": "fz", "gx": "p", "gy": "q", "gz": "r"}
    _, found = suggested({name: TRUTH[symbol] for name, symbol in names.items()})
    assert found["sensors"]["accelerometer"]["columns"] == {"fx": "ax", "fy": "ay", "fz": "az"}
    assert found["sensors"]["gyroscope"]["columns"] == {"p": "gx", "q": "gy", "r": "gz"}


def test_reference_is_left_out_and_filter_output_is_marked():
    angles = {name: TRUTH[name] for name in ("phi", "theta", "psi")}
    log = Topics(
        {"/reference": angles | {"depth": TRUTH["down"]}, "/ekf/state": angles, "/sensor": {"psi": TRUTH["psi"]}}
    )
    text = suggest([log], Path())
    found = safe_load(text)["sensors"]
    assert [*found] == ["attitude"]
    assert found["attitude"]["table"] == "/sensor"
    assert "not used of /reference (set-points): phi, theta, psi, depth" in text
    alone = suggest([Topics({"/ekf/state": angles})], Path())
    assert "attitude: # check: by its name the output of a navigation filter" in alone


def test_measured_column_is_preferred_to_filter_output():
    velocity, psi = {f"GLOBAL_POSITION_INT.v{axis}": TRUTH[name] for axis, name in zip("xy", "uv", strict=True)}, "psi"
    text, found = suggested(velocity | {"nav_heading": TRUTH[psi], "heading_filt": TRUTH[psi]})
    assert "dvl: # check: by its name the output of a navigation filter" in text
    assert found["sensors"]["attitude"]["columns"]["psi"] == "heading_filt"
    assert "attitude: #" not in text
    assert text.endswith("# not used: nav_heading (output of a navigation filter?)\n")


def test_several_thrusters_give_no_surge_force():
    log = Topics({f"/thruster_{k}/thrust": {"data": TIME} for k in range(4)} | {"/dvl": {"u": TRUTH["u"]}})
    text = suggest([log], Path())
    assert "surge_force" not in safe_load(text)["inputs"]
    assert "/thruster_0/thrust data, /thruster_1/thrust data" in text
    assert "several thrusters are not one surge force" in text


@pytest.mark.slow
@pytest.mark.parametrize(
    "names",
    [
        ("rpm_port", "rpm_starboard"),
        ("left_thruster", "right_thruster"),
        ("thruster1", "thruster2"),
        ("thruster_port_cmd", "thruster_stbd_cmd"),
        ("thruster_1_rpm", "thruster_2_rpm"),
        ("thrust_fl", "thrust_fr"),
    ],
)
def test_thrusters_of_both_sides_give_no_surge_force(names):
    text, found = suggested(TRUTH | dict.fromkeys(names, TIME))
    assert not {"thrust", "surge_force"} & {*found["inputs"]}
    assert f"check: {', '.join(names)}: several thrusters are not one surge force" in text


def test_constant_thrust_in_own_table_is_found():
    log = Topics({"DESIRED_RUDDER": {"value": TRUTH["rudder"]}, "DESIRED_THRUST": {"value": np.full(TIME.size, 40.0)}})
    found = safe_load(suggest([log], Path()))["inputs"]
    assert (found["table"], found["thrust"]["share"]["table"]) == ("DESIRED_RUDDER", "DESIRED_THRUST")


def test_angles_in_two_tables_form_one_attitude():
    log = Topics({"/tilt": {"roll": TRUTH["phi"], "pitch": TRUTH["theta"]}, "/compass": {"heading": TRUTH["psi"]}})
    attitude = safe_load(suggest([log], Path()))["sensors"]["attitude"]
    assert (attitude["table"], attitude["columns"]["theta"]) == ("/tilt", "pitch")
    assert attitude["columns"]["psi"]["table"] == "/compass"


def test_moos_variables_form_sensors_and_inputs():
    sent = {"DESIRED_RUDDER": "rudder", "DESIRED_ELEVATOR": "elevator"}
    measured = {"DVL_VX": "u", "DVL_VY": "v", "DVL_VZ": "w", "PITCH": "theta", "HEADING": "psi"}
    log = Topics({name: {"value": TRUTH[signal]} for name, signal in (sent | measured).items()})
    found = safe_load(suggest([log], Path()))
    places = {name: found["sensors"][name] | found["sensors"][name]["columns"] for name in ("dvl", "attitude")}
    assert (places["dvl"]["table"], places["dvl"]["v"]["table"], places["dvl"]["w"]["table"]) == (*measured,)[:3]
    assert {places["attitude"]["table"], places["attitude"]["psi"]["table"]} == {"PITCH", "HEADING"}
    assert (found["inputs"]["table"], found["inputs"]["elevator"]["table"]) == (*sent,)


def test_imc_messages_and_servo_ids_are_found():
    axes = dict(zip("xyz", ("p", "q", "r"), strict=True))
    log = Topics(
        {
            "EulerAngles": {name: TRUTH[name] for name in ("phi", "theta", "psi")},
            "AngularVelocity": {axis: TRUTH[name] for axis, name in axes.items()},
            "GroundVelocity": {axis: TRUTH[name] for axis, name in zip("xyz", "uvw", strict=True)}
            | {"validity": np.where(TIME < 100.0, 7.0, 0.0)},
            "EstimatedState": {name: TRUTH[name] for name in "uvw"},
            "SetServoPosition": {"id": np.arange(TIME.size) % 2.0, "value": TRUTH["rudder"]},
        }
    )
    text = suggest([log], Path())
    found = safe_load(text)["sensors"]
    assert (found["gyroscope"]["table"], found["dvl"]["table"]) == ("AngularVelocity", "GroundVelocity")
    assert found["dvl"]["valid"] == {"column": "validity", "values": [7]}
    assert "possible fins: {table: SetServoPosition, column: value, rows: {column: id, values: [0]}}" in text


def test_file_name_marks_servos_of_text_log():
    log = Columns({"id": np.arange(TIME.size) % 2.0, "value": TRUTH["rudder"]})
    log.path = Path("SetServoPosition.csv")
    text = suggest([log, Columns({name: TRUTH[name] for name in ("u", "psi")})], Path())
    assert "possible fins: {log: SetServoPosition, column: value, rows: {column: id, values: [0]}}" in text


@pytest.mark.slow
def test_column_that_repeats_measured_angle_is_no_fin():
    """A controller's input is the measured angle; the fins have their own columns."""
    columns = {name: values for name, values in TRUTH.items() if name not in ("rudder", "elevator")}
    columns |= {"yaw_input": TRUTH["psi"], "pitch_input": TRUTH["theta"]}
    fins = {"fin_top": TRUTH["rudder"], "fin_bottom": TRUTH["rudder"]}
    fins |= {"fin_right": TRUTH["elevator"], "fin_left": TRUTH["elevator"]}
    _, found = suggested(columns | fins)
    assert [*found["inputs"]["fins"]] == ["top", "bottom", "right", "left"]
    assert not {"rudder", "elevator"} & {*found["inputs"]}


@pytest.mark.slow
def test_raw_column_is_preferred_to_filtered_one():
    _, found = suggested(TRUTH | {"down": TRUTH["u"], "depth_filt": TRUTH["down"], "depth_raw_m": TRUTH["down"]})
    assert "filt" not in str(found["sensors"]["depth"]["columns"])


@pytest.mark.slow
def test_flag_called_good_marks_valid_rows():
    _, found = suggested(TRUTH | {"dvl_good": np.ones(TIME.size)})
    assert found["sensors"]["dvl"]["valid"]["column"] == "dvl_good"
