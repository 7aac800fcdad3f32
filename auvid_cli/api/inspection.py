"""Verdicts on data."""

from auvid_cli.api.argument_types import typed
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.time_window import within
from auvid_cli.inspection.inspect import inspect_dataset
from auvid_cli.inspection.inspection import Inspection
from auvid_cli.inspection.unused_sensors import contradictions_of_unused

__all__ = ["contradictions_of_unused", "inspect"]


@typed
def inspect(dataset: Dataset, use: tuple[float, float] | None = None) -> Inspection:
    """Judge recorded data before anybody identifies from them: clocks, gaps, spikes, signs, units, excitation.

    Parameters
    ----------
    dataset : Dataset
        Its truth is not looked at.
    use : tuple of float, optional
        Begin and end, s, of the part to look at. Default: all.

    Returns
    -------
    Inspection
        Its ``checks`` are the verdicts; ``to_pandas()`` makes a table of them.

    Raises
    ------
    DataError
        If there are no data in that part.

    Examples
    --------
    >>> verdicts = auvid.inspect(dataset).to_pandas()
    >>> list(verdicts.columns)
    ['subject', 'check', 'statistic', 'threshold', 'passed', 'advice']
    """
    return inspect_dataset(dataset if use is None else within(dataset, *use))
