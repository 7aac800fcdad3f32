"""Whatever happens to workers, each run is there once."""

import multiprocessing
import os
import shutil
import subprocess
import sys
from functools import partial
from itertools import islice

import dask.config
import psutil
import pytest
from distributed import LocalCluster

from auvid_cli.campaign.cluster import Cluster, dask_cluster, local_cluster, run_group, run_groups
from auvid_cli.child_processes import Workers
from auvid_cli.errors import ClusterError

MANY = """\
name: many
settings: {manoeuvre.duration: 10 s, sensors.attitude.source: direct, identification.judge: false}
seeds: 16
filters: [ckf, tukf]
"""


@pytest.mark.slow
def test_existing_scheduler_returns_all_runs(planned):
    plan = planned(MANY, "seeds=4")
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0") as dask,
        dask_cluster(dask.scheduler_address) as cluster,
    ):
        runs = [done for group in run_groups(cluster, plan.groups(), False) for done in group]
    assert sorted(done.run.identity for done in runs) == sorted(plan.labels())
    assert {done.failure for done in runs} == {""}


@pytest.mark.slow
def test_worker_that_dies_at_start_is_cluster_error(monkeypatch):
    monkeypatch.setattr("auvid_cli.campaign.cluster.installed_version", partial(os._exit, 1))
    with pytest.raises(ClusterError, match=r"workers .*do not start.*--workers 1"), local_cluster(1):
        pass


@pytest.mark.slow
def test_killed_worker_loses_and_repeats_no_run_and_none_listens(planned):
    plan, performed = planned(MANY, "seeds=8"), []
    with local_cluster(2) as cluster:
        if sys.platform == "linux":
            processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
            assert len(processes) > 2
            listening = [c for process in processes for c in process.net_connections() if c.status == "LISTEN"]
            assert not listening, "workers on this machine open no port"
        for number, group in enumerate(run_groups(cluster, plan.groups(), False)):
            performed += group
            if number == 2:
                multiprocessing.active_children()[0].kill()
    assert sorted(done.run.identity for done in performed) == sorted(plan.labels())
    assert {done.failure for done in performed} == {""}


@pytest.mark.slow
def test_workers_with_own_folders_killed_in_turn_give_the_same_runs(planned, tmp_path):
    plan, performed, started = planned(MANY, "seeds=8"), [], []
    dask = LocalCluster(n_workers=0, processes=False, protocol="tcp://", dashboard_address="127.0.0.1:0")

    def worker(number):
        folder = tmp_path / f"worker {number}"
        folder.mkdir()
        alone = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(folder)]
        command = [sys.executable, "-m", "dask", "worker", dask.scheduler_address, *alone]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        started.append(subprocess.Popen(command, cwd=folder, **quiet))

    try:
        for number in range(3):
            worker(number)
        dask.wait_for_workers(3, timeout=60)
        with dask, dask_cluster(dask.scheduler_address) as cluster:
            for number, group in enumerate(run_groups(cluster, plan.groups(), False)):
                performed += group
                if number < 3:
                    assert started[number].poll() is None, "the worker is alive until it is killed"
                    started[number].kill()
                if number == 0:
                    # Replaced once, as by a queue of jobs: in the end none of the first three is left.
                    worker(3)
    finally:
        for process in started:
            process.kill()
            process.wait()
    expected = [done for group in plan.groups() for done in run_group(group)]

    def measured(runs):
        return {done.run.identity: [without_time(row) for row in done.rows] for done in runs}

    def without_time(row):
        return row._replace(processor_time=None, wall_time=None)

    assert len(performed) == len(expected)
    assert {done.failure for done in performed} == {""}
    assert measured(performed) == measured(expected)


class Deadly:
    """Ends the process that unpickles it."""

    def __reduce__(self):
        return os._exit, (1,)


@pytest.mark.slow
def test_group_that_kills_workers_fails_and_others_go_on(planned):
    groups = list(planned(MANY, "seeds=3").groups())
    groups[1] = groups[1]._replace(simulated=Deadly())
    with Workers(1, "spawn") as executor:
        results = [done for group in run_groups(Cluster(executor, lambda: 1), iter(groups), False) for done in group]
    assert sorted(done.run.identity for done in results) == sorted(
        run.identity for group in groups for run in group.runs
    )
    failed = {done.run.identity: done.failure for done in results if done.failure}
    assert failed.keys() == {run.identity for run in groups[1].runs}
    assert all("WorkerDied" in failure for failure in failed.values())


@pytest.mark.slow
def test_few_groups_wait_at_the_scheduler(planned):
    plan, taken = planned(MANY, "seeds=200"), []

    def watched():
        for group in plan.groups():
            taken.append(group)
            yield group

    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0") as dask,
        dask_cluster(dask.scheduler_address) as cluster,
    ):
        for count, _ in enumerate(islice(run_groups(cluster, watched(), False), 5), 1):
            assert len(taken) <= count + 3


@pytest.mark.slow
def test_silent_scheduler_is_cluster_error():
    with (
        pytest.raises(ClusterError, match=r"--scheduler tcp://127\.0\.0\.1:9: no scheduler"),
        dask_cluster("tcp://127.0.0.1:9", start_time=1.0),
    ):
        pass


@pytest.mark.slow
def test_lost_scheduler_is_cluster_error_after_finished_runs(planned):
    plan, came = planned(MANY, "seeds=100"), []
    local = LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0")

    def work_until_it_goes(cluster) -> None:
        for group in run_groups(cluster, plan.groups(), False):
            came.extend(group)
            if len(came) == 4:
                local.close()

    with (
        dask.config.set({"distributed.comm.timeouts.connect": "1 s"}),
        dask_cluster(local.scheduler_address, start_time=4.0) as cluster,
        pytest.raises(ClusterError, match="scheduler is gone"),
    ):
        work_until_it_goes(cluster)
    assert 4 <= len(came) < plan.n_runs


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("openssl") is None, reason="makes a certificate by openssl")
def test_scheduler_with_tls_refuses_clients_without_certificate(planned, tmp_path):
    key, certificate = str(tmp_path / "key.pem"), str(tmp_path / "cert.pem")
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=auvid"]
    subprocess.run([*command, "-keyout", key, "-out", certificate], check=True, capture_output=True)
    settings = {"distributed.comm.require-encryption": True, "distributed.comm.tls.ca-file": certificate}
    for role in ("client", "scheduler", "worker"):
        settings |= {f"distributed.comm.tls.{role}.cert": certificate, f"distributed.comm.tls.{role}.key": key}
    plan = planned(MANY, "seeds=1")
    with dask.config.set(settings):
        local = LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, protocol="tls://", dashboard_address=":0"
        )
        with local, dask_cluster(local.scheduler_address) as cluster:
            runs = [done for group in run_groups(cluster, plan.groups(), False) for done in group]
            assert {done.failure for done in runs} == {""}
            with (
                dask.config.set({"distributed.comm.tls.client.cert": None, "distributed.comm.tls.client.key": None}),
                pytest.raises(ClusterError, match="no scheduler"),
                dask_cluster(local.scheduler_address, start_time=4.0),
            ):
                pass
