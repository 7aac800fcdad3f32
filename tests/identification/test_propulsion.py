"""Terms of revolutions and voltage: simulated, found by every estimator, refused where nothing tells these."""

import h5py
import numpy as np
import pytest

from auvid_cli.config.enums import FilterName
from auvid_cli.data.dataset_file import holds_data, read_dataset, write_dataset
from auvid_cli.errors import ConfigError, DataError
from auvid_cli.evaluation.identifiability import assess_dataset
from auvid_cli.identification.run import identify
from auvid_cli.identification.states import natural_magnitude
from auvid_cli.simulation.simulate import simulate
from auvid_cli.vehicle.coefficients import Coefficient, unit_of

TRUE = {"X_n|n|": 0.35, "X_|n|u": -0.9}
TERMS = (
    'vehicle.terms=[{name: X_n|n|, row: X, factors: [n, "|n|"], value: 0.35 kg*m}, '
    '{name: X_|n|u, row: X, factors: ["|n|", u], value: -0.9 kg}]'
)
OFF = "manoeuvre.autopilot.speed=false"
TURNS = (
    "manoeuvre.propeller={revolutions: 20 turn/s, voltage: 25 V, final_voltage: 22 V, "
    "excitation: {amplitude: 5 turn/s, lowest: 0.02 Hz, highest: 0.2 Hz, lines: 5}}"
)


@pytest.fixture(scope="module")
def run(simulated_with):
    """The shipped spiral from its slow start, driven by revolutions alone."""
    return simulated_with(TERMS, TURNS, OFF, "manoeuvre.duration=40 s")


def test_propulsion_inputs_are_simulated_and_recorded(run):
    turns, voltage = run.inputs.values[:, 4:].T
    assert (turns[0], voltage[0], voltage[-1]) == (0.0, 25.0, 22.0)
    assert 15.0 < turns[run.inputs.time > 30.0].min() < turns.max() <= 25.0
    # No thrust balances the drag twice.
    assert np.abs(run.inputs.values[:, 2]).max() <= 40.0
    assert run.truth.motion[-1, 0] > 2.0


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in FilterName if name != FilterName.UKF])
def test_propulsion_terms_are_estimated_from_natural_priors(run, name):
    estimate = identify(run, name)
    assert estimate.completed
    found, deviation = estimate.final_coefficients(), estimate.data_deviations()
    for symbol, true in TRUE.items():
        assert abs(found[symbol] - true) < 4.0 * deviation[symbol] < 0.1 * abs(true)


def test_natural_magnitudes_are_of_a_propeller_as_wide_as_the_hull(run):
    """At its advance of one its thrust is the drag of the frontal area."""
    size = run.experiment.vehicle.size
    for factors, power in ((("n", "|n|"), 4), (("|n|", "u"), 3)):
        term = Coefficient("X_t", unit_of(0, factors), "", 0, factors, "term")
        expected = 0.5 * size.density * 0.25 * np.pi * size.diameter**power
        assert natural_magnitude(term, size) == pytest.approx(expected)


@pytest.mark.slow
def test_propulsion_dataset_is_read_back(run, tmp_path):
    path = tmp_path / "dataset.h5"
    write_dataset(path, run)
    assert holds_data(path, run)
    assert np.array_equal(read_dataset(path).inputs.values, run.inputs.values)
    with h5py.File(path, "r+") as file:
        del file["inputs/revolutions"], file["inputs/voltage"]
        file.attrs["schema_version"] = 1
    before = read_dataset(path)
    assert np.array_equal(before.inputs.values, run.inputs.values[:, :4])
    with pytest.raises(DataError, match=r"revolutions.*X_n\|n\|, X_\|n\|u"):
        identify(before, FilterName.CKF)
    assert identify(read_dataset(path, ("vehicle.terms=[]",)), FilterName.CKF).time.size


def test_manoeuvre_without_propulsion_inputs_is_refused(experiment_with):
    refusal = r"no revolutions or voltage.*X_n\|n\|.*manoeuvre.propeller="
    with pytest.raises(ConfigError, match=refusal) as refused:
        experiment_with(TERMS)
    assert "manoeuvres/spiral_gentle.yaml" in str(refused.value)
    # A vehicle may be put in later.
    stated = experiment_with(TERMS, "manoeuvre.propeller={revolutions: 20 turn/s, voltage: 24 V}")
    with pytest.raises(ConfigError, match=refusal):
        simulate(experiment_with().model_copy(update={"vehicle": stated.vehicle}))


@pytest.mark.slow
def test_constant_revolutions_are_not_informative(simulated_with):
    """At one speed a constant n |n| is a constant force, as drag and a held thrust are."""
    chosen = "identification.coefficients=[X_u|u|, X_n|n|, X_|n|u]", "identification.estimate.biases=[thrust]"

    def bound(propeller):
        straight = (
            "manoeuvre={type: multisine, duration: 30 s, speed: 2.2 m/s, "
            f"excitation: {{surge_force: {{amplitude: 0.01 N}}}}, propeller: {{revolutions: 14 turn/s, {propeller}}}}}"
        )
        bounds = assess_dataset(simulated_with(TERMS, straight, *chosen)).bounds
        return next(bound.cramer_rao_bound for bound in bounds if bound.coefficient == "X_n|n|")

    assert bound("voltage: 24 V") > 10.0 * bound("excitation: {amplitude: 5 turn/s, lowest: 0.05 Hz, highest: 0.3 Hz}")
