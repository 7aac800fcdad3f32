"""Campaigns: an experiment with many seeds, filters and settings."""

import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

from auvid_cli.api import Progress
from auvid_cli.campaign.cluster import dask_cluster, local_cluster, run_group, run_groups, shortened_group
from auvid_cli.campaign.plan import CampaignPlan
from auvid_cli.campaign.store import Store
from auvid_cli.campaign.summary import CampaignSummary, in_planned_order, summarize
from auvid_cli.config.campaign import Label, load_campaign
from auvid_cli.config.enums import FigureFormat
from auvid_cli.config.loading import find_campaign
from auvid_cli.data.estimate_file import write_estimate
from auvid_cli.data.files import dataset_in, folder_of_run, locked, page_in
from auvid_cli.data.results import refuse_other_page
from auvid_cli.errors import FileError
from auvid_cli.report.campaign_results import campaign_page, write_summary
from auvid_cli.report.figures.draw import drawing
from auvid_cli.report.page.render import write_page

# A forecast measures a few groups of runs on the first seconds of their data.
N_PROBES = 6
PROBE_DURATION = 5.0  # s of data
PROBE_TIME = 2.0  # s; no further group is measured after that


class Workers(NamedTuple):
    """Workers of a Dask scheduler at an address, or a number of processes on this machine."""

    scheduler: str | None
    processes: int


class CampaignOptions(NamedTuple):
    """Workers, whether to repeat failed runs or all runs, whether to write each estimate, and formats of figures."""

    workers: Workers
    retry: bool
    again: bool
    keep_estimates: bool
    figure_formats: tuple[FigureFormat, ...]


class CampaignResult(NamedTuple):
    """Statistics (None if no run is finished), written files, remarks, and whether all runs are finished."""

    summary: CampaignSummary | None
    files: list[Path]
    page: Path
    remarks: list[str]
    is_complete: bool


def plan_campaign(name: str, overrides: Sequence[str], output: Path | None) -> tuple[CampaignPlan, Path]:
    """Return the runs of a campaign, and its results folder."""
    path = find_campaign(name)
    campaign, tree = load_campaign(path, overrides)
    return CampaignPlan(campaign, tree, path), output or folder_of_run("campaigns") / campaign.name


def forecast(plan: CampaignPlan, folder: Path, options: CampaignOptions, progress: Progress) -> None:
    """Report the number of runs, and the expected time for the remaining ones."""
    store = Store(folder, plan.columns)
    done, failed = _done_and_failed(store, plan.labels()) if store.finished() or store.failures else (set(), set())
    progress.message(
        f"{plan.campaign.name}: {plan.n_runs} runs: {_settings(plan)}, "
        f"{len(plan.filters)} filters, {plan.campaign.n_seeds} seeds; {len(done)} finished, {len(failed)} failed"
    )
    remaining = plan.n_runs - len(_skipped(done, failed, options))
    if not remaining:
        progress.message("0 runs remain; --retry repeats failed runs, --again repeats all runs")
        return
    if any(variant.fit for variant in plan.filters):
        # A search on a few seconds of data ends sooner, and its time does not grow in proportion to the data.
        progress.message(
            f"{remaining} runs remain; duration unknown, because `fit: true` searches for a model. "
            "Try one seed first: --set seeds=1"
        )
        return
    threads = options.workers.processes
    if options.workers.scheduler is not None:
        with dask_cluster(options.workers.scheduler) as cluster:
            threads = cluster.n_workers()
    with progress.stage("measure some runs"):
        seconds, failure = _seconds_of_a_run(plan)
    if seconds is None:
        progress.message(
            f"{remaining} runs remain; duration unknown, because test runs ({PROBE_DURATION:g} s) failed: {failure}"
        )
        return
    progress.message(
        f"{remaining} runs take about {_duration(seconds * remaining / threads)} on {threads} workers like this "
        f"machine (estimated from a few runs of {PROBE_DURATION:g} s); starting takes some seconds more"
    )


def _settings(plan: CampaignPlan) -> str:
    """Return the number of combinations of settings, in words."""
    count = plan.campaign.n_cells
    return "1 combination of settings" if count == 1 else f"{count} combinations of settings"


def _seconds_of_a_run(plan: CampaignPlan) -> tuple[float | None, str]:
    """Return the time per run, s, measured on shortened runs; if they fail, None and the reason."""
    taken, failure, begin = [], "", perf_counter()
    for example in plan.examples(N_PROBES):
        group, share = shortened_group(example, PROBE_DURATION)
        if not taken:
            # The first run also loads modules, so it is not measured.
            run_group(group)
        start = perf_counter()
        performed = run_group(group)
        failure = next((result.failure for result in performed if result.failure), "")
        if not failure:
            taken.append((perf_counter() - start) / len(performed) / share)
        if perf_counter() - begin > PROBE_TIME:
            break
    return (sum(taken) / len(taken) if taken else None), failure


def run_campaign(plan: CampaignPlan, folder: Path, options: CampaignOptions, progress: Progress) -> CampaignResult:
    """Perform the remaining runs, evaluate all runs, and write the results.

    Raises
    ------
    ClusterError
        If the scheduler does not answer.
    FileError
        If reading or writing results fails.
    """
    if os.path.lexists(dataset_in(folder)):
        raise FileError(f"{dataset_in(folder)}: this folder has results of a run; choose another folder with --output")
    refuse_other_page(page_in(folder))
    with locked(folder):
        return _run(plan, folder, options, progress)


def _run(plan: CampaignPlan, folder: Path, options: CampaignOptions, progress: Progress) -> CampaignResult:
    labels = plan.labels()
    with progress.stage("read earlier results"):
        store = Store(folder, plan.columns)
        if options.again:
            store.set_aside()
        else:
            store.match_plan(labels)
        done, failed = _done_and_failed(store, labels)
        skipped = _skipped(done, failed, options)
    if options.keep_estimates and done and not options.again:
        progress.message(f"{len(done)} runs are already finished, without their estimates; --again repeats them")
    if len(skipped) < len(labels):
        estimates = folder / "estimates" if options.keep_estimates else None
        try:
            _work(plan, store, skipped, len(labels), options, estimates, progress)
        finally:
            store.merge()
    if options.again:
        # Restore the earlier results of runs that were not repeated, or failed this time.
        n_failed = len(store.failures)
        store.match_plan(labels)
        if restored := n_failed - len(store.failures):
            progress.message(f"{restored} repeated runs failed; their earlier results are kept")
    return _report(plan, folder, store, labels, options, progress)


def _done_and_failed(store: Store, labels: Mapping[str, Mapping[str, Label]]) -> tuple[set[str], set[str]]:
    """Return the planned runs that are finished, and those that failed."""
    return store.finished() & labels.keys(), {failure.run for failure in store.failures} & labels.keys()


def _skipped(done: set[str], failed: set[str], options: CampaignOptions) -> set[str]:
    """Return the finished and failed runs that are not repeated."""
    if options.again:
        return set()
    return done if options.retry else done | failed


def _work(
    plan: CampaignPlan,
    store: Store,
    skipped: set[str],
    total: int,
    options: CampaignOptions,
    estimates: Path | None,
    progress: Progress,
) -> None:
    ended, failed, remaining = len(skipped), 0, total - len(skipped)
    with ExitStack() as stack:
        with progress.stage("start the workers"):
            scheduler, processes = options.workers
            connecting = local_cluster(processes) if scheduler is None else dask_cluster(scheduler)
            cluster = stack.enter_context(connecting)
        (advance,) = stack.enter_context(progress.bars("runs"))
        try:
            for group in run_groups(cluster, plan.groups(skipped), estimates is not None):
                for performed in group:
                    if estimates is not None and performed.estimate is not None:
                        write_estimate(estimates / f"{performed.run.identity}.h5", performed.estimate)
                store.add(group)
                ended += len(group)
                failed += sum(bool(performed.failure) for performed in group)
                advance(ended - len(skipped), remaining, f", {failed} failed")
        except KeyboardInterrupt:
            progress.message(
                f"{ended} of {total} runs are finished and kept; the same command continues with the others"
            )
            raise


def _report(
    plan: CampaignPlan,
    folder: Path,
    store: Store,
    labels: Mapping[str, Mapping[str, Label]],
    options: CampaignOptions,
    progress: Progress,
) -> CampaignResult:
    with progress.stage("evaluate"):
        failures = [failure for failure in store.failures if failure.run in labels]
        rows = store.rows(labels).to_pandas()
    summary, paths = None, []
    if len(rows):
        with progress.stage("statistics"):
            summary = summarize(in_planned_order(rows, labels), plan.fixed_columns, plan.drawn_columns)
        paths = write_summary(summary, folder / "tables")
        filters = {variant.name: variant.filter.value for variant in plan.filters}
        with drawing(folder, options.figure_formats) as figures, progress.bars("figures") as (advance,):
            figures.add_campaign(summary, filters)
            reasons = list(dict.fromkeys(failure.reason for failure in failures))
            page = campaign_page(plan.campaign, summary, filters, reasons)
            paths.append(write_page(page, page_in(folder)))
            paths += figures.finish(advance)
    n_runs = int((rows["kind"] == "run").sum()) - len(failures)
    remarks = [f"{folder / 'results'}: {n_runs} of {len(labels)} runs"]
    if n_other := len(store.finished() - labels.keys()):
        remarks.append(f"{folder / 'earlier'}: {n_other} runs with other settings")
    if failures:
        remarks.append(
            f"{folder / 'failures.csv'}: {len(failures)} runs failed; first reason: {failures[0].reason}; "
            "--retry repeats them"
        )
    return CampaignResult(summary, paths, page_in(folder), remarks, n_runs == len(labels))


def _duration(seconds: float) -> str:
    units = (86400.0, "days"), (3600.0, "h"), (60.0, "min")
    size, unit = next((each for each in units if seconds >= 2.0 * each[0]), (1.0, "s"))
    return f"{float(f'{seconds / size:.2g}'):g} {unit}"
