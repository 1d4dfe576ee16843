"""Every command that takes a log runs a batch: results as one by one, in processes and on Dask."""

import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rotcli.cli.main import main

# Command: options, and the files of one run with the option that names each in a single run.
COMMANDS = {
    "allan": (["--axes", "gyro_x", "--taus", "decade"], ["allan.json"]),
    "calibrate": ([], ["calibration.json"]),
    "scale": ([], ["scale.json"]),
    "triad": (["--parameters", "N,d,b"], ["triad.json"]),
    "thermal": (["--order", "1,0", "--block", "5"], ["thermal.json"]),
    "navigate": ([], ["navigation.json"]),
    "observe": (["--window", "40:60"], ["observe.json"]),
    "correct": ([], ["imu.parquet"]),
    "convert": ([], ["imu.parquet", "table.parquet"]),
}
WITHOUT_TABLE = ("allan", "correct", "convert")


def _run(*args):
    with pytest.raises(SystemExit) as stop:
        main([str(arg) for arg in args])
    return stop.value.code


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two runs with a temperature column and a calibration each."""
    top = tmp_path_factory.mktemp("batch")
    for seed, name in enumerate(("a", "b")):
        legs = ("--static", 20, "--rotation", 20, "--navigation", 20)
        args = ("--imu", "nav440", "--rate", 30, *legs, "--seed", seed, "--quiet")
        assert _run("simulate", *args, "-o", top / name) == 0
        path = top / name / "imu.parquet"
        table = pq.read_table(path)
        ramp = pa.array(np.linspace(20.0, 40.0, len(table)))
        pq.write_table(table.append_column("temperature [degC]", ramp), path)
        logs = (path, top / name / "table.parquet")
        assert _run("calibrate", *logs, "-o", top / name / "calibration.json", "--quiet") == 0
    return top


def _alone(runs, command, target):
    """Write the files of run a by the command without --batch."""
    options, names = COMMANDS[command]
    target.mkdir()
    logs = [runs / "a" / "imu.parquet", runs / "a" / "table.parquet"]
    if command == "convert":
        for log in logs:
            assert _run(command, log, *options, "-o", target / log.name, "--quiet") == 0
        return
    given = logs[: 1 if command in WITHOUT_TABLE else 2]
    if command in ("navigate", "correct"):
        options = [*options, "--calibration", runs / "a" / "calibration.json"]
    assert _run(command, *given, *options, "-o", target / names[0], "--quiet") == 0


@pytest.mark.parametrize("command", COMMANDS)
def test_the_files_of_a_batch_are_those_of_each_run_alone(command, runs, tmp_path, capfd):
    options, names = COMMANDS[command]
    assert _run(command, "--batch", runs, *options, "--jobs", 1, "-o", tmp_path / "out") == 0
    assert "2 runs done" in capfd.readouterr().err
    _alone(runs, command, tmp_path / "alone")
    for name in names:
        assert (tmp_path / "out/a" / name).read_bytes() == (tmp_path / "alone" / name).read_bytes()
        assert (tmp_path / "out/b" / name).is_file()
    assert {p.name for p in (tmp_path / "out").rglob("*") if p.is_file()} == set(names)


def test_logs_next_to_batch_are_refused_by_every_command(runs, tmp_path, capfd):
    for command in COMMANDS:
        log = runs / "a" / "imu.parquet"
        assert _run(command, log, "--batch", runs, "-o", tmp_path / "out") == 2
        assert "--batch finds the logs itself" in capfd.readouterr().err


def test_what_belongs_to_one_run_is_refused(runs, tmp_path, capfd):
    for args, text in (
        (("allan", "--to-rig", "rig.toml"), "--to-rig"),
        (("triad", "--merge"), "--merge"),
        (("thermal", "--temperature-log", "t.csv"), "--temperature-log"),
        (("observe", "--plot", "/p.png"), "--plot"),
        (("scale", "--plot", "../p.png"), "--plot"),
    ):
        assert _run(*args, "--batch", runs, "-o", tmp_path / "out") == 2
        assert text in capfd.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", ["convert", "correct"])
def test_new_logs_do_not_replace_those_of_the_runs(command, runs, capfd):
    before = (runs / "a" / "imu.parquet").read_bytes()
    assert _run(command, "--batch", runs, "-o", runs) == 2
    assert "would replace the input" in capfd.readouterr().err
    assert (runs / "a" / "imu.parquet").read_bytes() == before


def test_warnings_of_new_logs_are_printed(runs, tmp_path, capfd):
    place = tmp_path / "gap"
    shutil.copytree(runs / "a", place / "a")
    log = pq.read_table(place / "a" / "imu.parquet")
    pq.write_table(pa.concat_tables([log[:3000], log[3003:]]), place / "a" / "imu.parquet")
    assert _run("correct", "--batch", place, "-o", tmp_path / "out") == 0
    err = capfd.readouterr().err
    assert "warning:" in err
    assert "gap" in err


def test_the_size_limit_applies_to_the_runs_of_a_batch(runs, tmp_path, capfd):
    options = ("--max-bytes", "10K", "--jobs", 2, "-o", tmp_path / "out")
    assert _run("calibrate", "--batch", runs, *options) == 1
    assert "--max-bytes" in capfd.readouterr().err
    assert not list((tmp_path / "out").rglob("*.json"))


@pytest.mark.filterwarnings("default")  # Dask's own
@pytest.mark.parametrize(
    "processes", [False, pytest.param(True, marks=pytest.mark.campaign)], ids=["thread", "process"]
)
def test_a_dask_cluster_runs_every_command(processes, runs, tmp_path, capfd):
    import distributed

    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=processes, dashboard_address=None
    ) as cluster:
        for command, (options, names) in COMMANDS.items():
            here, there = tmp_path / "here" / command, tmp_path / "there" / command
            args = (command, "--batch", runs, *options, "--quiet")
            assert _run(*args, "-o", there, "--scheduler", cluster.scheduler_address) == 0
            assert _run(*args, "-o", here, "--jobs", 1) == 0
            for name in names:
                assert (here / "b" / name).read_bytes() == (there / "b" / name).read_bytes()
    capfd.readouterr()
