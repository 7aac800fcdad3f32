"""Run a campaign on many workers: each simulates data, runs filters on them and measures the results."""

import json
import logging
import traceback
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, as_completed
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import lru_cache
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from auvid_cli._version import __version__
from auvid_cli.campaign.measures import Measure, measures
from auvid_cli.campaign.plan import CampaignRun, RunGroup
from auvid_cli.child_processes import WorkerDied, Workers
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
from auvid_cli.fitting.search import FitLimits, fit_model
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify
from auvid_cli.simulation.simulate import simulate

if TYPE_CHECKING:
    from distributed import Client

# Identification settings that the Cramer-Rao bound depends on.
_BOUND_SETTINGS = {"coefficients", "attitude_from", "use", "estimate", "integration_step", "inputs", "delays"}
# Number of groups that wait for each worker, so that no worker is idle.
_GROUPS_PER_WORKER = 3
# Number of workers that may die in one group of runs before the group fails.
_ATTEMPTS = 4
START_TIME = 60.0  # s
_GONE = "the scheduler is gone; finished runs are kept, and the same command continues with a new scheduler"


class Cluster(NamedTuple):
    """Workers that call functions, and their current number."""

    executor: Executor
    n_workers: Callable[[], int]


class RunResult(NamedTuple):
    """Outcome of a run."""

    run: CampaignRun
    rows: list[Measure]  # empty if the run failed
    failure: str  # reason; empty if the run did not fail
    estimate: Estimate | None  # only with `with_estimates`


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
        return [_run_one(group.simulated, run, assumed, with_estimates) for run, assumed in pairs]


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


def _run_one(simulated: str, run: CampaignRun, assumed_text: str, with_estimates: bool) -> RunResult:
    try:
        dataset = _data(simulated)
        assert dataset.truth is not None
        assumed = Experiment.model_validate_json(assumed_text)
        (name,) = assumed.identification.filters
        data, additions = _as_assumed(dataset, assumed), None
        reference = None if run.is_fit else _reference(simulated, _judging(assumed))
        if run.is_fit:
            fit = fit_model(replace(data, truth=None), FitLimits())
            estimate = replace(fit.estimate, cpu_time=sum(step.cpu_time for step in fit.steps))
            assumed, additions = fit.experiment, "; ".join(fit.added)
        elif reference is not None and name is JUDGE:
            estimate = reference
        else:
            estimate = identify(data, name)
        estimated = assumed.identification.estimated(assumed.vehicle)
        settings = assumed.identification.model_copy(update={"coefficients": estimated})
        identification = settings.model_dump_json(include=_BOUND_SETTINGS, exclude_none=True)
        vehicle = assumed.vehicle.model_dump_json(include={"terms", "actuators"}, exclude_none=True)
        bounds = _bounds(simulated, identification, vehicle)
        judgement = judge_one(estimate, reference)
        rows = measures(run.identity, run.filter, run.seed, estimate, dataset.truth, bounds, judgement, additions)
    except AuvidError as error:
        return RunResult(run, [], str(error), None)
    except Exception as error:
        # The campaign continues, so the message must name the place of the error.
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
    """Return the experiment of the judge of a filter as JSON; empty if the filter has no judge."""
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
    data = dataset.with_settings(dataset.experiment.model_copy(update=changes))
    return bounds_at(prepare(data), data.known_coefficients()).of_data


@contextmanager
def local_cluster(workers: int) -> Iterator[Cluster]:
    """Start worker processes on this machine, which end with the block.

    Raises
    ------
    ClusterError
        If they do not start.
    """
    with Workers(workers, attempts=_ATTEMPTS) as executor:
        try:
            for started in [executor.submit(installed_version) for _ in range(workers)]:
                started.result()
        except (WorkerDied, MemoryError) as error:
            raise ClusterError(
                f"the workers on this machine do not start ({error}); if memory is short, use fewer: --workers 1"
            ) from error
        yield Cluster(executor, lambda: workers)


@contextmanager
def dask_client(scheduler: str, start_time: float = START_TIME) -> "Iterator[Client]":
    """Connect to a Dask scheduler.

    Parameters
    ----------
    scheduler : str
        Address, such as tls://10.0.0.1:8786; the certificates of TLS are in the configuration of Dask.
    start_time : float
        Longest time to wait for scheduler and workers, s.

    Raises
    ------
    ClusterError
        If the scheduler does not answer, or has no workers with this version of auvid.
    """
    # Imported here because it takes a second, and a campaign on this machine does not need it.
    from distributed import Client

    # Silence the log of Dask: its errors become a ClusterError in one line.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with ExitStack() as stack:
        try:
            client = stack.enter_context(Client(scheduler, timeout=start_time / 2))
            client.wait_for_workers(1, timeout=start_time)
            versions = set(client.run(installed_version).values())  # pyright: ignore[reportAttributeAccessIssue]
        except ModuleNotFoundError as error:
            raise ClusterError(f"--scheduler {scheduler}: its workers have no auvid: {error}") from None
        except (OSError, TimeoutError, TypeError, ValueError) as error:
            raise ClusterError(f"--scheduler {scheduler}: no scheduler with workers answers there: {error}") from None
        if versions != {__version__}:
            found = ", ".join(sorted(versions))
            raise ClusterError(f"--scheduler {scheduler}: its workers have auvid {found}; expected {__version__}")
        yield client


@contextmanager
def dask_cluster(scheduler: str, start_time: float = START_TIME) -> Iterator[Cluster]:
    """Connect to the workers of a Dask scheduler; arguments and errors as those of `dask_client`."""
    with dask_client(scheduler, start_time) as client:

        def n_workers() -> int:
            try:
                return sum(client.nthreads().values())  # pyright: ignore[reportAttributeAccessIssue]
            except OSError as error:
                raise ClusterError(f"{_GONE}: {error}") from None

        # A unique name for each call, because another campaign on this scheduler may have the same runs.
        yield Cluster(client.get_executor(pure=False), n_workers)


def installed_version() -> str:
    """Return the version of auvid in this process."""
    return __version__


def run_groups(cluster: Cluster, groups: Iterator[RunGroup], with_estimates: bool) -> Iterator[list[RunResult]]:
    """Yield the results of groups, in the order in which they finish.

    A group whose worker dies is repeated by another worker, and fails if several workers die.

    Raises
    ------
    ClusterError
        If the scheduler is gone.
    """
    sent: dict[Future[list[RunResult]], RunGroup] = {}
    while True:
        room = _GROUPS_PER_WORKER * max(cluster.n_workers(), 1) - len(sent)
        for group in islice(groups, max(room, 0)):
            sent[cluster.executor.submit(run_group, group, with_estimates)] = group
        if not sent:
            return
        future = next(as_completed(sent))
        group = sent.pop(future)
        if future.cancelled():
            raise ClusterError(_GONE)
        error = future.exception()
        if error is None:
            yield future.result()
        else:
            reason = f"{type(error).__name__}: {error}"
            yield [RunResult(run, [], reason, None) for run in group.runs]
