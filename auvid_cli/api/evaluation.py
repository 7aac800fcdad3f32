"""Evaluation of estimates: errors, bounds, verdicts, judgements, predictions of unseen data."""

from collections.abc import Mapping, Sequence

from auvid_cli.api.files import check_same_dataset, checked
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


class Evaluator:
    """Evaluates estimates of the same data, and computes the bounds of each only once."""

    def __init__(self, prepared: PreparedData) -> None:
        self._prepared = prepared
        self._bounds_of = BoundsOf(prepared)

    @property
    def dataset(self) -> Dataset:
        """Return the data."""
        return self._prepared.dataset

    def find_bounds(self, estimate: Estimate) -> None:
        """Compute the bounds of an estimate in advance, while other filters still run."""
        self._bounds_of(estimate)

    def evaluate(self, estimates: Sequence[Estimate]) -> Evaluation:
        """Evaluate estimates together."""
        return evaluation.evaluate(self._prepared, list(estimates), self._bounds_of)

    def check(self, estimates: Sequence[Estimate]) -> Checks:
        """Return all verdicts on estimates, see `check`."""
        return check_estimates(self._prepared, estimates, self._bounds_of)


@checked
def evaluate(dataset: Dataset, *estimates: Estimate) -> Evaluation:
    """Compare estimates with the truth of their dataset (if it has one), with their bounds, and with each other.

    Parameters
    ----------
    dataset : Dataset
        Dataset of the estimates.
    *estimates : Estimate
        Include the smoother, which judges the other filters. Without it no filter is judged, and no coefficient
        counts as identified.

    Returns
    -------
    Evaluation
        Coefficients with their errors and Cramér-Rao bounds, a summary of each filter, errors of free runs,
        consistency, sensor errors, faults. ``to_pandas()`` makes a table of each.

    Raises
    ------
    DataError
        If an estimate was made from another dataset (known only for datasets from files).

    Examples
    --------
    >>> tables = auvid.evaluate(dataset, estimate).to_pandas()
    >>> list(tables)
    ['coefficients', 'summary', 'velocity_error', 'consistency', 'sensor_errors', 'faults']
    """
    check_same_dataset(dataset, estimates)
    return Evaluator(prepare(dataset)).evaluate(estimates)


@checked
def check(dataset: Dataset, *estimates: Estimate) -> Checks:
    """Return verdicts on estimates: statistic, threshold, and advice after a failure.

    Parameters
    ----------
    dataset : Dataset
        Dataset of the estimates.
    *estimates : Estimate
        As for `evaluate`.

    Returns
    -------
    Checks
        List of `Check`; ``passed`` is None for a note. ``to_pandas()`` makes a table.

    Raises
    ------
    DataError
        If an estimate was made from another dataset (known only for datasets from files).

    Examples
    --------
    >>> [verdict.check for verdict in auvid.check(dataset, estimate) if verdict.passed is False]
    []
    """
    check_same_dataset(dataset, estimates)
    return Evaluator(prepare(dataset)).check(estimates)


def judge(*estimates: Estimate) -> dict[str, Judgement]:
    """Return a judgement per filter for estimates of the same data; the smoother, if included, judges the others."""
    return judgement.judge(estimates)


@checked
def identifiability(dataset: Dataset, at: Mapping[str, float] | None = None) -> Identifiability:
    """Return the best accuracy that data allow for each coefficient, before any filter runs.

    Parameters
    ----------
    dataset : Dataset
    at : mapping of float, optional
        Coefficients by symbol, SI, that the bounds hold at, such as ``estimate.final_coefficients()``. Default: true
        coefficients of a simulation, otherwise those of the vehicle.

    Returns
    -------
    Identifiability
        ``to_pandas()`` makes tables of the Cramér-Rao bounds and of the groups of confounded coefficients;
        ``to_xarray()`` has the contributions of the sensors, correlations, and bounds by duration.

    Raises
    ------
    DataError
        If an estimated coefficient has no value, or the simulation diverges with these values.

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
    """Test how well an identified model predicts other data, and whether its uncertainty is realistic.

    Parameters
    ----------
    data : Dataset or sequence of Dataset
        Runs that the estimate has not seen. All segments of all datasets are judged together.
    estimate : Estimate
    training : Dataset, optional
        Dataset of the estimate. With it, copies of this dataset or of its parts are refused as `data` (data in memory
        are not recognised otherwise), and the error bands include its prediction errors.
    anew : bool
        Whether estimated thrust, fin trims and ballast are estimated again in each run, even if they are constant in a
        run: a trim may differ between days.

    Returns
    -------
    Validation
        Prediction errors by signal and horizon, compared with the prior and an unchanged motion; numbers of manoeuvres;
        verdicts. ``to_pandas()`` makes tables; ``run.to_xarray()`` is the free run of the longest segment.

    Raises
    ------
    DataError
        If the estimate has seen the data or diverged, or the data are too short.

    Examples
    --------
    >>> validation = auvid.validate(other, estimate, training=dataset)
    >>> validation.run.to_xarray()["u"].attrs["units"]
    'm/s'
    """
    datasets = [data] if isinstance(data, Dataset) else data
    unseen = [segment for dataset in datasets for segment in unseen_segments(dataset, estimate, training)]
    return predict(unseen, estimate, training, anew=anew)
