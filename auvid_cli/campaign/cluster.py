"""Run a campaign on a Dask cluster: each task simulates data, runs filters on them and measures the results."""

import json
import logging
import os
import traceback
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import dask.config
import numpy as np
from distributed import Client, Future, LocalCluster, as_completed
from threadpoolctl import threadpool_limits

from auvid_cli._version import __version__
from auvid_cli.campaign.measures import Measure, measures
from auvid_cli.campaign.plan import CampaignRun, RunGroup
from auvid_cli.child_processes import SAFE_PATH, starting_children
from auvid_cli.config.coefficients import Term
from auvid_cli.config.enums import JUDGE
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.identification import Identification, Use
from auvid_cli.config.loading import given_settings
from auvid_cli.config.vehicle import ActuatorSettings
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import AuvidError, ClusterError, ConfigError
from auvid_cli.evaluation.bounds import bounds_at
from auvid_cli.evaluation.judgement import judge_one
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify
from auvid_cli.simulation.simulate import simulate

# Identification settings that the Cramer-Rao bound depends on.
_BOUND_SETTINGS = {"coefficients", "attitude_from", "use", "estimate", "integration_step", "inputs", "delays"}
# Groups at the scheduler for each thread, so that no worker waits.
_GROUPS_PER_THREAD = 3
START_TIME = 60.0  # s
# Less profiling and monitoring than by default, which takes time from the runs. The environment limits each library to
# one thread, and replaces that of Dask, which would return memory to the system after each array.
_DASK_SETTINGS = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.admin.tick.interval": "1s",
    # Also for a worker that replaces a killed one.
    "distributed.nanny.pre-spawn-environ": SAFE_PATH
    | {"OMP_NUM_THREADS": 1, "MKL_NUM_THREADS": 1, "OPENBLAS_NUM_THREADS": 1},
}
_GONE = "the scheduler is gone; finished runs are kept, and the same command continues with a new scheduler"


class RunResult(NamedTuple):
    """Outcome of a run.

    Attributes
    ----------
    run : CampaignRun
    rows : list of Measure
        Empty if the run failed.
    failure : str
        Reason; empty if the run did not fail.
    estimate : Estimate or None
        Only with `with_estimates`.
    """

    run: CampaignRun
    rows: list[Measure]
    failure: str
    estimate: Estimate | None


def run_group(group: RunGroup, with_estimates: bool = False) -> list[RunResult]:
    """Perform all runs of a group on one core; an error in one does not stop the others.

    Raises
    ------
    ConfigError
        If the group was planned by another version of auvid.
    """
    if group.version != __version__:
        raise ConfigError(f"the worker has auvid {__version__}; expected {group.version}, like the campaign")
    with threadpool_limits(1):
        pairs = zip(group.runs, group.assumed, strict=True)
        return [_perform(group.simulated, run, assumed, with_estimates) for run, assumed in pairs]


def shortened_group(group: RunGroup, duration: float) -> tuple[RunGroup, float]:
    """Return a group with the first `duration` of its data, s, all of it in use, and the share of the whole data."""
    whole = Experiment.model_validate_json(group.simulated).manoeuvre.duration
    shorter = min(duration, whole)

    def cut(text: str) -> str:
        experiment = Experiment.model_validate_json(text)
        manoeuvre = experiment.manoeuvre.model_copy(update={"duration": shorter})
        identification = experiment.identification.model_copy(update={"use": Use()})
        changes = {"manoeuvre": manoeuvre, "identification": identification}
        return json.dumps(given_settings(experiment.model_copy(update=changes)))

    shortened = group._replace(simulated=cut(group.simulated), assumed=[cut(text) for text in group.assumed])
    return shortened, shorter / whole


def _perform(simulated: str, run: CampaignRun, assumed_text: str, with_estimates: bool) -> RunResult:
    try:
        dataset = _data(simulated)
        assert dataset.truth is not None
        assumed = Experiment.model_validate_json(assumed_text)
        (name,) = assumed.identification.filters
        reference = _reference(simulated, _judging(assumed))
        if reference is not None and name is JUDGE:
            estimate = reference
        else:
            estimate = identify(_as_assumed(dataset, assumed), name)
        estimated = assumed.identification.estimated(assumed.vehicle)
        settings = assumed.identification.model_copy(update={"coefficients": estimated})
        identification = settings.model_dump_json(include=_BOUND_SETTINGS, exclude_none=True)
        vehicle = assumed.vehicle.model_dump_json(include={"terms", "actuators"}, exclude_none=True)
        bounds = _bounds(simulated, identification, vehicle)
        judgement = judge_one(estimate, reference)
        rows = measures(run.identity, run.filter, run.seed, estimate, dataset.truth, bounds, judgement)
    except AuvidError as error:
        return RunResult(run, [], str(error), None)
    except Exception as error:
        # The campaign goes on, so the failure needs its place.
        place = traceback.extract_tb(error.__traceback__)[-1]
        return RunResult(run, [], f"{type(error).__name__}: {error} ({place.name}, line {place.lineno})", None)
    return RunResult(run, rows, "", estimate if with_estimates else None)


# Groups with the same data follow each other.
@lru_cache(maxsize=2)
def _data(simulated: str) -> Dataset:
    return simulate(Experiment.model_validate_json(simulated))


def _as_assumed(dataset: Dataset, assumed: Experiment) -> Dataset:
    """Return the data with the settings assumed by a filter, including the noise of the sensors."""
    records = {
        name: replace(record, standard_deviation=np.array(getattr(assumed.sensors, name).stated_standard_deviation()))
        for name, record in dataset.sensors.items()
    }
    return replace(dataset, sensors=records, experiment=assumed)


def _judging(assumed: Experiment) -> str:
    """Return the experiment of the judge of a filter as JSON; empty if it has none."""
    settings = assumed.identification
    if JUDGE not in settings.with_judge(settings.filters):
        return ""
    judge = settings.for_filter(JUDGE)
    return json.dumps(given_settings(assumed.model_copy(update={"identification": judge})))


# Filters with the same data and assumptions share their judge, which may be one of them.
@lru_cache(maxsize=4)
def _reference(simulated: str, assumed: str) -> Estimate | None:
    if not assumed:
        return None
    return identify(_as_assumed(_data(simulated), Experiment.model_validate_json(assumed)), JUDGE)


@lru_cache(maxsize=8)
def _bounds(simulated: str, identification: str, assumed_vehicle: str) -> Mapping[str, float]:
    """Return Cramer-Rao bounds at the truth by symbol, without those that do not exist.

    Parameters
    ----------
    simulated : str
        Experiment of the data.
    identification : str
        Settings of `_BOUND_SETTINGS`.
    assumed_vehicle : str
        Terms and actuators of the filter; terms that the simulation does not have are zero in truth.
    """
    dataset = _data(simulated)
    vehicle, assumed = dataset.experiment.vehicle, json.loads(assumed_vehicle)
    terms = (Term.model_validate(term) for term in assumed["terms"])
    actuators = ActuatorSettings.model_validate(assumed["actuators"])
    additional = tuple(term for term in terms if term.name not in vehicle.coefficient_set.symbols)
    vehicle = vehicle.model_copy(update={"terms": (*vehicle.terms, *additional), "actuators": actuators})
    settings = Identification.model_validate_json(identification, context=vehicle.coefficient_set)
    changes = {"identification": settings, "vehicle": vehicle}
    data = replace(dataset, experiment=dataset.experiment.model_copy(update=changes))
    return bounds_at(prepare(data), data.known_coefficients()).of_data


@contextmanager
def cluster_client(scheduler: str | None, workers: int | None, start_time: float = START_TIME) -> Iterator[Client]:
    """Connect to a scheduler, or to a new cluster on this machine that ends with the block.

    Parameters
    ----------
    scheduler : str or None
        Address, such as tcp://10.0.0.1:8786.
    workers : int or None
        Processes of one thread each on this machine; None for one per core.
    start_time : float
        Longest time to wait for scheduler and workers, s.

    Raises
    ------
    ClusterError
        If the scheduler does not answer, or has no workers with this version of auvid.
    """
    # Errors become one line here.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with ExitStack() as stack:
        if scheduler is None:
            stack.enter_context(dask.config.set(_DASK_SETTINGS))
            target = stack.enter_context(_local_cluster(workers))
        else:
            target = scheduler
        try:
            client = stack.enter_context(Client(target, timeout=start_time / 2))
            client.wait_for_workers(1, timeout=start_time)
            versions = set(client.run(_version).values())  # pyright: ignore[reportAttributeAccessIssue]
        except ModuleNotFoundError as error:
            raise ClusterError(f"--scheduler {scheduler}: its workers have no auvid: {error}") from None
        except (OSError, TimeoutError, ValueError) as error:
            if scheduler is None:
                raise ClusterError(f"the workers on this machine do not start: {error}") from None
            raise ClusterError(f"--scheduler {scheduler}: no scheduler with workers answers there: {error}") from None
        if versions != {__version__}:
            found = ", ".join(sorted(versions))
            raise ClusterError(f"--scheduler {scheduler}: its workers have auvid {found}; expected {__version__}")
        yield client


def _local_cluster(workers: int | None) -> LocalCluster:
    try:
        with starting_children():
            return LocalCluster(
                n_workers=workers or os.cpu_count(),
                threads_per_worker=1,
                # Any free port, reachable from this machine only.
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )
    # Dask raises these if a process ends while it starts.
    except (RuntimeError, OSError) as error:
        raise ClusterError(
            f"the workers on this machine do not start ({error}); if memory is short, use fewer: --workers 1"
        ) from error


def n_threads(client: Client) -> int:
    """Return the number of runs at the same time."""
    return sum(client.nthreads().values())  # pyright: ignore[reportAttributeAccessIssue]


def _version() -> str:
    return __version__


def run_groups(client: Client, groups: Iterator[RunGroup], with_estimates: bool) -> Iterator[list[RunResult]]:
    """Yield the results of groups, in the order in which they finish.

    A group whose worker dies is repeated by another worker, and fails if several workers die.

    Raises
    ------
    ClusterError
        If the scheduler is gone.
    """
    sent: dict[Future, RunGroup] = {}
    returning = as_completed()

    def send() -> None:
        try:
            threads = n_threads(client)
        except OSError as error:
            raise ClusterError(f"{_GONE}: {error}") from None
        while len(sent) < _GROUPS_PER_THREAD * max(threads, 1):
            group = next(groups, None)
            if group is None:
                return
            # A unique name, because another campaign on this scheduler may have the same runs.
            future = client.submit(run_group, group, with_estimates, pure=False)
            sent[future] = group
            returning.add(future)

    send()
    for future in returning:
        group = sent.pop(future)
        if future.cancelled():
            raise ClusterError(_GONE)
        error = future.exception()
        if error is None:
            yield future.result()
        else:
            reason = f"{type(error).__name__}: {error}"
            yield [RunResult(run, [], reason, None) for run in group.runs]
        send()
