"""Models on data that they have not seen: `validate`, and its two steps, of which the first takes no time."""

from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.validation.data_leakage import unseen_data
from auvid_cli.validation.results import Validation
from auvid_cli.validation.validate import validate as predict

__all__ = ["predict", "unseen_data", "validate"]


def validate(dataset: Dataset, estimate: Estimate, training: Dataset | None = None) -> Validation:
    """Say how well an identified model predicts data that it has not seen, and whether its uncertainty is honest.

    Parameters
    ----------
    dataset : Dataset
        Of another run than the estimate was made from.
    estimate : Estimate
    training : Dataset, optional
        That the estimate was made from: a copy of it, or of a part, is then refused as well. Data that were in no file
        are recognised in no other way. And by how much predictions of them are worse than stated is part of the bands.

    Returns
    -------
    Validation
        Predictions by signal and horizon beside the prior and an unchanged motion, numbers of manoeuvres, verdicts,
        which ``to_pandas()`` makes tables of; ``run`` is the free run, with ``to_xarray()``.

    Raises
    ------
    DataError
        If the estimate has seen the data or did not end well, or the data are too short or in several segments.

    Examples
    --------
    >>> validation = auvid.validate(other, estimate, training=dataset)
    >>> validation.run.to_xarray()["u"].attrs["units"]
    'm/s'
    """
    return predict(unseen_data(dataset, estimate, training), estimate, training)
