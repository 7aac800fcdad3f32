"""What data can tell at best."""

from collections.abc import Mapping

from auvid_cli.api.argument_types import typed
from auvid_cli.data.dataset import Dataset
from auvid_cli.evaluation.assessment import Identifiability
from auvid_cli.evaluation.identifiability import assess_dataset


@typed
def identifiability(dataset: Dataset, at: Mapping[str, float] | None = None) -> Identifiability:
    """Say what data can tell of each coefficient at best, before any filter runs.

    Parameters
    ----------
    dataset : Dataset
    at : mapping of float, optional
        Coefficients by symbol, SI, at which to look, such as ``estimate.final_coefficients()``. Default: the true ones
        of a simulation, else those of the vehicle.

    Returns
    -------
    Identifiability
        Cramér-Rao bounds with their classes, and groups that go together, which ``to_pandas()`` makes tables of; shares
        of the sensors, correlation, and bounds by duration, which ``to_xarray()`` labels.

    Raises
    ------
    DataError
        If a coefficient to be estimated has no value, or the model blows up with these values.

    Examples
    --------
    >>> bounds = auvid.identifiability(dataset).to_pandas()["identifiability"]
    >>> bounds.set_index("coefficient").loc["X_u|u|", "verdict"]
    'within 1 %'
    """
    return assess_dataset(dataset, at)
