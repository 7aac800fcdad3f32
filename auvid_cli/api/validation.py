"""Models on data that they have not seen: `validate`, and its two steps, of which the first takes no time."""

from collections.abc import Sequence

from auvid_cli.api.argument_types import typed
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.validation.data_leakage import unseen_segments
from auvid_cli.validation.results import Validation
from auvid_cli.validation.validate import validate as predict

__all__ = ["predict", "unseen_segments", "validate"]


@typed
def validate(
    data: Dataset | Sequence[Dataset], estimate: Estimate, training: Dataset | None = None, *, anew: bool = False
) -> Validation:
    """Say how well an identified model predicts data that it has not seen, and whether its uncertainty is honest.

    Parameters
    ----------
    data : Dataset or sequence of Dataset
        Of other runs than the estimate was made from; several, and all segments that are used of each, are judged
        together.
    estimate : Estimate
    training : Dataset, optional
        That the estimate was made from: a copy of it, or of a part, is then refused as well. Data that were in no file
        are recognised in no other way. And by how much predictions of them are worse than stated is part of the bands.
    anew : bool
        Whether thrust, fin trims and ballast, as far as they are estimated, are found anew in each run, also where the
        estimate has them as constants: a trim of one day is seldom that of another.

    Returns
    -------
    Validation
        Predictions by signal and horizon beside the prior and an unchanged motion, numbers of manoeuvres, verdicts,
        which ``to_pandas()`` makes tables of; ``run`` is the free run of the longest segment, with ``to_xarray()``.

    Raises
    ------
    DataError
        If the estimate has seen the data or did not end well, or the data are too short.

    Examples
    --------
    >>> validation = auvid.validate(other, estimate, training=dataset)
    >>> validation.run.to_xarray()["u"].attrs["units"]
    'm/s'
    """
    datasets = [data] if isinstance(data, Dataset) else data
    unseen = [segment for dataset in datasets for segment in unseen_segments(dataset, estimate, training)]
    return predict(unseen, estimate, training, anew=anew)
