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
    stated = checks[DELAY].advice.split("identification.delays={inputs: ")[1].split(" s")[0]
    assert float(stated) == pytest.approx(-0.4, abs=0.03)
    checks, fails = verdicts(late(dataset, -0.4))
    assert fails == set()
    assert checks[DELAY].passed is None
    assert "vehicle.actuators.fins.time_constant" in checks[DELAY].advice


def test_the_lag_is_told_between_samples_and_does_not_matter_to_slow_fins(dataset):
    found = [float(verdicts(late(dataset, s))[0][DELAY].statistic.split(" s")[0].split()[-1]) for s in (0.0, 0.1, 0.35)]
    assert found == pytest.approx([0.0, 0.1, 0.35], abs=0.03)
    assert not Alignment(0.5, False, share=0.05).distorts
    assert Alignment(0.5, False, share=0.5).distorts


def test_a_turned_sign_is_found_behind_a_lag(dataset):
    _, fails = verdicts(late(with_columns(dataset, [0, 1, 2, 3], (-1.0, 1.0, 1.0, 1.0)), 1.0))
    assert fails == {DELAY, ("rudder", "response of r")}


@pytest.mark.parametrize("seconds", [0.0, 1.0])
def test_exchanged_fins_are_named(seconds, dataset):
    checks, fails = verdicts(late(with_columns(dataset, [1, 0, 2, 3]), seconds))
    assert fails == {EXCHANGED} | ({DELAY} if seconds else set())
    assert "r responds to elevator" in checks[EXCHANGED].statistic
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
    signals = Signals(Grid(0.0, step, cells), values, {"r": 0.1})
    by_state = np.zeros((8, 8))
    by_state[5, 5] = -1.0 / constant
    by_input = dict.fromkeys(("elevator", "roll_moment"), np.zeros(8)) | {"rudder": by_state[5]}
    alignment = input_alignment(signals, LinearMotion(by_state, by_input), constant)
    assert alignment.exchanged is False
    # The rate is that at the begin of a cell, which stands for its middle.
    assert alignment.delay == pytest.approx(lag - 0.5 * step, abs=0.01)
    # Of a vehicle file without coefficients as a body that nothing damps.
    assert input_alignment(signals, None, constant).delay == pytest.approx(lag, abs=0.2)


@pytest.mark.parametrize("without", [(), ("gyroscope",)], ids=["gyroscope", "attitude alone"])
def test_a_tenth_of_a_second_fails_where_fins_move_and_no_delay_passes(without, dataset):
    dataset = replace(dataset, sensors={name: r for name, r in dataset.sensors.items() if name not in without})
    checks, fails = verdicts(dataset)
    assert checks[DELAY].passed is True
    assert fails == set()
    assert verdicts(late(dataset, 0.12))[1] == {DELAY}


def test_a_vehicle_file_a_third_off_does_not_turn_its_own_lag_into_a_delay(sound_run, rng):
    dataset = sound_run()
    vehicle = dataset.experiment.vehicle
    for _ in range(3):
        factors = {symbol: rng.choice([0.7, 1.3]) for symbol in vehicle.all_coefficients()}
        off = vehicle.with_coefficients({s: factors[s] * value for s, value in vehicle.all_coefficients().items()})
        told = replace(dataset, experiment=dataset.experiment.model_copy(update={"vehicle": off}))
        assert verdicts(told)[0][DELAY].passed is True


def test_inputs_that_do_nothing_tell_no_lag(sound_run):
    dataset = sound_run()
    noise = 0.1 * np.random.default_rng(4).standard_normal(dataset.inputs.values.shape)
    checks, _ = verdicts(replace(dataset, inputs=replace(dataset.inputs, values=noise)))
    for key in (DELAY, EXCHANGED):
        assert checks[key].passed is None
        assert checks[key].statistic.startswith("undetermined")
