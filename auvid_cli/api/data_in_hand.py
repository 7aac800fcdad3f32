"""What earlier data say of coefficients, for the design of the next run."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import Experiment
from auvid_cli.data.dataset import Dataset
from auvid_cli.design.task import InHand
from auvid_cli.errors import DataError
from auvid_cli.evaluation.bounds import information_with_process_noise
from auvid_cli.evaluation.motion_along import probable_motion
from auvid_cli.identification.identify import with_noise_settled
from auvid_cli.identification.prepared_data import prepare

Array = NDArray[np.float64]


def information_in_hand(experiment: Experiment, named: Mapping[str, Dataset]) -> InHand | None:
    """Return what finds the Fisher information of datasets about an experiment's coefficients; None without any.

    With process noise, about the trajectory along the measurements, by the settings of each dataset. Errors that are
    estimated there beside the coefficients are known no better than by their priors, and count as that.

    Parameters
    ----------
    experiment : Experiment
        For which a run is designed.
    named : mapping
        Datasets, by the names of their files.
    """
    if not named:
        return None
    vehicle = experiment.vehicle
    symbols, wanted = vehicle.coefficient_set.symbols, experiment.identification.estimated(vehicle)

    def in_hand(values: Mapping[str, float]) -> Array:
        total = np.zeros((len(symbols), len(symbols)))
        for name, dataset in named.items():
            known, matrix = _information(name, dataset, values, wanted)
            places = [symbols.index(symbol) for symbol in known]
            total[np.ix_(places, places)] += matrix
        return total

    return in_hand


def _information(
    name: str, dataset: Dataset, values: Mapping[str, float], wanted: Sequence[str]
) -> tuple[list[str], Array]:
    """Return the coefficients that a dataset tells of, and the information about them, SI."""
    estimated = dataset.experiment.identification.estimated(dataset.experiment.vehicle)
    if odd := [symbol for symbol in estimated if symbol not in values]:
        raise DataError(f"--given {name}: estimates {odd[0]}, which the vehicle of this design does not have")
    if held := [symbol for symbol in wanted if symbol not in estimated]:
        raise DataError(
            f"--given {name}: holds {', '.join(held)}, so that what it says of the others presumes it; hold it here as "
            "well (--set identification.coefficients=...)"
        )
    about = probable_motion(with_noise_settled(prepare(dataset)), values)
    if about is None:
        raise DataError(
            f"--given {name}: no trajectory follows its measurements with the coefficients of this design; name an "
            "estimate from it (--at FILE)"
        )
    information = information_with_process_noise(about)
    inside = [place for place, symbol in enumerate(information.symbols) if symbol in estimated]
    beside = [place for place, symbol in enumerate(information.symbols) if symbol not in estimated]
    across = information.matrix[np.ix_(inside, beside)]
    errors = information.matrix[np.ix_(beside, beside)] + np.eye(len(beside))
    matrix = information.matrix[np.ix_(inside, inside)] - across @ np.linalg.solve(errors, across.T)
    unit = information.prior_std[inside]
    return [information.symbols[place] for place in inside], matrix / np.outer(unit, unit)
