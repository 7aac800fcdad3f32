"""Columns are matched by their behaviour where names say nothing, or something else."""

import numpy as np
import pytest

from tests.logs.suggest.test_evidence import TIME, TRUTH, moving, suggested

REST = {name: TRUTH[name] for name in ("u", "v", "w", "p", "q", "r")}
FINS = {
    "fin_top": TRUTH["rudder"],
    "fin_bottom": TRUTH["rudder"],
    "fin_right": TRUTH["elevator"],
    "fin_left": TRUTH["elevator"],
}


@pytest.mark.slow
def test_inputs_of_a_controller_are_the_measured_angles():
    """Nothing else has the yaw and the pitch, and four fins stand beside them."""
    angles = {"yaw_input": TRUTH["psi"], "pitch_input": TRUTH["theta"], "chan7": TRUTH["phi"]}
    text, found = suggested(REST | angles | FINS | {"temperature": 10.0 + 0.01 * TIME})
    assert found["sensors"]["attitude"]["columns"] == {"phi": "chan7", "theta": "pitch_input", "psi": "yaw_input"}
    assert [*found["inputs"]["fins"]] == ["top", "bottom", "right", "left"]
    assert not {"rudder", "elevator"} & {*found["inputs"]}
    assert "by its behaviour, not by its name" in text


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "unit"), [(1.0, "rad"), (57.29578, "deg")])
def test_angle_without_a_name_gets_its_unit(factor, unit):
    angles = {"phi": TRUTH["phi"], "theta": TRUTH["theta"], "signal": TRUTH["psi"]}
    _, found = suggested(REST | {name: factor * values for name, values in angles.items()})
    assert found["sensors"]["attitude"]["columns"]["psi"] == "signal"
    assert found["sensors"]["attitude"]["unit"] == unit


def test_depth_without_a_name_is_found():
    _, found = suggested(REST | {name: TRUTH[name] for name in ("phi", "theta", "psi")} | {"chan3": TRUTH["down"]})
    assert found["sensors"]["depth"]["columns"] == {"down": "chan3"}


def test_fin_is_not_taken_for_an_angle():
    _, found = suggested(REST | {"rudder": TRUTH["rudder"], "elevator": TRUTH["elevator"]})
    assert "attitude" not in found["sensors"]
    assert {"rudder", "elevator"} <= {*found["inputs"]}


def test_fin_that_a_rate_follows_is_not_that_rate():
    rate = {"psi": TRUTH["psi"], "u": TRUTH["u"], "theta": TRUTH["theta"], "phi": TRUTH["phi"]}
    _, found = suggested(rate | {"servo": -2.0 * TRUTH["r"]})
    assert "gyroscope" not in found["sensors"]


def test_pressure_is_not_taken_for_a_depth():
    motion = REST | {name: TRUTH[name] for name in ("phi", "theta", "psi")}
    _, found = suggested(motion | {"pressure_mbar": 1013.0 + 98.1 * TRUTH["down"]})
    assert "depth" not in found["sensors"]


@pytest.mark.slow
@pytest.mark.parametrize("rows", [3, 5, 10])
def test_delay_below_sampling_step_is_not_suggested(rows):
    """Rows that repeat a slower sensor's last value seem late by half its step."""
    held = {name: np.repeat(TRUTH[name][::rows], rows) for name in ("phi", "theta", "psi")}
    held = {name: values[: TIME.size] for name, values in held.items()}
    _, found = suggested(TRUTH | held)
    assert not any("offset" in sensor["time"] for sensor in found["sensors"].values())


@pytest.mark.slow
def test_delay_above_sampling_step_of_repeated_rows_is_suggested():
    later = {name: np.interp(TIME - 0.5, TIME, TRUTH[name]) for name in ("phi", "theta", "psi")}
    held = {name: np.repeat(values[::3], 3)[: TIME.size] for name, values in later.items()}
    _, found = suggested(TRUTH | held)
    assert float(found["sensors"]["attitude"]["time"]["offset"].split()[0]) == pytest.approx(-0.6, abs=0.05)


def smoothed(values, share=0.2):
    """A low-pass filter of first order."""
    copy = values.copy()
    for k in range(1, values.size):
        copy[k] = copy[k - 1] + share * (values[k] - copy[k - 1])
    return copy


@pytest.mark.slow
@pytest.mark.parametrize(("raw", "copy"), [("depth_sensor_1", "depth"), ("depth_filtered", "depth"), ("depth", "down")])
def test_unfiltered_column_is_taken_whatever_its_name(raw, copy):
    motion = REST | {name: TRUTH[name] for name in ("phi", "theta", "psi")}
    text, found = suggested(motion | {copy: smoothed(TRUTH["down"]), raw: TRUTH["down"]})
    assert found["sensors"]["depth"]["columns"] == {"down": raw}
    assert f"{copy} is a low-pass filtered copy of it" in text or f"{copy} (another depth)" in text


def test_noisier_second_sensor_is_not_taken():
    """Its noise is its own: nothing shows that the other sensor is filtered."""
    noise = 0.1 * np.random.default_rng(4).standard_normal(TIME.size)
    motion = REST | {name: TRUTH[name] for name in ("phi", "theta", "psi")}
    _, found = suggested(motion | {"depth": TRUTH["down"], "depth_sensor_2": TRUTH["down"] + noise})
    assert found["sensors"]["depth"]["columns"] == {"down": "depth"}


def test_pressure_in_decibar_is_not_the_unfiltered_depth():
    pressure = 1.0055 * TRUTH["down"]
    motion = REST | {name: TRUTH[name] for name in ("phi", "theta", "psi")}
    _, found = suggested(motion | {"depth": smoothed(TRUTH["down"]), "sensor_dbar": pressure})
    assert found["sensors"]["depth"]["columns"] == {"down": "depth"}


ANGLES = {name: TRUTH[name] for name in ("phi", "theta", "psi")}
DEPTH = {"depth": TRUTH["down"]}
OTHER = {"psi": moving(5)[0]["psi"], "down": moving(5)[0]["down"], "r": moving(5)[0]["r"]}


def test_column_that_contradicts_its_name_is_replaced_by_one_that_fits():
    text, found = suggested(REST | ANGLES | DEPTH | {"psi": OTHER["psi"], "channel_3": TRUTH["psi"]})
    assert found["sensors"]["attitude"]["columns"]["psi"] == "channel_3"
    assert "psi does not agree with r" in text.replace("\n", " ")


def test_depth_that_contradicts_pitch_is_replaced_by_one_that_fits():
    _, found = suggested(REST | ANGLES | {"depth": OTHER["down"], "channel_3": TRUTH["down"]})
    assert found["sensors"]["depth"]["columns"] == {"down": "channel_3"}


def test_rate_that_contradicts_its_angle_is_replaced_by_one_that_fits():
    _, found = suggested(REST | ANGLES | DEPTH | {"r": OTHER["r"], "channel_3": TRUTH["r"]})
    assert found["sensors"]["gyroscope"]["columns"]["r"] == "channel_3"


def test_contradiction_without_better_column_is_a_question():
    text, found = suggested(REST | ANGLES | DEPTH | {"psi": OTHER["psi"]})
    assert found["sensors"]["attitude"]["columns"]["psi"] is None
    assert found["sensors"]["gyroscope"]["columns"]["r"] is None
    assert "required: a column; psi does not agree with r" in text


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_right_names_are_not_contradicted(seed):
    log, _ = moving(seed)
    text, found = suggested(log)
    assert None not in [value for sensor in found["sensors"].values() for value in sensor["columns"].values()]
    assert "does not agree" not in text


def log_of_controller():
    """A log whose controller records measured angles, four numbered fins, and a raw and a smoothed depth."""
    angles = {"yaw_pid_input": np.degrees(TRUTH["psi"]), "pitch_pid_input": np.degrees(TRUTH["theta"])}
    outputs = {"yaw_pid_output": -0.4 * TRUTH["psi"], "pitch_pid_output": -0.4 * TRUTH["theta"]}
    fins = {f"fin_{number}": values for number, values in enumerate(FINS.values(), 1)}
    depth = {"z_smooth": smoothed(TRUTH["down"]), "z_raw": TRUTH["down"]}
    return REST | angles | outputs | fins | depth


@pytest.mark.slow
@pytest.mark.parametrize("depth", ["z_smooth", "depth"])
def test_log_of_controller_gives_angles_fins_and_raw_depth(depth):
    log = {depth if name == "z_smooth" else name: values for name, values in log_of_controller().items()}
    _, found = suggested(log)
    assert found["sensors"]["attitude"]["columns"] == {"theta": "pitch_pid_input", "psi": "yaw_pid_input"}
    assert found["sensors"]["attitude"]["unit"] == "deg"
    assert found["sensors"]["depth"]["columns"] == {"down": "z_raw"}
    assert {key: fin["column"] for key, fin in found["inputs"]["fins"].items()} == {
        "top": "fin_1",
        "bottom": "fin_2",
        "right": "fin_3",
        "left": "fin_4",
    }
    assert not {"rudder", "elevator"} & {*found["inputs"]}


def test_angles_of_controller_are_no_fins_without_gyroscope():
    log = {name: values for name, values in log_of_controller().items() if name not in "pqr"}
    log["yaw_input"], log["pitch_input"] = log.pop("yaw_pid_input"), log.pop("pitch_pid_input")
    _, found = suggested(log | {"depth": TRUTH["down"]})
    assert not {"rudder", "elevator"} & {key for key, value in found["inputs"].items() if value is not None}


@pytest.mark.slow
def test_flag_of_depth_is_its_valid_column():
    flag = (np.arange(TIME.size) % 50 != 0).astype(float)
    _, found = suggested(log_of_controller() | {"z_good": flag})
    assert found["sensors"]["depth"]["valid"] == {"column": "z_good", "values": [True, 1]}
