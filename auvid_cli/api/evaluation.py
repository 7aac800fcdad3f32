"""Evaluation of estimates: errors, bounds, verdicts, judgements, predictions of unseen data."""

from collections.abc import Mapping, Sequence

from auvid_cli.api.arguments import checked
from auvid_cli.api.files import refuse_estimates_of_others
from auvid_cli.data.checks import Checks
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation import evaluate as evaluation
from auvid_cli.evaluation import judgement
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.estimate_checks import check_estimates
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.evaluation.identifiability import assess_dataset
from auvid_cli.evaluation.judgement import Judgement
from auvid_cli.evaluation.results import Identifiability
from auvid_cli.identification.prepared_data import PreparedData, prepare
from auvid_cli.validation.data_leakage import unseen_segments
from auvid_cli.validation.results import Validation
from auvid_cli.validation.validate import validate as predict


def prepare_checked(dataset: Dataset, *estimates: Estimate) -> PreparedData:
    """Prepare a dataset for the evaluation of estimates that were made from it.

    Raises
    ------
    DataError
        If an estimate was made from another dataset, or no sensor can be used.
    """
    refuse_estimates_of_others(dataset, estimates)
    return prepare(dataset)


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
        """List all verdicts on estimates, see `check`."""
        return check_estimates(self._prepared, estimates, self._bounds_of)


@checked
def evaluate(dataset: Dataset, *estimates: Estimate) -> Evaluation:
    """Compare estimates with the truth of their dataset, where it has one, with their bounds, and with each other.

    Parameters
    ----------
    dataset : Dataset
        From which the estimates were made.
    *estimates : Estimate
        The smoother judges the other filters, if its estimate is among them. Without it no filter is judged, and no
        coefficient counts as identified.

    Returns
    -------
    Evaluation
        Coefficients with their errors and Cramér-Rao bounds, a summary of each filter, errors of free runs,
        consistency, sensor errors, faults; ``to_pandas()`` makes tables of them by these names.

    Raises
    ------
    DataError
        If an estimate was made from another dataset. Only data that come from a file are recognised.

    Examples
    --------
    >>> tables = auvid.evaluate(dataset, estimate).to_pandas()
    >>> list(tables)
    ['coefficients', 'summary', 'velocity_error', 'consistency', 'sensor_errors', 'faults']
    """
    return Evaluator(prepare_checked(dataset, *estimates)).evaluate(estimates)


@checked
def check(dataset: Dataset, *estimates: Estimate) -> Checks:
    """Return verdicts on estimates: each a statistic, its threshold, and advice where it fails.

    Parameters
    ----------
    dataset : Dataset
        From which the estimates were made.
    *estimates : Estimate
        As of `evaluate`.

    Returns
    -------
    Checks
        A list of `Check`; ``passed`` is None of a mere note. ``to_pandas()`` makes a table.

    Raises
    ------
    DataError
        If an estimate was made from another dataset. Only data that come from a file are recognised.

    Examples
    --------
    >>> [verdict.check for verdict in auvid.check(dataset, estimate) if verdict.passed is False]
    []
    """
    prepared = prepare_checked(dataset, *estimates)
    return check_estimates(prepared, estimates, BoundsOf(prepared))


def judge(*estimates: Estimate) -> dict[str, Judgement]:
    """Judge estimates of the same data, by filter; the smoother's judges the others, if it is among them."""
    return judgement.judge(estimates)


@checked
def identifiability(dataset: Dataset, at: Mapping[str, float] | None = None) -> Identifiability:
    """Return the best accuracy that data allow for each coefficient, before any filter runs.

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


@checked
def validate(
    data: Dataset | Sequence[Dataset], estimate: Estimate, training: Dataset | None = None, *, anew: bool = False
) -> Validation:
    """Return how well an identified model predicts data that it has not seen, and how honest its uncertainty is.

    Parameters
    ----------
    data : Dataset or sequence of Dataset
        Other runs than the estimate was made from. Several datasets, and all segments of each, are judged together.
    estimate : Estimate
    training : Dataset, optional
        Dataset that the estimate was made from. Copies of it, or of a part, are then refused as `data`; data in memory
        are recognised in no other way. The bands then include how much worse than stated it is predicted.
    anew : bool
        Whether thrust, fin trims and ballast, if they are estimated, are estimated again in each run, even where they
        are constants of the estimate: a trim may differ between days.

    Returns
    -------
    Validation
        Predictions by signal and horizon, next to the prior and an unchanged motion; numbers of manoeuvres; verdicts;
        ``to_pandas()`` makes tables of these; ``run`` is the free run of the longest segment, with ``to_xarray()``.

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
