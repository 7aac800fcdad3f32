"""The steps of a campaign."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

from auvid_cli.campaign.axes import Label
from auvid_cli.campaign.engine import cluster_client, n_threads, perform_groups
from auvid_cli.campaign.findings import find, in_order
from auvid_cli.campaign.perform import perform, shortened_group
from auvid_cli.campaign.plan import CampaignPlan
from auvid_cli.campaign.store import Store
from auvid_cli.cli.browser import open_page
from auvid_cli.cli.exit_codes import DONE, VERDICT_FAILED
from auvid_cli.cli.terminal import Terminal
from auvid_cli.config.campaign import load_campaign
from auvid_cli.config.figure_format import FigureFormat
from auvid_cli.config.load import find_campaign
from auvid_cli.data.estimate_file import write_estimate
from auvid_cli.data.replacement import refuse_other_page
from auvid_cli.data.results_folder import dataset_in, folder_of_run, locked, page_in
from auvid_cli.errors import FileError
from auvid_cli.report.campaign_tables import print_findings, write_findings
from auvid_cli.report.figures.draw import drawing
from auvid_cli.report.page.campaign_page import campaign_page
from auvid_cli.report.page.write_page import write_page

# A dry run takes the time of some groups on so many seconds of data, until it has taken so many seconds itself.
_PROBES, _PROBED, _PATIENCE = 6, 5.0, 2.0


class Where(NamedTuple):
    """Workers: those of a scheduler, or so many processes on this machine."""

    scheduler: str | None
    workers: int


class Choice(NamedTuple):
    """Choice of runs that are done although they have been, of whole estimates, of figures, and to see the page."""

    retry: bool
    again: bool
    keep_estimates: bool
    show: bool
    figure_format: tuple[FigureFormat, ...]


def set_up(name: str, overrides: Sequence[str], output: Path | None) -> tuple[CampaignPlan, Path]:
    """Return a campaign's runs, and where its results go.

    Raises
    ------
    ConfigError
        With every mistake in its settings.
    """
    path = find_campaign(name)
    campaign, tree = load_campaign(path, overrides)
    return CampaignPlan(campaign, tree, path), output or folder_of_run("campaigns") / campaign.name


def forecast(plan: CampaignPlan, folder: Path, where: Where, choice: Choice, terminal: Terminal) -> None:
    """Say how many runs there are, and about how long those take that are to be done."""
    store = Store(folder, plan.columns)
    done, failed = _done_and_failed(store, plan.labels()) if store.finished() or store.failures else (set(), set())
    terminal.tell(
        f"{plan.campaign.name}: {plan.n_runs} runs: combinations of settings {plan.campaign.n_cells}, filters "
        f"{len(plan.filters)}, seeds {plan.campaign.n_seeds}; {len(done)} finished, {len(failed)} failed"
    )
    left = plan.n_runs - len(_skipped(done, failed, choice))
    if not left:
        terminal.tell("0 left to do; --retry tries again what failed, --again does all anew")
        return
    threads = where.workers
    if where.scheduler is not None:
        with cluster_client(where.scheduler, None) as client:
            threads = n_threads(client)
    with terminal.stage("try some runs"):
        seconds, failure = _seconds_of_a_run(plan)
    if seconds is None:
        terminal.tell(f"how long {left} runs take is not known: tried on {_PROBED:g} s of data they fail: {failure}")
        return
    terminal.tell(
        f"{left} runs take about {_duration(seconds * left / threads)} on {threads} workers like this machine, after "
        f"some seconds to start; by a few of them on {_PROBED:g} s of data, tried here"
    )


def _seconds_of_a_run(plan: CampaignPlan) -> tuple[float | None, str]:
    """Measure what a run takes, by some that are cut short; if those fail, return None, and why."""
    taken, failure, begin = [], "", perf_counter()
    for example in plan.examples(_PROBES):
        group, share = shortened_group(example, _PROBED)
        if not taken:
            # What is loaded once is no part of it.
            perform(group)
        start = perf_counter()
        performed = perform(group)
        failure = next((result.failure for result in performed if result.failure), "")
        if not failure:
            taken.append((perf_counter() - start) / len(performed) / share)
        if perf_counter() - begin > _PATIENCE:
            break
    return (sum(taken) / len(taken) if taken else None), failure


def conduct(plan: CampaignPlan, folder: Path, where: Where, choice: Choice, terminal: Terminal) -> int:
    """Do the runs that are not done yet, and report all; the exit code says whether any failed.

    Raises
    ------
    ClusterError
        If a scheduler does not answer, or no longer.
    FileError
        If results cannot be read or written.
    """
    if dataset_in(folder).exists():
        raise FileError(f"{dataset_in(folder)}: results of a run stand here; name another folder with --output")
    refuse_other_page(page_in(folder))
    with locked(folder):
        return _conduct(plan, folder, where, choice, terminal)


def _conduct(plan: CampaignPlan, folder: Path, where: Where, choice: Choice, terminal: Terminal) -> int:
    labels = plan.labels()
    with terminal.stage("look at what is there"):
        store = Store(folder, plan.columns)
        if choice.again:
            store.set_aside()
        else:
            store.conform(labels)
        done, failed = _done_and_failed(store, labels)
        skipped = _skipped(done, failed, choice)
    if choice.keep_estimates and done and not choice.again:
        terminal.tell(f"{len(done)} runs are finished, and estimates are only written of new ones; --again does all")
    if len(skipped) < len(labels):
        estimates = folder / "estimates" if choice.keep_estimates else None
        try:
            _work(plan, store, skipped, len(labels), where, estimates, terminal)
        finally:
            store.merge()
    if choice.again:
        # What was not done again, or failed this time, comes back.
        n_failed = len(store.failures)
        store.conform(labels)
        if standing := n_failed - len(store.failures):
            terminal.tell(f"{standing} runs failed when they were done again: what they came to before stands")
    return _report(plan, folder, store, labels, choice, terminal)


def _done_and_failed(store: Store, labels: Mapping[str, Mapping[str, Label]]) -> tuple[set[str], set[str]]:
    """Return which of the planned runs a store has results of, and which failed."""
    return store.finished() & labels.keys(), {failure.run for failure in store.failures} & labels.keys()


def _skipped(done: set[str], failed: set[str], choice: Choice) -> set[str]:
    """Return which of the runs that were done or failed are left as they are."""
    if choice.again:
        return set()
    return done if choice.retry else done | failed


def _work(
    plan: CampaignPlan,
    store: Store,
    skipped: set[str],
    total: int,
    where: Where,
    estimates: Path | None,
    terminal: Terminal,
) -> None:
    ended, failed, left = len(skipped), 0, total - len(skipped)
    with ExitStack() as stack:
        with terminal.stage("start the workers"):
            client = stack.enter_context(cluster_client(where.scheduler, where.workers))
        (progress,) = stack.enter_context(terminal.progress("runs"))
        try:
            for group in perform_groups(client, plan.groups(skipped), estimates is not None):
                for performed in group:
                    if estimates is not None and performed.estimate is not None:
                        write_estimate(estimates / f"{performed.run.identity}.h5", performed.estimate)
                store.add(group)
                ended += len(group)
                failed += sum(bool(performed.failure) for performed in group)
                progress(ended - len(skipped), left, f", {failed} failed")
        except KeyboardInterrupt:
            terminal.tell(f"{ended} of {total} runs are done and kept; the same command goes on with the others")
            raise


def _report(
    plan: CampaignPlan,
    folder: Path,
    store: Store,
    labels: Mapping[str, Mapping[str, Label]],
    choice: Choice,
    terminal: Terminal,
) -> int:
    with terminal.stage("evaluate"):
        failures = [failure for failure in store.failures if failure.run in labels]
        rows = store.rows(labels).to_pandas()
    if len(rows):
        with terminal.stage("statistics"):
            findings = find(in_order(rows, labels), plan.fixed_columns)
        paths = write_findings(findings, folder / "tables")
        filters = {variant.name: variant.filter.value for variant in plan.filters}
        with drawing(folder, choice.figure_format) as figures, terminal.progress("figures") as (progress,):
            figures.add_campaign(findings, filters)
            reasons = list(dict.fromkeys(failure.reason for failure in failures))
            page = campaign_page(plan.campaign, findings, filters, reasons)
            paths.append(write_page(page, page_in(folder)))
            paths += figures.finish(progress)
        print_findings(terminal.out, findings, paths)
        if choice.show:
            open_page(page_in(folder), terminal)
    n_runs = int((rows["kind"] == "run").sum()) - len(failures)
    terminal.tell(f"{folder / 'results'}: {n_runs} of {len(labels)} runs")
    if apart := len(store.finished() - labels.keys()):
        terminal.tell(f"{folder / 'earlier'}: {apart} runs of other settings, kept apart")
    if failures:
        terminal.tell(
            f"{folder / 'failures.csv'}: {len(failures)} runs failed, the first because: {failures[0].reason}; "
            "--retry tries them again"
        )
    return DONE if n_runs == len(labels) else VERDICT_FAILED


def _duration(seconds: float) -> str:
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"
