"""Terms of a vehicle's own in every estimator: found where they are, missed where they are not in the model."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.enums import FilterName
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.data.dataset_file import read_dataset, write_dataset
from auvid_cli.data.estimate_file import read_estimate, write_estimate
from auvid_cli.evaluation.free_run import free_run
from auvid_cli.evaluation.identifiability import assess_dataset
from auvid_cli.evaluation.judgement import Grade, judge_one
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify
from auvid_cli.identification.states import coefficient_priors, natural_magnitude
from auvid_cli.simulation.simulate import simulate
from auvid_cli.vehicle.coefficients import COEFFICIENTS, Coefficient, unit_of

CROSS_FLOW, ROLLING = "N_|v|r", "K_up"
TRUE = {CROSS_FLOW: -1500.0, ROLLING: -3.0}
TERMS = (
    f'vehicle.terms=[{{name: {CROSS_FLOW}, row: N, factors: ["|v|", r], value: {TRUE[CROSS_FLOW]}}}, '
    f"{{name: {ROLLING}, row: K, factors: [u, p], value: {TRUE[ROLLING]}}}]"
)


@pytest.fixture(scope="module")
def clean(simulated_with):
    """A vehicle with two terms, by sensors whose noise is white: a judgement then is one of the model."""
    return simulated_with(TERMS, "manoeuvre.duration=30 s", "sensors.attitude.source=direct")


@pytest.fixture(scope="module")
def found(clean):
    """Return the judgement of an estimate."""
    return identify(clean, FilterName.SMOOTHER)


def without_terms(dataset, *left):
    """The same data, and a model of the 22 and some of the terms."""
    kept = tuple(term for term in dataset.experiment.vehicle.terms if term.name in left)
    vehicle = dataset.experiment.vehicle.model_copy(update={"terms": kept})
    return replace(dataset, experiment=dataset.experiment.model_copy(update={"vehicle": vehicle}))


def value_and_deviation(estimate, symbol):
    return estimate.final_coefficients()[symbol], estimate.data_deviations()[symbol]


@pytest.mark.parametrize("name", [FilterName.EKF, FilterName.CKF, FilterName.OUTPUT_ERROR])
def test_own_terms_are_estimated_within_their_deviations(name, clean, found):
    estimate = identify(clean, name)
    assert estimate.completed
    for symbol, true in TRUE.items():
        value, deviation = value_and_deviation(estimate, symbol)
        assert abs(value - true) < 4.0 * deviation < 0.2 * abs(true)
        judged, _ = value_and_deviation(found, symbol)
        assert abs(value - judged) < 3.0 * deviation


@pytest.mark.slow
def test_missing_own_term_is_named(clean, found):
    assert judge_one(found, found).grade is Grade.SOUND
    for symbol, true in TRUE.items():
        value, deviation = value_and_deviation(found, symbol)
        assert abs(value - true) < 3.0 * deviation
    # A term of the model is not a fault.
    assert CROSS_FLOW not in {str(test.fault) for test in found.faults}
    lacking = identify(without_terms(clean, ROLLING), FilterName.SMOOTHER)
    judgement = judge_one(lacking, lacking)
    assert judgement.grade is Grade.INCONSISTENT
    worst = max(lacking.faults, key=lambda test: abs(test.z))
    assert (str(worst.fault), worst.unit) == (CROSS_FLOW, "kg*m/rad")
    assert worst.rank == 1


@pytest.mark.slow
def test_missing_roll_damping_biases_rolling_drag():
    """LRAUV with the terms that its source has beyond the 22."""
    settings = (
        "vehicle.terms=[{name: K_up, row: K, factors: [u, p], value: -5.707}, "
        "{name: X_vv, row: X, factors: [v, v], value: -50}, {name: X_ww, row: X, factors: [w, w], value: -50}]",
        *("manoeuvre.duration=60 s", "manoeuvre.input_rate=25 Hz"),
        *("sensors.attitude={source: direct, rate: 25 Hz}", "sensors.gyroscope.rate=25 Hz"),
    )
    dataset = simulate(load_experiment(find_experiment("lrauv"), settings))
    true = dataset.experiment.vehicle.all_coefficients()
    whole, lacking = (identify(each, FilterName.SMOOTHER) for each in (dataset, without_terms(dataset)))
    for symbol in ("K_p|p|", "K_up", "X_vv", "X_ww"):
        value, deviation = value_and_deviation(whole, symbol)
        assert abs(value - true[symbol]) < 3.0 * deviation
    value, _ = value_and_deviation(lacking, "K_p|p|")
    assert value < 100.0 * true["K_p|p|"]
    assert judge_one(whole, whole).grade is Grade.SOUND
    assert judge_one(lacking, lacking).grade is Grade.INCONSISTENT


def test_held_term_is_used(clean):
    known = clean.experiment.vehicle.terms[0].model_copy(update={"estimate": False})
    vehicle = clean.experiment.vehicle.model_copy(update={"terms": (known, clean.experiment.vehicle.terms[1])})
    held = replace(clean, experiment=clean.experiment.model_copy(update={"vehicle": vehicle}))
    estimate = identify(held, FilterName.CKF)
    assert estimate.held == {CROSS_FLOW: TRUE[CROSS_FLOW]}
    assert CROSS_FLOW not in estimate.state
    value, deviation = value_and_deviation(estimate, "N_v|v|")
    assert abs(value - clean.truth.coefficients["N_v|v|"]) < 4.0 * deviation


def test_the_bound_of_a_term_is_about_what_an_efficient_fit_says(clean, found):
    bounds = {row.coefficient: row.cramer_rao_bound for row in assess_dataset(clean).bounds}
    for symbol in TRUE:
        assert found.data_deviations()[symbol] == pytest.approx(bounds[symbol], rel=0.3)


def test_free_run_has_own_terms(clean, found):
    _, errors = free_run(prepare(clean), found)
    _, of_22 = free_run(prepare(without_terms(clean)), replace(found, **_with_22_alone(clean, found)))
    yaw_rate, without = (next(e.mean_absolute_error for e in rows if e.component == "r") for rows in (errors, of_22))
    assert 10.0 * yaw_rate < without


def _with_22_alone(clean, found):
    kept = [i for i, symbol in enumerate(found.state) if symbol not in TRUE]
    return {
        "experiment": without_terms(clean).experiment,
        "state": tuple(found.state[i] for i in kept),
        "unit": tuple(found.unit[i] for i in kept),
        "mean": found.mean[:, kept],
    }


@pytest.mark.slow
def test_files_keep_own_terms(clean, found, tmp_path):
    write_dataset(tmp_path / "dataset.h5", clean)
    data = read_dataset(tmp_path / "dataset.h5")
    assert data.truth.coefficients == clean.truth.coefficients
    assert data.experiment == clean.experiment
    write_estimate(tmp_path / "smoother.h5", found)
    estimate = read_estimate(tmp_path / "smoother.h5")
    assert estimate.state == found.state
    assert estimate.final_coefficients() == found.final_coefficients()
    # Another model may be asked of the same data, and the truth of what that lacks or has beyond is known as well.
    bare = read_dataset(tmp_path / "dataset.h5", ("vehicle.terms=[]",))
    assert bare.experiment.vehicle.coefficient_set == COEFFICIENTS
    assert bare.truth.coefficients == clean.truth.coefficients
    assert bare.truth.coefficients_of(["M_p"]) == {"M_p": 0.0}


def test_priors_are_of_natural_magnitude_or_what_the_term_states(experiment_with):
    guess = "{mean: -100 kg*m/rad, standard_deviation: 40 kg*m/rad}"
    experiment = experiment_with(TERMS, f"vehicle.terms.0.prior={guess}", "identification.prior.factor=2")
    priors = coefficient_priors(experiment.vehicle, experiment.identification.prior)
    assert priors[CROSS_FLOW] == (-100.0, 40.0)
    rolling = experiment.vehicle.coefficient_set[-1]
    assert priors[ROLLING] == (0.0, 2.0 * natural_magnitude(rolling, experiment.vehicle.size))


def test_natural_magnitudes_make_forces_of_one_size_at_one_speed(experiment_with):
    size, row = experiment_with().vehicle.size, 5
    speed = 0.5 * np.sqrt(9.80665 * size.length)
    turn = speed / (0.5 * size.length)

    def moment(*factors):
        signals = {"u": speed, "v": speed, "r": turn}
        term = Coefficient("N_t", unit_of(row, factors), "", row, factors, "term")
        return natural_magnitude(term, size) * np.prod([signals[factor.strip("|")] for factor in factors])

    quadratic = natural_magnitude(COEFFICIENTS[9], size) * speed**2
    assert COEFFICIENTS[9].symbol == "N_v|v|"
    for factors in (("v",), ("r",), ("|v|", "r"), ("|v|", "v", "v")):
        assert_allclose(moment(*factors), quadratic, rtol=2e-3)
