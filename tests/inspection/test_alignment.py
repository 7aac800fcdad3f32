"""Inputs that are late or exchanged are found as such, and their signs are judged where they belong."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.inspection.alignment import Alignment, input_alignment
from auvid_cli.inspection.grid import Grid, Signals
from auvid_cli.inspection.inspect import inspect_dataset

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


@pytest.mark.parametrize("seconds", [1.0, -1.0, 2.5])
def test_inputs_at_another_time_than_the_motion_are_caught_with_the_lag(seconds, dataset):
    checks, fails = verdicts(late(dataset, seconds))
    assert fails == {DELAY}
    size = float(checks[DELAY].statistic.split(" s")[0].split()[-1])
    assert size == pytest.approx(abs(seconds), abs=0.25)
    assert ("ahead" in checks[DELAY].statistic) == (seconds < 0.0)


def test_a_lag_of_some_tenths_fails_if_the_fins_change_much_in_it(dataset):
    checks, fails = verdicts(late(dataset, 0.4))
    assert fails == {DELAY}
    assert "identification.delays={inputs: -0.4" in checks[DELAY].advice
    checks, fails = verdicts(late(dataset, -0.4))
    assert fails == set()
    assert checks[DELAY].passed is None
    assert "fin_time_constant" in checks[DELAY].advice


def test_the_lag_is_told_between_samples_and_does_not_matter_to_slow_fins(dataset):
    found = [float(verdicts(late(dataset, s))[0][DELAY].statistic.split(" s")[0].split()[-1]) for s in (0.0, 0.1, 0.35)]
    assert found == pytest.approx([0.0, 0.1, 0.35], abs=0.08)
    assert not Alignment(0.5, False, share=0.05).spoils
    assert Alignment(0.5, False, share=0.5).spoils


def test_a_turned_sign_is_found_behind_a_lag(dataset):
    _, fails = verdicts(late(with_columns(dataset, [0, 1, 2, 3], (-1.0, 1.0, 1.0, 1.0)), 1.0))
    assert fails == {DELAY, ("rudder", "response of r")}


@pytest.mark.parametrize("seconds", [0.0, 1.0])
def test_exchanged_fins_are_named(seconds, dataset):
    checks, fails = verdicts(late(with_columns(dataset, [1, 0, 2, 3]), seconds))
    assert fails == {EXCHANGED} | ({DELAY} if seconds else set())
    assert "r answers elevator" in checks[EXCHANGED].statistic
    # What is said of how much they move is of the columns as they are called.
    assert checks["rudder", "excitation"].statistic == verdicts(dataset)[0]["elevator", "excitation"].statistic


@pytest.mark.parametrize("lag", [-1.2, 0.0, 0.7])
@pytest.mark.parametrize("constant", [0.3, 1.0, 3.0])
def test_a_first_order_turn_tells_its_lag(constant, lag, rng):
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
    alignment = input_alignment(Signals(Grid(0.0, step, cells), values, {"r": 0.1}), constant)
    assert alignment.exchanged is False
    assert alignment.delay == pytest.approx(lag, abs=0.11)


def test_inputs_that_do_nothing_tell_no_lag(sound_run):
    dataset = sound_run()
    noise = 0.1 * np.random.default_rng(4).standard_normal(dataset.inputs.values.shape)
    checks, _ = verdicts(replace(dataset, inputs=replace(dataset.inputs, values=noise)))
    for key in (DELAY, EXCHANGED):
        assert checks[key].passed is None
        assert checks[key].statistic.startswith("cannot tell")
