"""Run a campaign on a Dask cluster: one worker task simulates, identifies and measures."""

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
from auvid_cli.config.enums import JUDGE
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.identification import Identification, Use
from auvid_cli.config.loading import given_settings
from auvid_cli.config.terms import Term
from auvid_cli.config.vehicle import ActuatorSettings
from auvid_cli.data.dataset import Dataset, TruthRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import AuvidError, ClusterError, ConfigError, DataError
from auvid_cli.evaluation.bounds import bounds_at
from auvid_cli.evaluation.judgement import judge_one
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify
from auvid_cli.simulation.simulate import simulate

# What of the settings of a filter its bound depends on.
_OF_THE_DATA = {
    *("coefficients", "attitude_from", "use", "estimate", "integration_step"),
    *("inputs", "delays"),
}
# Groups that wait at the scheduler for each thread: no worker is ever idle, and no more is handed out than that.
_AHEAD = 3
_PATIENCE = 60.0
# Nobody looks at profiles of these workers, and sampling takes time from the runs; so does asking 50 times a second
# whether all is well, and memory that is given back to the system after each array, as Dask would have it. What is left
# of its environment is one thread for each library.
_UNDISTURBED = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.admin.tick.interval": "1s",
    # Also of a worker that takes the place of one that was killed.
    "distributed.nanny.pre-spawn-environ": SAFE_PATH
    | {"OMP_NUM_THREADS": 1, "MKL_NUM_THREADS": 1, "OPENBLAS_NUM_THREADS": 1},
}
_GONE = "the scheduler is gone; what was done is kept, and the same command goes on once there is one again"


class RunResult(NamedTuple):
    """Outcome of a run.

    Attributes
    ----------
    run : CampaignRun
    rows : list of Measure
        None of a run that failed.
    failure : str
        Why it failed; empty if it did not.
    estimate : Estimate or None
        Only if it was asked for.
    """

    run: CampaignRun
    rows: list[Measure]
    failure: str
    estimate: Estimate | None


def run_group(group: RunGroup, with_estimates: bool = False) -> list[RunResult]:
    """Do all runs of a group, on one core; what goes wrong with one is its failure and does not end the others.

    Raises
    ------
    ConfigError
        If this is another version of auvid than the one that made the group.
    """
    if group.version != __version__:
        raise ConfigError(f"the worker has auvid {__version__}, the campaign is of auvid {group.version}")
    with threadpool_limits(1):
        pairs = zip(group.runs, group.assumed, strict=True)
        return [_perform(group.simulated, run, assumed, with_estimates) for run, assumed in pairs]


def shortened_group(group: RunGroup, duration: float) -> tuple[RunGroup, float]:
    """Cut a group to the beginning of its data, s, all of which counts; say what share of its data that is."""
    whole = Experiment.model_validate_json(group.simulated).manoeuvre.duration
    part = min(duration, whole)

    def cut(text: str) -> str:
        experiment = Experiment.model_validate_json(text)
        manoeuvre = experiment.manoeuvre.model_copy(update={"duration": part})
        identification = experiment.identification.model_copy(update={"use": Use()})
        changes = {"manoeuvre": manoeuvre, "identification": identification}
        return json.dumps(given_settings(experiment.model_copy(update=changes)))

    return group._replace(simulated=cut(group.simulated), assumed=[cut(text) for text in group.assumed]), part / whole


def _perform(simulated: str, run: CampaignRun, given: str, with_estimates: bool) -> RunResult:
    try:
        dataset = _data(simulated)
        assumed = Experiment.model_validate_json(given)
        (name,) = assumed.identification.filters
        reference = _reference(simulated, _judging(assumed))
        if reference is not None and name is JUDGE:
            estimate = reference
        else:
            estimate = identify(_as_assumed(dataset, assumed), name)
        estimated = assumed.identification.estimated(assumed.vehicle)
        settings = assumed.identification.model_copy(update={"coefficients": estimated})
        of_data = settings.model_dump_json(include=_OF_THE_DATA, exclude_none=True)
        bounds = _bounds(
            simulated, of_data, assumed.vehicle.model_dump_json(include={"terms", "actuators"}, exclude_none=True)
        )
        judgement = judge_one(estimate, reference)
        rows = measures(run.identity, run.filter, run.seed, estimate, _truth(dataset), bounds, judgement)
    except AuvidError as error:
        return RunResult(run, [], str(error), None)
    except Exception as error:
        # A campaign goes on; the failure is named with its place, and counted.
        place = traceback.extract_tb(error.__traceback__)[-1]
        return RunResult(run, [], f"{type(error).__name__}: {error} ({place.name}, line {place.lineno})", None)
    return RunResult(run, rows, "", estimate if with_estimates else None)


# Groups with the same data come one after the other, and several workers take turns.
@lru_cache(maxsize=2)
def _data(simulated: str) -> Dataset:
    return simulate(Experiment.model_validate_json(simulated))


def _as_assumed(dataset: Dataset, assumed: Experiment) -> Dataset:
    """Return the data with the settings that a filter assumes, the noise of the sensors included."""
    records = {
        name: replace(record, standard_deviation=np.array(getattr(assumed.sensors, name).stated_standard_deviation()))
        for name, record in dataset.sensors.items()
    }
    return replace(dataset, sensors=records, experiment=assumed)


def _judging(assumed: Experiment) -> str:
    """Return the experiment that fits the judge of a filter; empty if nobody is to judge it."""
    settings = assumed.identification
    if JUDGE not in settings.with_judge(settings.filters):
        return ""
    judge = settings.of_filter(JUDGE)
    return json.dumps(given_settings(assumed.model_copy(update={"identification": judge})))


# The filters of a group's data that assume the same share their judge, which may be one of them.
@lru_cache(maxsize=4)
def _reference(simulated: str, given: str) -> Estimate | None:
    if not given:
        return None
    return identify(_as_assumed(_data(simulated), Experiment.model_validate_json(given)), JUDGE)


def _truth(dataset: Dataset) -> TruthRecord:
    if dataset.truth is None:
        raise DataError("simulated data without truth")
    return dataset.truth


@lru_cache(maxsize=8)
def _bounds(simulated: str, identification: str, assumed: str) -> Mapping[str, float]:
    """Return Cramer-Rao bounds at the truth, by symbol; empty where there are none.

    Parameters
    ----------
    simulated : str
        Experiment that makes the data.
    identification : str
        What is estimated from which part of them.
    assumed : str
        Terms that may be among it, and of which those that the simulation does not have are truly zero; and actuators.
    """
    dataset = _data(simulated)
    vehicle = dataset.experiment.vehicle
    of_vehicle = json.loads(assumed)
    of_filter = (Term.model_validate(term) for term in of_vehicle["terms"])
    actuators = ActuatorSettings.model_validate(of_vehicle["actuators"])
    beyond = tuple(term for term in of_filter if term.name not in vehicle.coefficient_set.symbols)
    vehicle = vehicle.model_copy(update={"terms": (*vehicle.terms, *beyond), "actuators": actuators})
    settings = Identification.model_validate_json(identification, context=vehicle.coefficient_set)
    changes = {"identification": settings, "vehicle": vehicle}
    data = replace(dataset, experiment=dataset.experiment.model_copy(update=changes))
    return bounds_at(prepare(data), data.known_coefficients()).of_data


@contextmanager
def cluster_client(scheduler: str | None, workers: int | None) -> Iterator[Client]:
    """Connect to an existing scheduler, or to a cluster on this machine that ends with the block.

    Parameters
    ----------
    scheduler : str or None
        Address, such as tcp://10.0.0.1:8786.
    workers : int or None
        Processes of one thread each on this machine; None for one for each core.

    Raises
    ------
    ClusterError
        If the scheduler does not answer, or has no workers with this version of auvid.
    """
    # What matters is said here in one line.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with ExitStack() as stack:
        if scheduler is None:
            stack.enter_context(dask.config.set(_UNDISTURBED))
            target = stack.enter_context(_local_cluster(workers))
        else:
            target = scheduler
        try:
            client = stack.enter_context(Client(target, timeout=_PATIENCE / 2))
            client.wait_for_workers(1, timeout=_PATIENCE)
            versions = set(client.run(_version).values())  # pyright: ignore[reportAttributeAccessIssue]
        except ModuleNotFoundError as error:
            raise ClusterError(f"--scheduler {scheduler}: its workers have no auvid: {error}") from None
        except (OSError, TimeoutError, ValueError) as error:
            if scheduler is None:
                raise ClusterError(f"the workers on this machine do not start: {error}") from None
            raise ClusterError(f"--scheduler {scheduler}: no scheduler with workers answers there: {error}") from None
        if versions != {__version__}:
            theirs = ", ".join(sorted(versions))
            raise ClusterError(f"--scheduler {scheduler}: its workers have auvid {theirs}, this is {__version__}")
        yield client


def _local_cluster(workers: int | None) -> LocalCluster:
    try:
        with starting_children():
            return LocalCluster(
                n_workers=workers or os.cpu_count(),
                threads_per_worker=1,
                # Any port, and only for this machine.
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )
    # What Dask makes of a process that ends before it has said that it is there.
    except (RuntimeError, OSError) as error:
        raise ClusterError(
            f"the workers on this machine do not start, perhaps for want of memory ({error}); fewer may: --workers 1"
        ) from error


def n_threads(client: Client) -> int:
    """Say how many runs are done at once."""
    return sum(client.nthreads().values())  # pyright: ignore[reportAttributeAccessIssue]


def _version() -> str:
    return __version__


def run_groups(client: Client, groups: Iterator[RunGroup], with_estimates: bool) -> Iterator[list[RunResult]]:
    """Hand groups out and yield what comes back, as it comes.

    A group whose worker dies goes to another one; one that takes several workers with it has failed.

    Raises
    ------
    ClusterError
        If the scheduler goes away.
    """
    sent: dict[Future, RunGroup] = {}
    returning = as_completed()

    def send() -> None:
        try:
            threads = n_threads(client)
        except OSError as error:
            raise ClusterError(f"{_GONE}: {error}") from None
        while len(sent) < _AHEAD * max(threads, 1):
            group = next(groups, None)
            if group is None:
                return
            # A name of its own each: another campaign on this scheduler may ask for the same runs, with others.
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
