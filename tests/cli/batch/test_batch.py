"""Many runs at once: the same results as one by one, failures reported and kept apart."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import pytest

from tests.conftest import FIXTURES

ROTCLI = [sys.executable, "-m", "rotcli"]


@pytest.fixture
def runs(tmp_path):
    """Three runs and one that is broken, in a tree."""
    for name in ("b", "a", "deep/c"):
        shutil.copytree(FIXTURES / "nav440_rate_60", tmp_path / "runs" / name)
    (tmp_path / "runs" / "a2").mkdir()
    (tmp_path / "runs" / "a2" / "imu.csv").write_text("time,gyro_x\n0,1\n")
    return tmp_path / "runs"


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_batch_equals_its_runs_one_by_one_and_keeps_failures_apart(rotcli, runs, jobs):
    outcome = rotcli("calibrate", "--batch", runs, "--jobs", jobs)
    assert outcome.status == 1
    assert outcome.out == ""
    error, summary = outcome.err.splitlines()
    missing = "no table.parquet or table.csv in its folder; add it"
    assert error == f"rotcli: error: {runs}/a2/imu.csv: {missing}"
    assert summary == "rotcli: error: 1 of 4 runs failed; the other 3 are done"
    alone = runs.parent / "alone.json"
    for name in ("a", "b", "deep/c"):
        folder = runs / name
        logs = folder / "imu.parquet", folder / "table.parquet"
        assert rotcli("calibrate", *logs, "-o", alone).status == 0
        assert (folder / "calibration.json").read_bytes() == alone.read_bytes()


def test_navigate_takes_each_run_s_calibration_and_writes_below_o(rotcli, runs):
    shutil.rmtree(runs / "a2")
    assert rotcli("calibrate", "--batch", runs, "--quiet").status == 0
    out = runs.parent / "out"
    modes = ("--mode", "partial", "--mode", "full", "--solution", "{mode}.parquet")
    done = rotcli("navigate", "--batch", f"{runs}/*", "-o", out, "--jobs", 2, *modes)
    assert done == (0, "", "rotcli: 2 runs done\n")
    for name in "ab":
        for mode in ("partial", "full"):
            doc = json.loads((out / name / f"navigation-{mode}.json").read_text())
            assert doc["mode"] == mode
            assert doc["inputs"][0]["path"] == str(runs / name / "imu.parquet")
            assert (out / name / f"{mode}.parquet").is_file()


def test_a_run_without_the_calibration_it_needs_says_so(rotcli, runs):
    outcome = rotcli("navigate", "--batch", f"{runs}/b", "--mode", "full")
    assert outcome.status == 1
    assert f"{runs}/b/imu.parquet: no calibration.json in its folder" in outcome.err


def test_a_fault_of_ours_costs_one_run_only(rotcli, runs, monkeypatch):
    from rotcli.cli.measure import calibrate

    real = calibrate.process_run

    def faulty(imu, table, given):
        if "deep" in imu:
            raise ZeroDivisionError("oops")
        return real(imu, table, given)

    monkeypatch.setattr(calibrate, "process_run", faulty)
    outcome = rotcli("calibrate", "--batch", runs, "--jobs", 1)
    assert f"{runs}/deep/c/imu.parquet: unexpected ZeroDivisionError: oops" in outcome.err
    assert "2 of 4 runs failed; the other 2 are done" in outcome.err


@pytest.mark.parametrize(
    ("args", "said", "status"),
    [
        (("--batch", "nowhere"), "nowhere: no run found", 1),
        (("a.csv", "--batch", "x"), "omit IMU_LOG", 2),
        (("--batch", "x", "-o", "-"), "use a folder", 2),
        ((), "Missing argument 'IMU_LOG'", 2),
    ],
)
def test_what_cannot_be_meant_is_refused(rotcli, args, said, status):
    outcome = rotcli("navigate", *args)
    assert outcome.status == status
    assert said in outcome.err


def test_two_logs_that_could_each_be_the_run_are_refused(rotcli, runs):
    (runs / "a" / "imu.csv").write_text("time\n")
    outcome = rotcli("calibrate", "--batch", runs)
    assert outcome.status == 1
    assert f"{runs}/a: imu.parquet and imu.csv both exist; remove one of them" in outcome.err
    assert not list(runs.rglob("calibration.json"))


def test_an_interrupt_ends_the_batch_cleanly(runs):
    for k in range(60):
        shutil.copytree(runs / "a", runs / f"x{k:02d}")
    command = [*ROTCLI, "calibrate", "--batch", str(runs), "--jobs", "2"]
    process = subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # Tests that run in the background inherit an ignored SIGINT.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    limit = time.monotonic() + 20
    while not list(runs.glob("*/calibration.json")) and time.monotonic() < limit:
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGINT)  # as Ctrl-C on a terminal does
    _, err = process.communicate(timeout=20)
    assert process.returncode == 130, err
    assert err.strip() == "rotcli: interrupted; no partial files remain"
    assert not list(runs.rglob("*.part"))
    assert len(list(runs.rglob("calibration.json"))) < 60


def test_without_dask_the_scheduler_option_says_what_to_install(rotcli, runs, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    outcome = rotcli("calibrate", "--batch", runs, "--scheduler", "tcp://localhost:1")
    assert outcome.status == 1
    assert "--scheduler needs Dask: pip install rotcli[dask]" in outcome.err


@pytest.mark.campaign  # six seconds: three processes import Dask
@pytest.mark.filterwarnings("default")  # Dask's own
def test_a_dask_cluster_whose_worker_is_killed_loses_nothing_and_doubles_nothing(runs):
    import distributed

    shutil.rmtree(runs / "a2")
    for k in range(40):
        shutil.copytree(runs / "a", runs / f"x{k:02d}")
    count = 43
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        command = [*ROTCLI, "calibrate", "--batch", str(runs), "--scheduler"]
        process = subprocess.Popen(
            [*command, cluster.scheduler_address], stderr=subprocess.PIPE, text=True
        )
        limit = time.monotonic() + 40
        while not list(runs.rglob("calibration.json")) and time.monotonic() < limit:
            time.sleep(0.005)
        os.kill(cluster.workers[0].pid, signal.SIGKILL)
        done_before = len(list(runs.rglob("calibration.json")))
        _, err = process.communicate(timeout=60)
    assert 0 < done_before < count
    assert process.returncode == 0, err
    assert err.splitlines()[-1] == f"rotcli: {count} runs done"
    results = sorted(runs.rglob("calibration.json"))
    assert len(results) == count
    assert not list(runs.rglob("*.part"))
    bodies = set()
    for path in results:
        doc = json.loads(path.read_text())
        bodies.add(json.dumps(doc["parameters"]))
    assert len(bodies) == 1  # the same log gives the same figures, in any process
