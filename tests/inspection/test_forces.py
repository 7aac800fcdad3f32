from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.data.dataset import InputRecord
from auvid_cli.inspection.excitation import doubled_thrust_check
from auvid_cli.inspection.inspect import inspect_dataset
from auvid_cli.vehicle.coefficients import COEFFICIENTS, CoefficientSet, term
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS


@pytest.fixture
def judged(sound_run):
    """Return a function: checks of the size of an input that is multiplied by a factor."""

    def judge(symbol, factor):
        run = sound_run()
        factors = [factor if symbol == check else 1.0 for check in INPUT_SYMBOLS]
        inputs = replace(run.inputs, values=run.inputs.values * factors)
        checks = inspect_dataset(replace(run, inputs=inputs)).checks
        return {check.subject: check for check in checks if check.check in ("size", "deflection")}

    return judge


def test_simulated_forces_pass(judged):
    verdicts = judged("rudder", 1.0)
    assert set(verdicts) >= {"surge_force", "rudder", "elevator"}
    assert {verdict.passed for verdict in verdicts.values()} == {True}


def test_missing_thrust_fails_if_the_vehicle_keeps_its_speed(sound_run):
    run = sound_run()
    without = replace(run.inputs, values=run.inputs.values * [1.0, 1.0, 0.0, 1.0])
    for inputs, verdicts in ((run.inputs, []), (without, [False])):
        checks = inspect_dataset(replace(run, inputs=inputs)).checks
        assert [check.passed for check in checks if check.check == "thrust"] == verdicts


@pytest.mark.slow
@pytest.mark.parametrize(
    ("symbol", "factor", "passed"),
    [
        ("surge_force", 3600.0, False),  # rpm for turns per second
        ("surge_force", 60.0, None),
        ("surge_force", 3e-3, None),
        ("surge_force", 1e-5, False),
        ("rudder", np.rad2deg(1.0), False),
    ],
)
def test_input_in_wrong_unit_is_noted_or_fails(judged, symbol, factor, passed):
    verdict = judged(symbol, factor)[symbol]
    assert verdict.passed is passed
    assert "unit" in verdict.advice


@pytest.mark.slow
def test_excessive_roll_moment_is_noted(sound_run):
    run = sound_run()
    for size, passed in ((1.0, True), (1e3, None), (1e5, False)):
        values = run.inputs.values.copy()
        values[:, INPUT_SYMBOLS.index("roll_moment")] = size
        checks = inspect_dataset(replace(run, inputs=replace(run.inputs, values=values))).checks
        assert [check.passed for check in checks if (check.subject, check.check) == ("roll_moment", "size")] == [passed]


def test_thrust_from_revolutions_next_to_their_terms_is_noted():
    turns = np.linspace(0.0, 20.0, 50)
    values = np.column_stack([np.zeros((50, 2)), 0.3 * turns**2 + 1.0, np.zeros(50), turns, np.zeros(50)])
    inputs, of_vehicle = InputRecord(np.arange(50.0), values), CoefficientSet((*COEFFICIENTS, term(0, ("n", "|n|"))))
    (check,) = doubled_thrust_check(inputs, of_vehicle)
    assert check.passed is None
    assert "X_n|n|" in check.advice
    values[:, 2] = np.sin(turns)
    (check,) = doubled_thrust_check(inputs, of_vehicle)
    assert check.passed is True
    assert doubled_thrust_check(inputs, COEFFICIENTS) == []
