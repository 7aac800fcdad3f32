"""Inputs that are late or exchanged are found as such, and their signs are judged where they belong."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.inspection.delays import Alignment, input_alignment
from auvid_cli.inspection.fins import LinearMotion
from auvid_cli.inspection.inspect import inspect_dataset
from auvid_cli.inspection.kinematic_relations import Grid, Signals

DELAY, EXCHANGED = ("inputs", "delay"), ("inputs", "rudder and elevator")


@pytest.fixture(params=[("spiral", "ahrs"), ("zigzag_20_20", "direct")], ids="-".join)
def dataset(request, sound_run):
    return sound_run(*request.param)


def late(dataset, seconds):
    return replace(dataset, inputs=replace(dataset.inputs, time=dataset.inputs.time + seconds))


def with_columns(dataset, columns, factors=(1.0, 1.0, 1.0, 1.0)):
    return replace(dataset, inputs=replace(dataset.inputs, values=dataset.inputs.values[:, columns] * factors))


def verdicts(dataset):
    checks = inspect_dataset(dataset).checks
    return {(check.subject, check.check): check for check in checks}, {(c.subject, c.check) for c in checks.failed()}


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [1.0, -1.0, 2.5])
def test_delayed_inputs_fail_with_their_delay(seconds, dataset):
    checks, fails = verdicts(late(dataset, seconds))
    assert fails == {DELAY}
    size = float(checks[DELAY].statistic.split(" s")[0].split()[-1])
    assert size == pytest.approx(abs(seconds), abs=0.25)
    assert ("ahead" in checks[DELAY].statistic) == (seconds < 0.0)


@pytest.mark.slow
def test_short_input_delay_fails_if_fins_change_within_it(dataset):
    checks, fails = verdicts(late(dataset, 0.4))
    assert fails == {DELAY}
    stated = checks[DELAY].advice.split("identification.delays={inputs: ")[1].split(" s")[0]
    assert float(stated) == pytest.approx(-0.4, abs=0.03)
    checks, fails = verdicts(late(dataset, -0.4))
    assert fails == set()
    assert checks[DELAY].passed is None
    assert "vehicle.actuators.fins.time_constant" in checks[DELAY].advice


@pytest.mark.slow
def test_input_delay_is_found_between_samples(dataset):
    found = [float(verdicts(late(dataset, s))[0][DELAY].statistic.split(" s")[0].split()[-1]) for s in (0.0, 0.1, 0.35)]
    assert found == pytest.approx([0.0, 0.1, 0.35], abs=0.03)
    assert not Alignment(0.5, False, share=0.05).distorts
    assert Alignment(0.5, False, share=0.5).distorts


@pytest.mark.slow
def test_wrong_sign_is_found_with_delayed_inputs(dataset):
    _, fails = verdicts(late(with_columns(dataset, [0, 1, 2, 3], (-1.0, 1.0, 1.0, 1.0)), 1.0))
    assert fails == {DELAY, ("rudder", "response of r")}


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.0, 1.0])
def test_exchanged_fins_fail(seconds, dataset):
    checks, fails = verdicts(late(with_columns(dataset, [1, 0, 2, 3]), seconds))
    assert fails == {EXCHANGED} | ({DELAY} if seconds else set())
    assert "r responds to elevator" in checks[EXCHANGED].statistic
    # The excitation is that of the columns by name.
    assert checks["rudder", "excitation"].statistic == verdicts(dataset)[0]["elevator", "excitation"].statistic


@pytest.mark.parametrize("lag", [-1.2, 0.0, 0.7])
@pytest.mark.parametrize("constant", [0.3, 1.0, 3.0])
def test_first_order_turn_shows_its_delay(constant, lag, rng):
    """Against the exact solution of ``T dr/dt = -r - delta`` for steps that hold for 0.1 s or longer."""
    cells, step = 3000, 0.1
    held = np.repeat(np.where(rng.random(cells // 10) < 0.5, -0.2, 0.2), 10)
    decay, rate = np.exp(-step / constant), np.zeros(cells)
    for k in range(cells - 1):
        rate[k + 1] = decay * rate[k] - (1.0 - decay) * held[k]
    rate += 1e-3 * rng.standard_normal(cells)
    still = np.zeros(cells)
    values = {"rudder": np.roll(held, round(lag / step)), "r": rate}
    values |= dict.fromkeys(("elevator", "surge_force", "roll_moment", "p", "q"), still)
    signals = Signals(Grid(0.0, step, cells), values, {"r": 0.1})
    by_state = np.zeros((8, 8))
    by_state[5, 5] = -1.0 / constant
    by_input = dict.fromkeys(("elevator", "roll_moment"), np.zeros(8)) | {"rudder": by_state[5]}
    alignment = input_alignment(signals, LinearMotion(by_state, by_input), constant)
    assert alignment.exchanged is False
    # The rate at the begin of a cell is used for its middle.
    assert alignment.delay == pytest.approx(lag - 0.5 * step, abs=0.01)
    # A vehicle file without coefficients is treated as a body without damping.
    assert input_alignment(signals, None, constant).delay == pytest.approx(lag, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("without", [(), ("gyroscope",)], ids=["gyroscope", "attitude alone"])
def test_input_delay_of_0_1_s_fails_and_none_passes(without, dataset):
    dataset = replace(dataset, sensors={name: r for name, r in dataset.sensors.items() if name not in without})
    checks, fails = verdicts(dataset)
    assert checks[DELAY].passed is True
    assert fails == set()
    assert verdicts(late(dataset, 0.12))[1] == {DELAY}


@pytest.mark.slow
def test_wrong_coefficients_are_no_input_delay(sound_run, rng):
    dataset = sound_run()
    vehicle = dataset.experiment.vehicle
    for _ in range(3):
        factors = {symbol: rng.choice([0.7, 1.3]) for symbol in vehicle.all_coefficients()}
        off = vehicle.with_coefficients({s: factors[s] * value for s, value in vehicle.all_coefficients().items()})
        told = replace(dataset, experiment=dataset.experiment.model_copy(update={"vehicle": off}))
        assert verdicts(told)[0][DELAY].passed is True


def test_inputs_without_effect_leave_delay_undetermined(sound_run):
    dataset = sound_run()
    noise = 0.1 * np.random.default_rng(4).standard_normal(dataset.inputs.values.shape)
    checks, _ = verdicts(replace(dataset, inputs=replace(dataset.inputs, values=noise)))
    for key in (DELAY, EXCHANGED):
        assert checks[key].passed is None
        assert checks[key].statistic.startswith("undetermined")
