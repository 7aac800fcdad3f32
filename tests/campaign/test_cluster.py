"""Whatever happens to workers, each run is there once."""

import multiprocessing
import os
import shutil
import subprocess
import sys
import time
from functools import partial
from itertools import islice

import dask.config
import psutil
import pytest
from distributed import LocalCluster

from auvid_cli.campaign.cluster import Cluster, dask_cluster, local_cluster, run_groups
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


def campaign_into(folder, campaign, *options):
    command = [sys.executable, "-m", "auvid_cli", "campaign", str(campaign), "--output", str(folder), *options]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def wait_for(condition):
    deadline = time.monotonic() + 120.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.slow
def test_command_gives_the_same_results_if_workers_with_own_folders_are_killed_in_turn(tmp_path):
    campaign, killed, alone = tmp_path / "many.yaml", tmp_path / "killed", tmp_path / "alone"
    campaign.write_text(MANY, encoding="utf-8")
    started = []
    dask = LocalCluster(n_workers=0, processes=False, protocol="tcp://", dashboard_address="127.0.0.1:0")

    def worker(number):
        folder = tmp_path / f"worker {number}"
        folder.mkdir()
        own = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(folder)]
        command = [sys.executable, "-m", "dask", "worker", dask.scheduler_address, *own]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        started.append(subprocess.Popen(command, cwd=folder, **quiet))

    try:
        for number in range(3):
            worker(number)
        with dask:
            dask.wait_for_workers(3, timeout=60)
            command = campaign_into(killed, campaign, "--scheduler", dask.scheduler_address)
            for number in range(3):
                wait_for(lambda number=number: len(list(killed.glob("incoming/*"))) > number)
                assert command.poll() is None, "runs remain when the worker is killed"
                assert started[number].poll() is None, "the worker is alive until it is killed"
                started[number].kill()
                if number == 0:
                    # Replaced once, as by a queue of jobs: in the end none of the first three is left.
                    worker(3)
            assert command.wait(timeout=120) == 0
    finally:
        for process in started:
            process.kill()
            process.wait()
    assert campaign_into(alone, campaign, "--workers", "1").wait(timeout=120) == 0
    for name in ("coefficients.csv", "comparisons.csv"):
        assert (killed / "tables" / name).read_bytes() == (alone / "tables" / name).read_bytes()
    assert len((killed / "tables" / "runs.csv").read_text(encoding="utf-8").splitlines()) == 1 + 2 * 16


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
