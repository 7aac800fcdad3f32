"""Total standard deviations: effects of known quantities against refits, and second moments in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.enums import FilterName
from auvid_cli.config.identification import Tolerances
from auvid_cli.config.vehicle import VehicleEntry
from auvid_cli.data.estimate_file import read_estimate, write_estimate
from auvid_cli.data.faults import Fault, FaultKind
from auvid_cli.evaluation.accuracy import contributors_text
from auvid_cli.filters.fault_scores import second_moments
from auvid_cli.filters.problem import FaultScores
from auvid_cli.identification.fault_effects import tolerance_of
from auvid_cli.identification.faults import FAULTS, held_coefficient
from auvid_cli.identification.run import identify
from auvid_cli.vehicle.coefficients import COEFFICIENTS


@pytest.fixture(scope="module")
def dataset(multisine_with):
    """With process noise that makes the refits nearly linear."""
    noise = "identification.process_noise={velocity: 1e-2 m/s^2/Hz^0.5, rate: 1e-2 rad/s^2/Hz^0.5}"
    return multisine_with(noise, "identification.prior.factor=1", "identification.integration_step=0.02 s")


@pytest.fixture(scope="module")
def estimate(dataset):
    return identify(dataset, FilterName.SMOOTHER)


def told(dataset, symbol, by):
    vehicle = dataset.experiment.vehicle
    entry = VehicleEntry(value=vehicle.known_parameters()[symbol] + by)
    changed = vehicle.model_copy(update={"parameters": vehicle.parameters.model_copy(update={symbol: entry})})
    return replace(dataset, experiment=dataset.experiment.model_copy(update={"vehicle": changed}))


def faster(dataset, by):
    record = dataset.sensors["dvl"]
    return replace(dataset, sensors=dataset.sensors | {"dvl": replace(record, values=(1.0 + by) * record.values)})


def pushed(dataset, by):
    values = dataset.inputs.values * [1.0, 1.0, 1.0 - by, 1.0]
    return replace(dataset, inputs=replace(dataset.inputs, values=values))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "change", "size"),
    [
        ("Iyy", lambda data, size: told(data, "Iyy", -size), 0.05),
        ("Y_vdot", lambda data, size: told(data, "Y_vdot", -size), 0.1),
        ("scale of the DVL", faster, 5e-4),
        ("scale of the thrust", pushed, 2e-3),
    ],
)
def test_effect_of_a_known_quantity_equals_a_refit(fault, change, size, dataset, estimate):
    """Its sign is that of what is true, less what is told."""
    considered, rows = estimate.considered, estimate.coefficient_rows
    k = considered.faults.index(Fault.parse(fault))
    refits = [identify(change(dataset, by), FilterName.SMOOTHER).mean[-1, rows] for by in (-size, size)]
    moved = (refits[0] - refits[1]) / 2.0
    expected = considered.effect[rows, k] * size
    deviation = estimate.standard_deviation[-1, rows]
    assert_allclose(moved / deviation, expected / deviation, atol=0.03 * np.abs(expected / deviation).max() + 0.02)


def test_second_moments_are_those_of_bayes(rng):
    """Against the posterior of a linear regression with a prior, in its textbook form."""
    signatures, tolerance = rng.standard_normal((50, 3)), np.array([0.5, 2.0, 0.0])
    data = rng.standard_normal(50)
    scores = FaultScores(("a", "b", "c"), signatures.T @ data, signatures.T @ signatures, np.zeros((1, 3)))
    own = signatures[:, :2]
    covariance = np.linalg.inv(np.diag(tolerance[:2] ** -2.0) + own.T @ own)
    mean = covariance @ own.T @ data
    expected = np.zeros((3, 3))
    expected[:2, :2] = covariance + np.outer(mean, mean)
    assert_allclose(second_moments(scores, tolerance), expected, atol=1e-12)


def test_autocorrelated_residuals_reduce_what_data_say_of_a_tolerance():
    scores = FaultScores(("a",), np.zeros(1), np.array([[100.0]]), np.zeros((1, 1)), np.array([3.0]))
    assert_allclose(second_moments(scores, np.array([1.0])), 1.0 / (1.0 + 100.0 / 9.0))


@pytest.mark.slow
def test_total_covariance_adds_errors_of_known_quantities(estimate, tmp_path):
    considered = estimate.considered
    n = len(considered.inflation)
    added = considered.effect @ considered.covariance @ considered.effect.T
    difference = (estimate.final_covariance() - estimate.data_covariance())[:n, :n]
    assert_allclose(difference, added, rtol=1e-6, atol=1e-12 * np.abs(added).max())
    data, total = estimate.data_deviations(), estimate.final_deviations()
    assert all(total[symbol] >= data[symbol] for symbol in data)
    first, second = estimate.contributors("M_uude")
    assert total["M_uude"] >= first.deviation >= second.deviation > 0.0
    for symbol in estimate.coefficient_set.symbols:
        named = contributors_text(estimate, symbol).split("; ")
        assert (named[0].startswith("noise")) == (data[symbol] > estimate.contributors(symbol)[0].deviation)
    write_estimate(tmp_path / "smoother.h5", estimate)
    back = read_estimate(tmp_path / "smoother.h5")
    assert back.considered.faults == considered.faults
    assert_allclose(back.final_covariance(), estimate.final_covariance())
    assert back.faults == estimate.faults


def test_tolerances_are_a_word_or_numbers():
    assert Tolerances.model_validate("usual") == Tolerances()
    assert not any(Tolerances.model_validate("none").model_dump().values())
    assert Tolerances.model_validate({"inertia": "3 %", "delay": "1 ms"}).model_dump() == {
        **Tolerances().model_dump(),
        "inertia": 0.03,
        "delay": 0.001,
    }
    with pytest.raises(ValueError, match="expected usual, none"):
        Tolerances.model_validate("some")


@pytest.mark.parametrize(
    ("fault", "settings", "expected"),
    [
        ("X_u", (), 0.1 * 20.0),
        ("N_r", ("identification.tolerances={linear_damping: 5 %}",), 0.05 * 140.0),
        ("thrust that falls with speed", (), 0.1 / 3.9),
        ("Iyy", ("vehicle.parameters.Iyy={value: 15 kg*m^2}",), 0.05 * 15.0),
        ("Iyy", ("vehicle.parameters.Iyy={value: 15 kg*m^2, standard_deviation: 2 kg*m^2}",), 2.0),
        ("zG", (), 1e-3),
        ("scale of the DVL", ("identification.tolerances=none",), 0.0),
        ("bias of theta", (), np.deg2rad(0.2)),
        ("bias of theta", ("sensors.attitude.source=direct",), 0.0),
        ("Y_|v|r", (), 0.0),
    ],
)
def test_tolerance_of_a_fault_is_stated_or_a_share_or_a_size(fault, settings, expected, experiment_with):
    (model,) = (model for model in FAULTS if str(model.fault) == fault)
    damping = {Fault(FaultKind.MISSING_TERM, "X_u"): 20.0, Fault(FaultKind.MISSING_TERM, "N_r"): 140.0}
    whole = damping | {Fault(FaultKind.THRUST_FADE): 1.0 / 3.9}
    assert_allclose(tolerance_of(model, experiment_with(*settings), whole), expected, rtol=1e-4)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (("vehicle.coefficients.M_uql={value: -20 kg*m/rad}",), 0.4 * 20.0),
        (("vehicle.coefficients.M_uql={value: -20 kg*m/rad, standard_deviation: 3 kg*m/rad}",), 3.0),
        (("identification.tolerances=none",), 0.0),
    ],
)
def test_tolerance_of_a_held_coefficient_is_stated_or_a_share(settings, expected, experiment_with):
    (coefficient,) = (each for each in COEFFICIENTS if each.symbol == "M_uql")
    assert_allclose(tolerance_of(held_coefficient(coefficient), experiment_with(*settings), {}), expected)
