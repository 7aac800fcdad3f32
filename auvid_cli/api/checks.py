"""Verdicts on estimates."""

from auvid_cli.api.argument_types import typed
from auvid_cli.api.preparation import prepare_checked
from auvid_cli.data.check import Checks
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.estimate_checks import check_estimates


@typed
def check(dataset: Dataset, *estimates: Estimate) -> Checks:
    """List verdicts on estimates: each a statistic, what it may be, and what to do where it is not.

    Parameters
    ----------
    dataset : Dataset
        From which the estimates were made.
    *estimates : Estimate
        As of `evaluate`.

    Returns
    -------
    Checks
        A list of `Check`; ``passed`` is None of what is only worth knowing. ``to_pandas()`` makes a table.

    Raises
    ------
    DataError
        If an estimate was made from another dataset, as far as files tell: of what was in no file nobody can.

    Examples
    --------
    >>> [verdict.check for verdict in auvid.check(dataset, estimate) if verdict.passed is False]
    []
    """
    prepared = prepare_checked(dataset, *estimates)
    return check_estimates(prepared, estimates, BoundsOf(prepared))
