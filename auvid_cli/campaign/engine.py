"""Groups of runs on the workers of a Dask cluster."""

import logging
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import dask.config
from distributed import Client, Future, LocalCluster, as_completed

from auvid_cli import __version__
from auvid_cli.campaign.perform import Performed, perform
from auvid_cli.campaign.plan import RunGroup
from auvid_cli.child_processes import SAFE_PATH, starting_children
from auvid_cli.errors import ClusterError

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


def perform_groups(client: Client, groups: Iterator[RunGroup], with_estimates: bool) -> Iterator[list[Performed]]:
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
            future = client.submit(perform, group, with_estimates, pure=False)
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
            yield [Performed(run, [], reason, None) for run in group.runs]
        send()
