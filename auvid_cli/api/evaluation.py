"""Errors, bounds and judgements of estimates, in tables."""

from collections.abc import Sequence

from auvid_cli.api.argument_types import typed
from auvid_cli.api.preparation import prepare_checked
from auvid_cli.data.check import Checks
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation import evaluate as evaluation
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.estimate_checks import check_estimates
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.identification.prepared_data import PreparedData


class Evaluator:
    """Evaluates estimates of the same data, and finds each of their bounds once.

    Parameters
    ----------
    prepared : PreparedData
        From which the estimates are made.
    """

    def __init__(self, prepared: PreparedData) -> None:
        self._prepared = prepared
        self._bounds_of = BoundsOf(prepared)

    @property
    def dataset(self) -> Dataset:
        """Return the data."""
        return self._prepared.dataset

    def find_bounds(self, estimate: Estimate) -> None:
        """Find the bounds of an estimate before they are asked for, while other filters are still at work."""
        self._bounds_of(estimate)

    def evaluate(self, estimates: Sequence[Estimate]) -> Evaluation:
        """Evaluate estimates together."""
        return evaluation.evaluate(self._prepared, list(estimates), self._bounds_of)

    def check(self, estimates: Sequence[Estimate]) -> Checks:
        """List all verdicts on estimates, see `auvid_cli.api.checks.check`."""
        return check_estimates(self._prepared, estimates, self._bounds_of)


@typed
def evaluate(dataset: Dataset, *estimates: Estimate) -> Evaluation:
    """Compare estimates with the truth of their dataset, where it has one, with their bounds, and with each other.

    Parameters
    ----------
    dataset : Dataset
        From which the estimates were made.
    *estimates : Estimate
        Those of filters are judged by that of the smoother, if it is among them; otherwise nobody judges them, and no
        coefficient counts as identified.

    Returns
    -------
    Evaluation
        Coefficients with their errors and Cramér-Rao bounds, a summary of each filter, errors of free runs,
        consistency, sensor errors, faults; ``to_pandas()`` makes tables of them by these names.

    Raises
    ------
    DataError
        If an estimate was made from another dataset, as far as files tell: of what was in no file nobody can.

    Examples
    --------
    >>> tables = auvid.evaluate(dataset, estimate).to_pandas()
    >>> list(tables)
    ['coefficients', 'summary', 'velocity_error', 'consistency', 'sensor_errors', 'faults']
    """
    return Evaluator(prepare_checked(dataset, *estimates)).evaluate(estimates)
