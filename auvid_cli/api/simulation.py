"""Simulation."""

from auvid_cli.api.argument_types import typed
from auvid_cli.config.experiment import Experiment
from auvid_cli.data.dataset import Dataset
from auvid_cli.simulation import simulate as simulation
from auvid_cli.simulation.field_log import field_log


@typed
def simulate(experiment: Experiment) -> Dataset:
    """Simulate the vehicle and the sensors of an experiment.

    Parameters
    ----------
    experiment : Experiment
        See `load_experiment`; the same seed gives the same data.

    Returns
    -------
    Dataset
        Inputs, sensors and truth, SI.

    Raises
    ------
    SimulationError
        If the vehicle leaves the model's validity.
    ConfigError
        If the vehicle's parameters are impossible or a recorded manoeuvre cannot be read.

    Examples
    --------
    >>> dataset = auvid.simulate(auvid.load_experiment("spiral", "manoeuvre.duration=10 s"))
    >>> dataset.sensors["dvl"].values.shape
    (71, 3)
    """
    return simulation.simulate(experiment)


def simulate_log(experiment: Experiment) -> dict[str, str]:
    """Simulate an experiment, and write it as files that a vehicle of somebody else would have logged, by name."""
    return field_log(simulation.simulate(experiment))
