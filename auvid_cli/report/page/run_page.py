"""The page of a run: what its estimates are worth, what they say, and what they rest on."""

from collections.abc import Sequence

from auvid_cli.data.check import Check
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.accuracy import shares_of_prior
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.report.layout import lay_out
from auvid_cli.report.page.coefficients import coefficient_list, convergence, estimate_plots
from auvid_cli.report.page.correlation import correlation_of
from auvid_cli.report.page.course import course_parts
from auvid_cli.report.page.forest import forest
from auvid_cli.report.page.parts import Page, Part, Section, TablePart, Words
from auvid_cli.report.page.path import path_parts
from auvid_cli.report.page.provenance import provenance_section, what_ran
from auvid_cli.report.page.residuals import innovation_parts
from auvid_cli.report.page.verdicts import check_parts, judgement_parts

# The table of bounds is in the list of coefficients.
_IN_THE_LIST = ("estimates", "bounds")


def run_page(dataset: Dataset, estimates: Sequence[Estimate], evaluation: Evaluation, checks: Sequence[Check]) -> Page:
    """Lay out all that is known of a run and its estimates.

    Parameters
    ----------
    dataset : Dataset
    estimates : sequence of Estimate
        The first is what stands open where one is shown at a time.
    evaluation : Evaluation
    checks : sequence of Check
    """
    true = dataset.truth.coefficients if dataset.truth is not None else {}
    shares = {estimate.filter: shares_of_prior(estimate) for estimate in estimates}
    tables = [table for table in lay_out(evaluation) if table.key not in _IN_THE_LIST]
    listed: list[Part] = []
    if evaluation.coefficients:
        listed = [*forest(evaluation), TablePart(coefficient_list(evaluation, shares), sortable=True)]
    remarks = [Words(evaluation.remarks, listed=True)] if evaluation.remarks else []
    sections = (
        Section("verdict", "Verdict", [*judgement_parts(evaluation, checks), *remarks]),
        Section("coefficients", "Coefficients", listed),
        Section("convergence", "Convergence", _convergence(estimates, true)),
        Section("correlation", "What is known only together", _correlation(estimates)),
        Section("innovations", "Innovations", innovation_parts(estimates)),
        Section("course", "Inputs, sensors, residuals", course_parts(dataset, evaluation.free_runs)),
        Section("path", "Path", path_parts(dataset.truth, estimates)),
        Section("tables", "Tables", [TablePart(table) for table in tables]),
        Section("checks", "Checks", check_parts(checks)),
        provenance_section(dataset),
    )
    return Page(dataset.experiment.name, _subtitle(dataset), sections)


def _convergence(estimates: Sequence[Estimate], true: dict[str, float]) -> list[Part]:
    over_time, distances = estimate_plots(estimates, true), convergence(estimates, true)
    reference = "true" if true else "final"
    parts: list[Part] = []
    if over_time.plots:
        line = "; the line is the true value" if true else ""
        parts += [Words([f"Estimate of each coefficient over time{line}. A batch estimate is constant."]), over_time]
    if distances.plots:
        parts += [Words([f"Distance of each estimate from the {reference} value, in per cent of it."]), distances]
    return parts


def _correlation(estimates: Sequence[Estimate]) -> list[Part]:
    """Return the correlations of the estimate by which others are judged, or else of the first."""
    reference = next((e for e in estimates if e.in_one_batch and e.completed), None)
    first = next((e for e in estimates if e.completed), None)
    chosen = reference or first
    return [] if chosen is None else correlation_of(chosen)


def _subtitle(dataset: Dataset) -> str:
    origin = "simulated, truth known" if dataset.truth is not None else "recorded, truth not known"
    return f"{dataset.experiment.vehicle.name}, {what_ran(dataset)}, sensors {', '.join(dataset.sensors)}; {origin}"
