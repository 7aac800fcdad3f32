"""Evaluation of estimates against their dataset: tables, free runs and judgements."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from auvid_cli.data.checks import NamedRows, frames
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.faults import FaultTest
from auvid_cli.evaluation.accuracy import (
    CoefficientResult,
    SensorErrorResult,
    average_steady_state_error,
    coefficient_results,
    one_speed_remarks,
    relative_rmse,
    sensor_error_results,
)
from auvid_cli.evaluation.bounds import Bounds, bounds_with_process_noise
from auvid_cli.evaluation.free_run import VelocityError, free_run
from auvid_cli.evaluation.innovations import SensorConsistency, mean_nis, sensor_consistency
from auvid_cli.evaluation.judgement import Judgement, judge, reference_among, status_of, with_considered_errors
from auvid_cli.evaluation.results import FreeRun
from auvid_cli.identification.prepared_data import PreparedData

if TYPE_CHECKING:
    import pandas as pd


class FilterSummary(NamedTuple):
    """A row of ``summary.csv``.

    Attributes
    ----------
    average_steady_state_error_percent : float or None
        Mean over the coefficients; None without truth or after divergence.
    mean_relative_rmse, median_relative_rmse : float or None
        RMSE / |true value| over the coefficients, dimensionless; None as above.
    mean_nis : float
        Mean normalised innovation squared of a component.
    judgement : Judgement
        In ``summary.csv``: columns ``grade``, ``reason``, ``remedy`` and ``doubted`` (symbols, or "all").
    """

    filter: str
    average_steady_state_error_percent: float | None
    mean_relative_rmse: float | None
    median_relative_rmse: float | None
    mean_nis: float
    cpu_time_s: float
    steps: int
    microseconds_per_step: float
    status: str
    judgement: Judgement

    def row(self) -> tuple[object, ...]:
        """Return the cells of the row in ``summary.csv``."""
        return *self[:-1], *self.judgement.row()


class Evaluation(NamedTuple):
    """Tables of all filters, their free runs, and remarks."""

    coefficients: list[CoefficientResult]
    summary: list[FilterSummary]
    velocity_errors: list[VelocityError]
    consistency: list[SensorConsistency]
    sensor_errors: list[SensorErrorResult]
    faults: list[tuple[str, FaultTest]]
    free_runs: dict[str, FreeRun]
    remarks: list[str]

    def judgements(self) -> dict[str, Judgement]:
        """Return the judgement of each filter."""
        return {row.filter: row.judgement for row in self.summary}

    def tables(self) -> dict[str, NamedRows]:
        """Return the rows of each CSV file, by its name."""
        return {
            "coefficients": NamedRows(CoefficientResult._fields, self.coefficients),
            "summary": NamedRows(
                (*FilterSummary._fields[:-1], *Judgement._fields), [row.row() for row in self.summary]
            ),
            "velocity_error": NamedRows(VelocityError._fields, self.velocity_errors),
            "consistency": NamedRows(SensorConsistency._fields, self.consistency),
            "sensor_errors": NamedRows(SensorErrorResult._fields, self.sensor_errors),
            "faults": NamedRows(
                ("filter", *FaultTest._fields, "z"),
                [(name, *test.row(), test.z) for name, test in self.faults],
            ),
        }

    def to_pandas(self) -> "dict[str, pd.DataFrame]":
        """Return tables with the names and columns of the CSV files: ``coefficients``, ``summary`` and so on."""
        return frames(self.tables())


def evaluate(prepared: PreparedData, estimates: list[Estimate], bounds_of: Callable[[Estimate], Bounds]) -> Evaluation:
    """Evaluate estimates against the dataset they came from, its truth where it has one, and their bounds."""
    estimates = with_considered_errors(estimates)
    judgements, with_noise = judge(estimates), _bounds_with_process_noise(prepared, estimates)
    bounds = {estimate.filter: bounds_of(estimate) for estimate in estimates}
    remarks = {f"no Cramer-Rao bound: {bound.remark}" for bound in bounds.values() if bound.remark}
    # Rounded speeds of different estimators may differ.
    of_speed = one_speed_remarks(reference_among(estimates) or estimates[0])
    evaluation = Evaluation([], [], [], [], [], [], {}, [*sorted(remarks), *_of_different_data(estimates), *of_speed])
    for estimate in estimates:
        own = prepared.with_settings(estimate.experiment)
        run, errors = free_run(own, estimate)
        judgement = judgements[estimate.filter]
        results = coefficient_results(estimate, prepared.dataset.truth, bounds[estimate.filter].of_data, judgement)
        relative = relative_rmse(results)
        steps = max(estimate.steps, 1)
        evaluation.coefficients.extend(
            result._replace(bound_with_process_noise=with_noise.get(result.coefficient)) for result in results
        )
        evaluation.summary.append(
            FilterSummary(
                estimate.filter,
                average_steady_state_error(results),
                float(np.mean(relative)) if relative else None,
                float(np.median(relative)) if relative else None,
                mean_nis(estimate),
                estimate.cpu_time,
                steps,
                estimate.cpu_time / steps * 1e6,
                status_of(estimate, judgement),
                judgement,
            )
        )
        evaluation.velocity_errors.extend(errors)
        evaluation.consistency.extend(sensor_consistency(estimate))
        evaluation.sensor_errors.extend(
            sensor_error_results(estimate, [segment.timelines.span[1] for segment in own.segments])
        )
        evaluation.faults.extend((estimate.filter, fault) for fault in estimate.faults)
        evaluation.free_runs[estimate.filter] = run
    return evaluation


def _bounds_with_process_noise(prepared: PreparedData, estimates: list[Estimate]) -> dict[str, float]:
    """Return the bounds of the coefficients with process noise; none without a smoother's estimate."""
    reference = reference_among(estimates)
    # The information of an earlier estimate in the prior cannot be subtracted.
    if (
        reference is None
        or not reference.completed
        or reference.experiment.identification.prior.from_estimate is not None
    ):
        return {}
    return bounds_with_process_noise(prepared, reference)


def _of_different_data(estimates: list[Estimate]) -> list[str]:
    """Return a sentence if the estimates use different parts of the data."""
    used = {estimate.filter: estimate.experiment.identification.use.model_dump_json() for estimate in estimates}
    if len(set(used.values())) < 2:
        return []
    spans = ", ".join(
        f"{estimate.filter} {estimate.time[0]:.6g} to {estimate.time[-1]:.6g} s" for estimate in estimates
    )
    return [f"estimates from different parts of the data cannot be compared (identification.use): {spans}"]
