"""Whatever happens to workers, each run is there once."""

import os
import signal
from itertools import islice

import dask.config
import pytest
from distributed import LocalCluster

from auvid_cli.campaign.cluster import cluster_client, run_groups
from auvid_cli.campaign.plan import RunGroup
from auvid_cli.errors import ClusterError

MANY = """\
name: many
settings: {manoeuvre.duration: 10 s, sensors.attitude.source: direct, identification.judge: false}
seeds: 16
filters: [ckf, tukf]
"""


def test_existing_scheduler_returns_all_runs(planned):
    plan = planned(MANY, "seeds=4")
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0") as cluster,
        cluster_client(cluster.scheduler_address, 1) as client,
    ):
        runs = [done for group in run_groups(client, plan.groups(), False) for done in group]
    assert sorted(done.run.identity for done in runs) == sorted(plan.labels())
    assert {done.failure for done in runs} == {""}


def test_worker_that_dies_at_start_is_cluster_error(monkeypatch):
    def cluster(**options):
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr("auvid_cli.campaign.cluster.LocalCluster", cluster)
    with pytest.raises(ClusterError, match=r"workers on this machine do not start.*--workers 1"):
        cluster_client(None, 1).__enter__()


@pytest.mark.slow
def test_killed_worker_loses_and_repeats_no_run(planned):
    plan, performed = planned(MANY), []
    with cluster_client(None, 2) as client:
        victim, _ = client.run(os.getpid).values()
        for number, group in enumerate(run_groups(client, plan.groups(), False)):
            performed += group
            if number == 4:
                os.kill(victim, signal.SIGKILL)
    assert sorted(done.run.identity for done in performed) == sorted(plan.labels())
    assert {done.failure for done in performed} == {""}


def test_group_that_kills_workers_fails_and_others_go_on(planned):
    plan = planned(MANY, "seeds=3")
    groups = list(plan.groups())
    # Text that no worker can read: it fails in the worker's own code, not in a run.
    broken = [groups[0], RunGroup(7, groups[1].runs, groups[1].assumed), groups[2]]
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0") as cluster,
        cluster_client(cluster.scheduler_address, 1) as client,
    ):
        runs = [done for group in run_groups(client, iter(broken), False) for done in group]
    assert len(runs) == 6
    assert sum(bool(done.failure) for done in runs) == 2


def test_few_groups_wait_at_the_scheduler(planned):
    plan, taken = planned(MANY, "seeds=200"), []

    def watched():
        for group in plan.groups():
            taken.append(group)
            yield group

    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0") as cluster,
        cluster_client(cluster.scheduler_address, 1) as client,
    ):
        for count, _ in enumerate(islice(run_groups(client, watched(), False), 5), 1):
            assert len(taken) <= count + 3


@pytest.mark.slow
def test_silent_scheduler_is_cluster_error():
    with (
        pytest.raises(ClusterError, match=r"--scheduler tcp://127\.0\.0\.1:9: no scheduler"),
        cluster_client("tcp://127.0.0.1:9", 1, start_time=1.0),
    ):
        pass


@pytest.mark.slow
def test_lost_scheduler_is_cluster_error_after_finished_runs(planned):
    plan, came = planned(MANY, "seeds=100"), []
    cluster = LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0")

    def work_until_it_goes(client) -> None:
        for group in run_groups(client, plan.groups(), False):
            came.extend(group)
            if len(came) == 4:
                cluster.close()

    with (
        dask.config.set({"distributed.comm.timeouts.connect": "1 s"}),
        cluster_client(cluster.scheduler_address, 1, start_time=4.0) as client,
        pytest.raises(ClusterError, match="scheduler is gone"),
    ):
        work_until_it_goes(client)
    assert 4 <= len(came) < plan.n_runs
