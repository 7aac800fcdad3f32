"""A log without gyroscope and roll: every verdict says something, and none turns the vehicle into its mirror image."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.inspection.inspect import inspect_dataset

ZIGZAG = "{type: zigzag, duration: 120 s, speed: 1.5 m/s, rudder: 15 deg, heading: 40 deg, approach: 10 s%s}"
RUDDER, SLIP, AGREE = ("rudder", "response of r"), ("dvl", "v in a turn"), ("attitude", "r against psi")


@pytest.fixture(scope="module")
def zigzag(simulated_with):
    """A zigzag at 1.5 m/s with DVL, heading and pitch at 10 Hz, and an optional gyroscope."""
    made = {}

    def log(current="", gyroscope=False):
        if current not in made:
            made[current] = simulated_with("manoeuvre=" + ZIGZAG % current, "sensors.attitude.source=direct")
        sensors, attitude = made[current].sensors, made[current].sensors["attitude"]
        every = round(0.1 / np.median(np.diff(attitude.time)))
        few = replace(attitude, time=attitude.time[::every], values=attitude.values[::every].copy())
        few.values[:, 0] = np.nan
        kept = {"dvl": sensors["dvl"], "attitude": few} | ({"gyroscope": sensors["gyroscope"]} if gyroscope else {})
        return replace(made[current].without_truth(), sensors=kept)

    return log


def turned(dataset, *symbols):
    """The dataset with the signs of some of rudder, psi, r and v turned."""
    places = {"psi": ("attitude", 2), "v": ("dvl", 1), "r": ("gyroscope", 2)}
    for symbol in symbols:
        if symbol == "rudder":
            inputs = replace(dataset.inputs, values=dataset.inputs.values * [-1.0, 1.0, 1.0, 1.0])
            dataset = replace(dataset, inputs=inputs)
        else:
            name, column = places[symbol]
            values = dataset.sensors[name].values.copy()
            values[:, column] *= -1.0
            record = replace(dataset.sensors[name], values=values)
            dataset = replace(dataset, sensors=dataset.sensors | {name: record})
    return dataset


def verdicts(dataset):
    return {(check.subject, check.check): check for check in inspect_dataset(dataset).checks}


def failed(checks):
    return {key for key, check in checks.items() if check.passed is False}


def test_every_check_is_determined_or_says_undetermined(zigzag):
    checks = verdicts(zigzag())
    assert failed(checks) == set()
    assert checks[RUDDER].passed
    assert "attitude over 1 s" in checks[RUDDER].statistic
    for key in (SLIP, ("inputs", "delay"), ("inputs", "rudder and elevator"), ("dvl", "current")):
        assert checks[key].passed, key
    untold = {key for key, check in checks.items() if check.statistic.startswith("undetermined: ")}
    assert untold >= {AGREE, ("roll_moment", "response of p"), ("attitude", "excursions of psi")}


@pytest.mark.parametrize(
    ("symbols", "fails"),
    [(("rudder",), {RUDDER}), (("v",), {SLIP}), (("psi",), {RUDDER, SLIP}), (("psi", "rudder"), {SLIP})],
)
def test_wrong_sign_fails_without_advice_to_mirror_the_vehicle(symbols, fails, zigzag):
    checks = verdicts(turned(zigzag(), *symbols))
    assert failed(checks) == fails
    for key in fails:
        assert "mirror image" in checks[key].advice
        assert ("Change the sign of psi (and r) (clockwise from above" in checks[key].advice) == (symbols == ("psi",))


def test_two_wrong_signs_get_conditional_advice(zigzag):
    """The data are those of the mirror image with a turned heading, so that no advice may be without a condition."""
    checks = verdicts(turned(zigzag(), "rudder", "v"))
    assert failed(checks) == {RUDDER, SLIP}
    for key in (RUDDER, SLIP):
        assert "If it does not, all other signs are wrong" in checks[key].advice


@pytest.mark.parametrize("symbols", [("psi",), ("r",), ("psi", "rudder"), ("r", "v")])
def test_dependent_checks_are_undetermined_while_r_and_psi_disagree(symbols, zigzag):
    checks = verdicts(turned(zigzag(gyroscope=True), *symbols))
    (disagreement,) = failed(checks)
    assert disagreement[1] == "r against psi"
    for key in (RUDDER, SLIP, ("dvl", "current"), ("inputs", "delay")):
        assert checks[key].passed is None
        assert checks[key].statistic.startswith("undetermined while r against psi fails")
    assert ("another sign is wrong" in checks[disagreement].advice) == (len(symbols) == 2)


@pytest.mark.parametrize("gyroscope", [False, True])
def test_current_is_noted_with_size_and_direction(gyroscope, zigzag):
    checks = verdicts(zigzag(", current_north: -0.05 m/s, current_east: 0.19 m/s", gyroscope))
    current = checks["dvl", "current"]
    size, towards = (float(current.statistic.split()[place]) for place in (0, -2))
    assert current.passed is None
    assert size == pytest.approx(np.hypot(0.05, 0.19), abs=0.03)
    assert towards == pytest.approx(np.rad2deg(np.arctan2(0.19, -0.05)), abs=8.0)
    assert checks[SLIP].passed is None
    assert checks["dvl", "heading offset"].passed is not False
    assert failed(checks) == set()


def test_dvl_near_the_nose_is_a_note(zigzag):
    """The hull pivots 0.35 of its length ahead of the middle, and is 2.194 m long."""
    dataset = zigzag(gyroscope=True)
    rate, dvl = dataset.sensors["gyroscope"], dataset.sensors["dvl"]
    values = dvl.values.copy()
    values[:, 1] += 1.1 * np.interp(dvl.time, rate.time, rate.values[:, 2])
    check = verdicts(replace(dataset, sensors=dataset.sensors | {"dvl": replace(dvl, values=values)}))[SLIP]
    assert check.passed is None
    assert "dvl_arm" in check.advice


RATES = "manoeuvre.input_rate=100 Hz", "sensors.gyroscope.rate=100 Hz"


@pytest.mark.slow
def test_speed_lost_in_turns_leaves_heading_offset_undetermined(simulated_with):
    """Turns of a vehicle with a trimmed rudder slip more to one side, and slow it down on both."""
    survey = (
        "{type: lawnmower, duration: 240 s, speed: 1.5 m/s, leg: 20 s, turn_rate: 6 deg/s, autopilot: {speed: false}"
    )
    attitude = "sensors.attitude={source: direct, rate: 100 Hz}"
    dataset = simulated_with(f"manoeuvre={survey}, fin_trim: {{rudder: 1.3 deg}}}}", attitude, *RATES)
    checks = verdicts(dataset.without_truth())
    assert checks["dvl", "heading offset"].statistic == "undetermined: too little excitation"
