"""Verdicts on data, on estimates, and on what data can tell at best."""

from collections.abc import Mapping

from auvid_cli.api.same_data import refuse_estimates_of_others
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation import evaluate as evaluation
from auvid_cli.evaluation.assessment import Identifiability
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.check import Checks
from auvid_cli.evaluation.estimate_checks import check_estimate
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.evaluation.identifiability import assess_dataset
from auvid_cli.evaluation.judgement import judge
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.inspection.inspect import inspect_dataset
from auvid_cli.inspection.inspection import Inspection
from auvid_cli.inspection.time_window import within
from auvid_cli.validation import validate as validation
from auvid_cli.validation.data_leakage import unseen_data
from auvid_cli.validation.results import Validation


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
        If an estimate was made from another dataset.

    Examples
    --------
    >>> tables = auvid.evaluate(dataset, estimate).to_pandas()
    >>> list(tables)
    ['coefficients', 'summary', 'velocity_error', 'consistency', 'sensor_errors', 'faults']
    """
    refuse_estimates_of_others(dataset, estimates)
    prepared = prepare(dataset)
    return evaluation.evaluate(prepared, list(estimates), BoundsOf(prepared))


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
        If an estimate was made from another dataset.

    Examples
    --------
    >>> [verdict.check for verdict in auvid.check(dataset, estimate) if verdict.passed is False]
    []
    """
    refuse_estimates_of_others(dataset, estimates)
    prepared = prepare(dataset)
    bounds_of = BoundsOf(prepared)
    judgements = judge(estimates)
    return Checks(
        verdict
        for estimate in estimates
        for verdict in check_estimate(prepared, estimate, bounds_of(estimate), judgements[estimate.filter])
    )


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


def validate(dataset: Dataset, estimate: Estimate, training: Dataset | None = None) -> Validation:
    """Say how well an identified model predicts data that it has not seen, and whether its uncertainty is honest.

    Parameters
    ----------
    dataset : Dataset
        Of another run than the estimate was made from.
    estimate : Estimate
    training : Dataset, optional
        That the estimate was made from: a copy of it, or of a part, is then refused as well. Data that were in no file
        are recognised in no other way.

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
    return validation.validate(unseen_data(dataset, estimate, training), estimate)
