"""The steps of a campaign."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from itertools import islice
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

from auvid_cli.campaign.axes import Label
from auvid_cli.campaign.engine import cluster_client, perform_groups
from auvid_cli.campaign.findings import find
from auvid_cli.campaign.perform import perform
from auvid_cli.campaign.plan import Plan
from auvid_cli.campaign.store import Store, locked
from auvid_cli.cli import pipeline
from auvid_cli.cli.terminal import DONE, VERDICT_FAILED, Terminal
from auvid_cli.config.campaign import load_campaign
from auvid_cli.config.load import find_campaign
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.estimate_file import new_estimate
from auvid_cli.report.campaign import print_findings, write_findings

# Groups of which a dry run takes the time.
_PROBES = 6


class Where(NamedTuple):
    """Workers: those of a scheduler, or so many processes on this machine."""

    scheduler: str | None
    workers: int


class Choice(NamedTuple):
    """Which runs are done although they have been, and whether whole estimates are written."""

    retry: bool
    again: bool
    keep_estimates: bool


def set_up(name: str, overrides: Sequence[str], output: Path | None) -> tuple[Plan, Path]:
    """A campaign's runs, and where its results go.

    Raises
    ------
    ConfigError
        With every mistake in its settings.
    """
    path = find_campaign(name)
    campaign, tree = load_campaign(path, overrides)
    return Plan(campaign, tree, path), output or Path("results") / "campaigns" / campaign.name


def forecast(plan: Plan, folder: Path, where: Where, terminal: Terminal) -> None:
    """Say how many runs there are, and about how long those take that are to be done."""
    labels = plan.labels()
    store = Store(folder, plan.columns)
    done = store.finished() & labels.keys()
    failed = {failure.run for failure in store.failures} & labels.keys()
    terminal.say(
        f"{plan.campaign.name}: {len(labels)} runs: {plan.campaign.n_cells} combinations of settings, "
        f"{len(plan.filters)} filters, {len(plan.campaign.seed_list)} seeds; {len(done)} finished, {len(failed)} failed"
    )
    left = len(labels) - len(done | failed)
    if not left:
        terminal.say("0 left to do; --retry tries again what failed, --again does all anew")
        return
    first = list(islice(plan.groups(done | failed), -(-plan.n_runs // len(plan.campaign.seed_list))))
    probes = first[:: -(-len(first) // _PROBES)]
    # The first takes what is loaded once.
    perform(probes[0])
    start = perf_counter()
    for group in probes:
        perform(group)
    seconds = (perf_counter() - start) / sum(len(group.runs) for group in probes) * left / where.workers
    terminal.say(
        f"{left} runs take about {_duration(seconds)} on {where.workers} workers of this kind, "
        f"by {len(probes)} of the first groups of them"
    )


def conduct(plan: Plan, folder: Path, where: Where, choice: Choice, terminal: Terminal) -> int:
    """Do the runs that are not done yet, and report all; the exit code says whether any failed.

    Raises
    ------
    ClusterError
        If a scheduler does not answer, or no longer.
    FileError
        If results cannot be read or written.
    """
    with locked(folder):
        return _conduct(plan, folder, where, choice, terminal)


def _conduct(plan: Plan, folder: Path, where: Where, choice: Choice, terminal: Terminal) -> int:
    labels = plan.labels()
    with terminal.stage("look at what is there"):
        store = Store(folder, plan.columns)
        if choice.again:
            store.forget(labels)
        store.conform(labels)
        skipped = store.finished()
    if not (choice.retry or choice.again):
        skipped |= {failure.run for failure in store.failures}
    left = len(labels.keys() - skipped)
    if left:
        _work(plan, store, skipped, left, where, folder / "estimates" if choice.keep_estimates else None, terminal)
        store.merge()
    return _report(plan, folder, store, labels, terminal)


def _work(
    plan: Plan, store: Store, skipped: set[str], left: int, where: Where, estimates: Path | None, terminal: Terminal
) -> None:
    ended = failed = 0
    with ExitStack() as stack:
        with terminal.stage("start the workers"):
            client = stack.enter_context(cluster_client(where.scheduler, where.workers))
        (progress,) = stack.enter_context(terminal.progress("runs"))
        try:
            for group in perform_groups(client, plan.groups(skipped), estimates is not None):
                for performed in group:
                    if estimates is not None and performed.estimate is not None:
                        _write_estimate(estimates / f"{performed.run.identity}.h5", performed.estimate)
                store.add(group)
                ended += len(group)
                failed += sum(bool(performed.failure) for performed in group)
                progress(ended, left, f", {failed} failed")
        except KeyboardInterrupt:
            terminal.say(f"{ended} of {left} runs are done and kept; the same command goes on with the others")
            raise


def _write_estimate(path: Path, estimate: Estimate) -> None:
    with new_estimate(path, estimate) as writer:
        writer.append(estimate)
        writer.finish(estimate)


def _report(
    plan: Plan, folder: Path, store: Store, labels: Mapping[str, Mapping[str, Label]], terminal: Terminal
) -> int:
    with terminal.stage("evaluate"):
        rows = store.rows(labels.keys()).to_pandas()
        # In the order of the plan, not in that in which they ended.
        rows = rows.sort_values(
            "run", kind="stable", key=lambda runs: runs.map({run: k for k, run in enumerate(labels)})
        )
        failures = [failure for failure in store.failures if failure.run in labels]
    if len(rows):
        with terminal.stage("statistics"):
            found = find(rows, plan.fixed_columns)
        paths = write_findings(found, folder / "tables")
        with pipeline.drawing(folder) as figures, terminal.progress("figures") as (progress,):
            figures.add_campaign(found, {variant.name: variant.filter.value for variant in plan.filters})
            paths += figures.finish(progress)
        print_findings(terminal.out, found, paths)
    n_runs = int((rows["kind"] == "run").sum())
    terminal.say(f"{folder / 'results'}: {n_runs} of {len(labels)} runs")
    if failures:
        terminal.say(
            f"{folder / 'failures.csv'}: {len(failures)} runs failed, the first because: {failures[0].reason}; "
            "--retry tries them again"
        )
    return VERDICT_FAILED if failures else DONE


def _duration(seconds: float) -> str:
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"
