"""Straight, level runs of the default vehicle, and hand-made truths."""

import numpy as np
import pytest

from auvid_cli.simulation.manoeuvres import make_plan
from auvid_cli.simulation.motion import LONGEST_STEP, Truth, simulate_motion
from auvid_cli.simulation.simulate import draw_disturbance, simulate
from auvid_cli.vehicle.equations import N_FACTORS, vehicle_constants


@pytest.fixture(scope="session")
def experiment_with(experiment_with):
    """Function: the shipped spiral experiment as `tests/conftest.py` has it, with the usual rates."""
    rates = "manoeuvre.input_rate=100 Hz", "sensors.gyroscope.rate=100 Hz", "sensors.attitude.rate=100 Hz"
    return lambda *overrides: experiment_with(*rates, *overrides)


@pytest.fixture(scope="session")
def simulated_with(experiment_with):
    """Function: a simulated run of this experiment; that of `tests/conftest.py` is made once, for other rooms too."""
    return lambda *overrides: simulate(experiment_with(*overrides))


@pytest.fixture(scope="session")
def fly(experiment_with):
    """Function: true motion of the default vehicle in a manoeuvre given as YAML, with more overrides."""

    def run(manoeuvre: str | None = None, *overrides: str, longest_step: float = LONGEST_STEP) -> Truth:
        whole = (f"manoeuvre={manoeuvre}", *overrides) if manoeuvre else overrides
        experiment = experiment_with(*whole)
        plan = make_plan(experiment.manoeuvre)
        disturbance = draw_disturbance(experiment.manoeuvre.disturbance, plan.time, experiment.seed)
        return simulate_motion(experiment.vehicle, experiment.manoeuvre, plan, disturbance, longest_step)

    return run


@pytest.fixture(scope="session")
def standing_still(experiment_with):
    """Function: a truth of the given length in which nothing moves, at a given roll, pitch and yaw."""
    vehicle = experiment_with().vehicle
    known = vehicle.known_parameters()
    # Weightless and without levers, so that it stays in any attitude.
    constants = vehicle_constants(known | {"W": 0.0, "B": 0.0})

    def make(duration: float, attitude=(0.0, 0.0, 0.0)) -> Truth:
        time = np.array([0.0, duration])
        motion = np.tile([0.0] * 6 + [*attitude], (2, 1))

        def still(*widths: int):
            return [np.zeros((2, width)) for width in widths]

        return Truth(time, *still(4, 4), motion, *still(3, 6), constants, np.zeros(N_FACTORS))

    return make
