"""Models made by hand, and one state at a time out of the compiled core."""

import numpy as np
import pytest

from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.config.vehicle import ActuatorSettings
from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.export.model import (
    Actuation,
    IdentifiedCoefficient,
    IdentifiedModel,
    Origin,
    surface_changes,
    term_histories,
    term_sizes,
)
from auvid_cli.numerics import LANES
from auvid_cli.vehicle.equations import N_SLOPE, motion_derivative, vehicle_constants, with_errors
from auvid_cli.vehicle.parameters import N_MOTION

SOUND = Judgement(Grade.SOUND)
AS_STATED = Actuation(1.0, 0.0, ActuatorSettings(), {})
# Centres off every axis and weight other than buoyancy, so that no lever vanishes.
# Some that every form holds, one that changes its sign where axes are turned, and two that Gazebo has no place for.
TERMS = (
    '{name: N_|v|r, row: N, factors: ["|v|", r], value: -120}',
    "{name: K_up, row: K, factors: [u, p], value: -3}",
    "{name: Y_v, row: Y, factors: [v], value: -20}",
    "{name: X_uw, row: X, factors: [u, w], value: 7}",
    "{name: X_udrdr, row: X, factors: [u, u, rudder, rudder], value: -11}",
    '{name: K_T, row: K, factors: ["|thrust|"], value: 0.01}',
)
SKEWED = {"xG": 0.02, "yG": -0.01, "zG": 0.03, "xB": -0.03, "yB": 0.02, "zB": -0.01, "B": 480.0}


def make_model(
    experiment, held=(), not_identified=(), judgement=SOUND, states=(), actuation=AS_STATED
) -> IdentifiedModel:
    """A vehicle with its own coefficients for estimates."""
    values, coefficients = experiment.vehicle.all_coefficients(), []
    for c in experiment.vehicle.coefficient_set:
        deviation = None if c.symbol in held else 1e-3 * (abs(values[c.symbol]) + 1.0)
        identified = None if c.symbol in held else c.symbol not in not_identified
        coefficients.append(IdentifiedCoefficient(c.symbol, c.unit, values[c.symbol], deviation, identified))
    estimated = [*(c for c in coefficients if c.standard_deviation is not None), *states]
    deviations = np.array([each.standard_deviation for each in estimated])
    rng = np.random.default_rng(1)
    of_vehicle = experiment.vehicle.coefficient_set
    motion, inputs = rng.standard_normal((50, 9)), rng.standard_normal((50, 4))
    inputs = np.hstack([inputs, rng.standard_normal((50, 2))])
    return IdentifiedModel(
        experiment=experiment,
        filter="tukf",
        judgement=judgement,
        coefficients=tuple(coefficients),
        states=tuple(states),
        actuation=actuation,
        covariance=0.9 * np.diag(deviations**2) + 0.1 * np.outer(deviations, deviations),
        term_sizes=tuple(term_sizes(of_vehicle, term_histories(of_vehicle, values, motion, inputs))),
        surface_changes=surface_changes(values, motion, inputs),
        origin=Origin("d" * 64, "e" * 64, "1.2.3", "2026-01-01T00:00:00+00:00"),
    )


@pytest.fixture(scope="session")
def model_with():
    """Function: the model of a shipped vehicle, with other settings as on the command line."""

    def make(*overrides, vehicle_file="vt690.yaml", **options) -> IdentifiedModel:
        experiment = load_experiment(find_experiment(None), (f"vehicle=vehicles/{vehicle_file}", *overrides))
        return make_model(experiment, **options)

    return make


@pytest.fixture(scope="session")
def skewed(model_with) -> IdentifiedModel:
    """The default vehicle with its weight and buoyancy off its axes, and terms of its own."""
    centres = (f"vehicle.parameters.{symbol}={value}" for symbol, value in SKEWED.items())
    return model_with(*centres, f"vehicle.terms=[{', '.join(TERMS)}]")


@pytest.fixture(scope="session")
def derivative_of():
    """Function: what the compiled core says of a model, or of its vehicle with other coefficients."""

    def derivative(model, motion, inputs, coefficients=None):
        values = [each.value for each in model.coefficients] if coefficients is None else coefficients
        vehicle = model.experiment.vehicle
        constants = vehicle_constants(vehicle.known_parameters(), vehicle.coefficient_set.terms)
        result, factors = np.zeros(N_SLOPE), with_errors(np.array([values], dtype=float))[0]
        blocks = (np.repeat(np.asarray(each, dtype=float), LANES) for each in (motion, factors))
        motion_derivative(*blocks, np.asarray(inputs, dtype=float), constants, 1, result)
        return result[: N_MOTION * LANES : LANES].copy()

    return derivative


@pytest.fixture(scope="session")
def draw():
    """Function: a random motion and inputs of ordinary size."""

    def draw(seed):
        rng = np.random.default_rng(seed)
        motion = np.concatenate([rng.uniform(-4, 4, 3), rng.uniform(-0.8, 0.8, 3), rng.uniform(-1.3, 1.3, 3)])
        return motion, np.concatenate([rng.uniform(-0.4, 0.4, 2), rng.uniform(-50.0, 50.0, 2)])

    return draw
