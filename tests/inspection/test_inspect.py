"""Sound data pass; every fault is caught by the verdict meant for it, and by no other."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.config.experiment import ImportedRun, Recording
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.inspection.inspect import inspect_dataset
from auvid_cli.simulation.simulate import simulate
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

PLACES = {
    **dict(zip("pqr", [("gyroscope", i) for i in range(3)], strict=True)),
    **dict(zip("uvw", [("dvl", i) for i in range(3)], strict=True)),
    **dict(zip(("phi", "theta", "psi"), [("attitude", i) for i in range(3)], strict=True)),
    "heading": ("magnetometer", 0),
}


def verdicts(dataset):
    """All, and those that failed as (subject, check)."""
    inspection = inspect_dataset(dataset)
    return inspection, {(check.subject, check.check) for check in inspection.checks.failed()}


def advice_of(inspection, subject, check):
    (verdict,) = [c for c in inspection.checks if (c.subject, c.check) == (subject, check)]
    return verdict


def scaled(changed, dataset, symbol, factor):
    """The dataset with a component or an input times a factor."""
    if symbol in INPUT_SYMBOLS:
        values = dataset.inputs.values.copy()
        values[:, INPUT_SYMBOLS.index(symbol)] *= factor
        return replace(dataset, inputs=replace(dataset.inputs, values=values))
    name, component = PLACES[symbol]

    def scale(time, values):
        values[:, component] *= factor

    return changed(dataset, name, scale)


def test_import_remarks_are_repeated(sound_run):
    dataset = sound_run("spiral", "direct", 1)
    settings = dataset.experiment
    remark = "@log_time drifts from @header_stamp by 276 s"
    recording = Recording(files=(), map="by this test", origin=0.0, remarks={"dvl": (remark,)})
    run = ImportedRun(name="log", vehicle=settings.vehicle, recording=recording)
    inspection, _ = verdicts(replace(dataset, experiment=run))
    verdict = advice_of(inspection, "dvl", "import")
    assert verdict.passed is None
    assert verdict.advice == f"At import: {remark}."


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("source", ["ahrs", "direct"])
@pytest.mark.parametrize("manoeuvre", ["spiral", "zigzag_20_20"])
def test_nothing_fails_on_sound_data(manoeuvre, source, seed, sound_run):
    inspection, fails = verdicts(sound_run(manoeuvre, source, seed))
    assert fails == set()
    assert inspection.marks == []
    assert all(check.advice == "" for check in inspection.checks if check.passed)
    passed = {check.check for check in inspection.checks if check.passed}
    assert passed >= {"pitch offset", "delay", "rudder and elevator", "lever arm"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["remus100", "lauv", "lrauv", "dive"])
def test_nothing_fails_on_other_vehicles(name):
    _, fails = verdicts(simulate(load_experiment(find_experiment(name), ("seed=4",))))
    assert fails == set()


TURNED = {
    "p": {("gyroscope", "p against phi")},
    "q": {("gyroscope", "q against theta")},
    "r": {("gyroscope", "r against psi"), ("gyroscope", "r against heading")},
    "psi": {("attitude", "r against psi")},
    "heading": {("magnetometer", "r against heading")},
    "u": {("dvl", "speed")},
    "v": {("dvl", "v against accelerometer")},
    "w": {("dvl", "w against accelerometer")},
    "rudder": {("rudder", "response of r")},
    "elevator": {("elevator", "response of q")},
    "surge_force": {("surge_force", "response of u")},
    "roll_moment": {("roll_moment", "response of p")},
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("symbol", "source"),
    # The source of the attitude matters only for what is compared with it.
    [*((symbol, "direct") for symbol in TURNED), *((symbol, "ahrs") for symbol in ("p", "q", "r", "psi"))],
)
def test_wrong_sign_fails_one_check(symbol, source, sound_run, changed):
    _, fails = verdicts(scaled(changed, sound_run("spiral", source), symbol, -1.0))
    assert fails == TURNED[symbol]


@pytest.mark.slow
@pytest.mark.parametrize("symbol", ["r", "psi", "rudder", "v"])
def test_zigzag_determines_signs_of_horizontal_plane(symbol, sound_run, changed):
    _, fails = verdicts(scaled(changed, sound_run("zigzag_20_20"), symbol, -1.0))
    assert fails == TURNED[symbol]


@pytest.mark.slow
@pytest.mark.parametrize(("symbol", "other"), [("p", "phi"), ("q", "theta"), ("r", "psi")])
def test_degrees_as_radians_are_named(symbol, other, sound_run, changed):
    inspection, fails = verdicts(scaled(changed, sound_run(), symbol, 180.0 / np.pi))
    assert (("gyroscope", f"{symbol} against {other}")) in fails
    related = {("gyroscope", f"{symbol} against {angle}") for angle in (other, "heading")}
    assert fails <= related | {("gyroscope", "range")}
    assert f"{symbol} is in deg/s" in advice_of(inspection, "gyroscope", f"{symbol} against {other}").advice


def test_exchanged_dvl_axes_fail(sound_run, changed):
    def exchange(time, values):
        values[:, [0, 1]] = values[:, [1, 0]]

    _, fails = verdicts(changed(sound_run(), "dvl", exchange))
    assert fails == {("dvl", "speed")}


def test_single_spike_fails_with_its_time(sound_run, changed):
    def spike(time, values):
        values[np.searchsorted(time, 100.0), 0] += 1.0

    inspection, fails = verdicts(changed(sound_run(), "dvl", spike))
    assert fails == {("dvl", "spikes")}
    assert "u" in advice_of(inspection, "dvl", "spikes").statistic
    (mark,) = inspection.marks
    assert (mark.sensor, mark.kind) == ("dvl", "spike")
    assert mark.start == pytest.approx(100.0, abs=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["gyroscope", "accelerometer", "magnetometer", "attitude"])
def test_spike_of_any_sensor_fails(sensor, sound_run, changed):
    def spike(time, values):
        values[np.searchsorted(time, 50.0), -1] += 1.0

    _, fails = verdicts(changed(sound_run(), sensor, spike))
    assert fails == {(sensor, "spikes")}


@pytest.mark.slow
@pytest.mark.parametrize("source", ["ahrs", "direct"])
def test_heading_excursions_fail_with_times(source, sound_run, changed):
    def jump(time, values):
        values[time % 4.0 >= 3.0, 2] += np.deg2rad(13.0)

    inspection, fails = verdicts(changed(sound_run("long_spiral", source), "attitude", jump))
    assert fails == {("attitude", "steps of psi")}
    statistic = advice_of(inspection, "attitude", "steps of psi").statistic
    assert statistic.startswith("75 times away by 13 deg and back after 1 s: t = 2.99, 6.99, 10.99")


@pytest.mark.slow
def test_clock_jump_differs_from_gap(sound_run, changed):
    def leap(time, values):
        time[time > 60.0] += 2.0

    def silence(time, values):
        values[(time > 60.0) & (time < 62.0)] = np.nan

    for sensor in ("gyroscope", "dvl", "attitude"):
        inspection, fails = verdicts(changed(sound_run(), sensor, leap))
        # It also goes on for two seconds after the last input, which estimators refuse.
        assert fails == {(sensor, "clock"), ("inputs", "end")}
        assert (
            "2.0" in advice_of(inspection, sensor, "clock").statistic
            or "2.1" in advice_of(inspection, sensor, "clock").statistic
        )
        inspection, fails = verdicts(changed(sound_run(), sensor, silence))
        assert fails == set()
        assert advice_of(inspection, sensor, "gap").passed is None
        assert {mark.kind for mark in inspection.marks} == {"gap"}


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["gyroscope", "dvl", "attitude", "magnetometer"])
def test_three_stuck_seconds_fail(sensor, sound_run, changed):
    def stick(time, values):
        values[(time >= 60.0) & (time <= 63.0)] = values[np.searchsorted(time, 60.0)]

    _, fails = verdicts(changed(sound_run(), sensor, stick))
    assert fails == {(sensor, "stuck")}


def test_pitch_offset_by_accelerometer_fails_with_its_size(sound_run, changed):
    def lift(time, values):
        values[:, 1] += np.deg2rad(12.0)

    inspection, fails = verdicts(changed(sound_run(), "attitude", lift))
    assert fails == {("attitude", "pitch offset")}
    assert "+12 deg" in advice_of(inspection, "attitude", "pitch offset").statistic


@pytest.mark.slow
def test_slow_sensor_is_not_fast_enough(sound_run):
    dataset = sound_run("long_spiral")
    record = dataset.sensors["dvl"]
    slow = replace(record, time=record.time[::7], values=record.values[::7])
    inspection, fails = verdicts(replace(dataset, sensors=dataset.sensors | {"dvl": slow}))
    assert fails == {("dvl", "fast enough")}
    # 2.194 m at 3.9 m/s, and one measurement a second.
    assert advice_of(inspection, "dvl", "fast enough").statistic.startswith("0.57")
