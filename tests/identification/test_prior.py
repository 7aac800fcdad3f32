"""Priors follow from the size of the vehicle alone, or from what its file states."""

import numpy as np
import pint
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.coefficients import Prior
from auvid_cli.config.enums import FilterName
from auvid_cli.config.vehicle import Size
from auvid_cli.errors import ConfigError, DataError
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.problem_setup import augmented_problem
from auvid_cli.identification.run import identify
from auvid_cli.identification.states import coefficient_priors, natural_magnitude
from auvid_cli.validation.initial_states import models_of
from auvid_cli.vehicle.coefficients import COEFFICIENTS, SYMBOLS

UNITS = pint.UnitRegistry()
SIZE = Size(length=2.0, diameter=0.25, density=1025.0)


@pytest.mark.parametrize("coefficient", COEFFICIENTS, ids=SYMBOLS)
def test_magnitude_scales_with_size_as_the_unit_of_the_coefficient_says(coefficient):
    """A hull k times as large has coefficients k^n times as large, n the power of length in the unit per density."""
    per_density = (UNITS.Quantity(1, coefficient.unit) / UNITS.Quantity(1, "kg/m^3")).to_base_units()
    power = dict(per_density.unit_items())["meter"]
    larger = Size(length=3.0 * 2.0, diameter=3.0 * 0.25, density=1025.0)
    ratio = natural_magnitude(coefficient, larger) / natural_magnitude(coefficient, SIZE)
    assert ratio == pytest.approx(3.0**power, rel=1e-12)


@pytest.mark.parametrize("coefficient", COEFFICIENTS, ids=SYMBOLS)
def test_magnitude_is_proportional_to_the_density(coefficient):
    lighter = Size(length=2.0, diameter=0.25, density=1.0)
    expected = natural_magnitude(coefficient, SIZE) / 1025.0
    assert natural_magnitude(coefficient, lighter) == pytest.approx(expected, rel=1e-12)


def test_drag_is_that_of_the_frontal_and_of_the_lateral_area():
    magnitudes = {c.symbol: natural_magnitude(c, SIZE) for c in COEFFICIENTS}
    assert magnitudes["X_u|u|"] == pytest.approx(0.5 * 1025.0 * 3.141592653589793 * 0.125**2)
    assert magnitudes["Y_v|v|"] == magnitudes["Z_w|w|"] == pytest.approx(0.5 * 1025.0 * 2.0 * 0.25)


def test_magnitude_holds_for_all_shipped_vehicles_within_two_orders(vehicle_file, experiment_with):
    vehicle = experiment_with(f"vehicle=vehicles/{vehicle_file}").vehicle
    true = vehicle.all_coefficients()
    wide = [c.symbol for c in COEFFICIENTS if abs(true[c.symbol]) > 100.0 * natural_magnitude(c, vehicle.size)]
    assert not wide


def test_factor_widens_every_prior_alike_and_a_stated_one_stands(experiment_with):
    vehicle = experiment_with().vehicle
    one = coefficient_priors(vehicle, Prior(factor=1.0))
    ten = coefficient_priors(vehicle, Prior(factor=10.0, standard_deviation={"Y_url": "5 kg/rad"}))
    assert tuple(one) == SYMBOLS
    assert {prior.mean for prior in (one | ten).values()} == {0.0}
    assert ten.pop("Y_url").standard_deviation == 5.0
    for symbol, prior in ten.items():
        assert prior.standard_deviation == pytest.approx(10.0 * one[symbol].standard_deviation)


STATED = (
    "vehicle.coefficients.X_u|u|={value: -8 kg/m, standard_deviation: 3 kg/m}",
    "vehicle.coefficients.Y_v|v|={value: -50 kg/m, standard_deviation: 4 kg/m}",
    "vehicle.coefficients.N_r|r|=0 kg*m^2/rad^2",
    "vehicle.coefficients.N_uudr=-10 kg/rad",
    "vehicle.coefficients.M_uude=null",
)


def test_prior_mean_and_deviation_follow_from_the_vehicle_file(experiment_with):
    vehicle = experiment_with(*STATED).vehicle
    natural = {c.symbol: natural_magnitude(c, vehicle.size) for c in COEFFICIENTS}

    def priors(**settings):
        return coefficient_priors(vehicle, Prior.model_validate({"mean": "vehicle", "factor": 2.0} | settings))

    plain = priors()
    assert plain["X_u|u|"] == (-8.0, 3.0)
    assert plain["N_uudr"] == (-10.0, 5.0)
    # A zero is sure to no share of itself, and of what is not stated only the size tells.
    assert plain["N_r|r|"] == (0.0, 2.0 * natural["N_r|r|"])
    assert plain["M_uude"] == (0.0, 2.0 * natural["M_uude"])
    # Order of precedence: deviation, share of a coefficient, share of its group, vehicle file.
    shared = priors(
        relative={"damping": "20 %", "Y_v|v|": 0.1, "N_uudr": "30 %"}, standard_deviation={"N_uudr": "1 kg/rad"}
    )
    assert shared["X_u|u|"] == pytest.approx((-8.0, 1.6))
    assert shared["Y_v|v|"] == pytest.approx((-50.0, 5.0))
    assert shared["N_uudr"] == (-10.0, 1.0)
    assert priors(relative="10 %")["X_u|u|"] == pytest.approx((-8.0, 0.8))
    assert coefficient_priors(vehicle, Prior(factor=2.0))["N_uudr"].mean == 0.0


@pytest.mark.parametrize(
    ("prior", "words"),
    [
        ("{relative: 50 %}", "needs mean: vehicle"),
        ("{mean: vehicle, relative: {drag: 50 %}}", "'drag' is not a coefficient or a group of them"),
        ("{mean: vehicle, relative: {N_uudr: 0}}", "greater than 0"),
        ("{mean: vehicle, relative: 2 kg}", "a share such as '50 %'"),
        ("{mean: file}", "'zero', 'vehicle' or 'geometry'"),
        ("drawing", "'zero', 'vehicle' or 'geometry'"),
    ],
)
def test_invalid_prior_is_refused(prior, words, experiment_with):
    with pytest.raises(ConfigError, match=words):
        experiment_with(f"identification.prior={prior}")


def test_prior_equal_to_the_truth_is_refused(short_run, with_settings):
    asking = with_settings(short_run, "identification.prior.mean=vehicle")
    with pytest.raises(DataError, match=r"prior\.mean=vehicle.*truth"):
        augmented_problem(prepare(asking))
    assert augmented_problem(prepare(asking.without_truth())).prior.mean.any()


GEOMETRY = "identification.prior=geometry"


def test_prior_mean_and_deviation_follow_from_the_geometry(experiment_with):
    vehicle = experiment_with(GEOMETRY).vehicle
    derived = {each.name: each for each in vehicle.derived_values()}

    def priors(**settings):
        return coefficient_priors(vehicle, Prior.model_validate({"mean": "geometry"} | settings))

    plain = priors()
    assert tuple(plain) == SYMBOLS
    assert all(prior == (derived[s].mean, derived[s].standard_deviation) for s, prior in plain.items())
    # Settings take precedence over the formulas.
    own = priors(relative={"control": "10 %"}, standard_deviation={"X_u|u|": "2 kg/m"})
    assert own["N_uudr"] == pytest.approx((derived["N_uudr"].mean, 0.1 * abs(derived["N_uudr"].mean)))
    assert own["X_u|u|"] == (derived["X_u|u|"].mean, 2.0)
    assert own["Y_v|v|"] == plain["Y_v|v|"]


def test_geometry_prior_without_geometry_is_refused(experiment_with):
    with pytest.raises(ConfigError, match="Virginia Tech DIVE") as error:
        experiment_with("vehicle=vehicles/dive.yaml", GEOMETRY)
    assert len([line for line in str(error.value).splitlines() if "geometry" in line]) == 1


def test_geometry_prior_of_its_own_simulation_is_refused(simulated_with, with_settings):
    vehicle = simulated_with("manoeuvre.duration=1 s").experiment.vehicle
    fin = next(each.mean for each in vehicle.derived_values() if each.name == "N_uudr")
    drawn = simulated_with("manoeuvre.duration=1 s", f"vehicle.coefficients.N_uudr={fin}")
    with pytest.raises(DataError, match=r"prior\.mean=geometry.*N_uudr"):
        augmented_problem(prepare(with_settings(drawn, GEOMETRY)))
    held = with_settings(drawn, GEOMETRY, "identification.coefficients=[X_u|u|, Y_uvl]")
    assert augmented_problem(prepare(held)).prior.mean.any()


def test_estimate_starts_at_the_stated_values(simulated_with, with_settings):
    """The file is 30 % off, and as wrong as it says."""
    run = simulated_with("manoeuvre.duration=60 s", "sensors.attitude={source: direct, rate: 100 Hz, noise: 0.1 deg}")
    truth = run.truth.coefficients
    guessed = [f"vehicle.coefficients.{symbol}={1.3 * truth[symbol]}" for symbol in SYMBOLS]
    asking = with_settings(run, *guessed, "identification.prior={mean: vehicle, relative: 30 %}")
    estimate = identify(asking, FilterName.CKF)
    first, last = estimate.mean[0, :22], estimate.mean[-1, :22]
    true = np.array([truth[symbol] for symbol in SYMBOLS])
    assert_allclose(first, 1.3 * true, rtol=1e-3)
    assert np.median(np.abs(last / true - 1.0)) < 0.05
    assert models_of(estimate).prior == pytest.approx({symbol: 1.3 * truth[symbol] for symbol in SYMBOLS})
