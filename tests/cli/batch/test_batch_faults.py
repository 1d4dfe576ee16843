"""Faults of batches and streams: planted code, killed workers, closed streams, old drafts."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from tests.conftest import FIXTURES

ROOT = Path(__file__).parents[3]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
# As the installed script calls it: the working directory is not on the import path.
SCRIPT = [sys.executable, "-P", "-c", "from rotcli.__main__ import main; main()"]
MODULE = [sys.executable, "-m", "rotcli"]


def run(command, folder, *args, **more):
    return subprocess.run(
        [*command, *map(str, args)],
        cwd=folder,
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        **more,
    )


@pytest.fixture
def runs(tmp_path):
    """Two run folders."""
    for name in ("a", "b"):
        shutil.copytree(FIXTURES / "nav440_rate_60", tmp_path / "runs" / name)
    return tmp_path / "runs"


@pytest.mark.parametrize("name", ["click.py", "selectors.py", "pyarrow.py"])
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_code_in_the_folder_of_the_data_is_not_executed(runs, tmp_path, name, jobs):
    here = tmp_path / "data"
    here.mkdir()
    (here / name).write_text("open('PWNED', 'w')\n")
    done = run(SCRIPT, here, "calibrate", "--batch", runs, "--jobs", jobs, "-o", "out")
    assert (done.returncode, done.stderr) == (0, "rotcli: 2 runs done\n")
    assert not (here / "PWNED").exists()
    assert len(list((here / "out").rglob("calibration.json"))) == 2


def test_python_m_rotcli_executes_no_code_of_the_data_either(runs, tmp_path):
    (tmp_path / "click.py").write_text("open('PWNED', 'w')\n")
    done = run(MODULE, tmp_path, "calibrate", "--batch", runs, "--jobs", "2")
    assert (done.returncode, done.stderr) == (0, "rotcli: 2 runs done\n")
    assert not (tmp_path / "PWNED").exists()


@pytest.mark.parametrize("entry", ["", "."])
def test_a_search_path_that_names_the_working_directory_brings_no_code_of_the_data(
    runs, tmp_path, monkeypatch, entry
):
    """`PYTHONPATH=$PYTHONPATH:/lib` has an empty entry, which is the working directory."""
    monkeypatch.setitem(ENVIRONMENT, "PYTHONPATH", f"{entry}{os.pathsep}{ROOT}")
    for name in ("socket.py", "pickle.py", "click.py"):
        (tmp_path / name).write_text("open('PWNED', 'w')\n")
    done = run(MODULE, tmp_path, "calibrate", "--batch", runs, "--jobs", "2")
    assert (done.returncode, done.stderr) == (0, "rotcli: 2 runs done\n")
    assert not (tmp_path / "PWNED").exists()


def test_a_folder_named_rotcli_next_to_the_data_does_no_harm(runs, tmp_path):
    (tmp_path / "rotcli").mkdir()
    done = run(SCRIPT, tmp_path, "calibrate", "--batch", runs, "--jobs", "2")
    assert (done.returncode, done.stderr) == (0, "rotcli: 2 runs done\n")


def _batch_at_work(runs, **variables):
    """Start a batch of 22 runs and return its process when the first result is there."""
    for k in range(20):
        shutil.copytree(runs / "a", runs / f"x{k:02d}")
    command = [*SCRIPT, "calibrate", "--batch", str(runs), "--jobs", "2"]
    environment = ENVIRONMENT | variables
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    limit = time.monotonic() + 30
    while not list(runs.rglob("calibration.json")) and time.monotonic() < limit:
        time.sleep(0.005)
    return process


def test_a_killed_worker_costs_its_own_run_only(runs):
    process = _batch_at_work(runs)
    os.kill(_workers_of(process.pid)[0], signal.SIGKILL)
    _, err = process.communicate(timeout=60)
    done = len(list(runs.rglob("calibration.json")))
    lost = [line for line in err.splitlines() if "its process was killed" in line]
    # A worker killed between two runs costs nothing.
    assert (done, len(lost)) in ((21, 1), (22, 0))
    assert process.returncode == (1 if lost else 0), err


def _workers_of(pid):
    """Return the processes that the server of a batch forked, found by their parents."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        parents[int(stat.parent.name)] = int(fields[1])
    children = [child for child, parent in parents.items() if parent == pid]
    return [child for child, parent in parents.items() if parent in children]


def test_a_terminated_batch_leaves_no_warning_no_worker_and_no_file(runs):
    with tempfile.TemporaryDirectory() as temporary:  # a socket's path is 108 bytes at most
        process = _batch_at_work(runs, TMPDIR=temporary)
        workers = _workers_of(process.pid)
        process.terminate()
        _, err = process.communicate(timeout=30)
        assert (process.returncode, err) == (128 + signal.SIGTERM, "")
        assert list(Path(temporary).iterdir()) == []
    limit = time.monotonic() + 20
    while [pid for pid in workers if _is_running(pid)] and time.monotonic() < limit:
        time.sleep(0.1)
    assert not [pid for pid in workers if _is_running(pid)]


def _is_running(pid):
    """Return whether a process exists and is no zombie."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state not in ("Z", "X")


def test_linked_run_folders_are_followed_and_cycles_end(runs, tmp_path, rotcli):
    place = tmp_path / "links"
    place.mkdir()
    (place / "a").symlink_to(runs / "a")
    shutil.copytree(runs / "b", place / "b")
    (place / "b" / "again").symlink_to(place)
    done = rotcli("calibrate", "--batch", place, "--jobs", 1, "-o", tmp_path / "out")
    assert (done.status, done.err) == (0, "rotcli: 2 runs done\n")


@pytest.mark.parametrize("pattern", ["links", "links/*"])
def test_of_several_names_of_a_run_the_one_without_a_link_remains(runs, tmp_path, rotcli, pattern):
    place = tmp_path / "links"
    runs.rename(place)
    (place / "0").symlink_to("a")
    (place / "latest").symlink_to("b")
    done = rotcli("calibrate", "--batch", tmp_path / pattern, "--jobs", 1, "-o", tmp_path / "out")
    assert (done.status, done.err) == (0, "rotcli: 2 runs done\n")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a", "b"]


@pytest.mark.parametrize("name", ["/tmp/shared.csv", "../../escaped.csv"])
def test_an_output_name_that_runs_would_share_is_a_usage_error(runs, rotcli, name):
    done = rotcli(
        *("navigate", "--batch", runs, "--mode", "conventional", "--jobs", 1),
        *("--solution", name),
    )
    assert done.status == 2
    assert f"--solution {name}: with --batch use a name inside the run folders" in done.err


@pytest.mark.parametrize("closed", [">&-", "2>&-", "2>/dev/full", "<&- >&- 2>&-"])
def test_closed_standard_streams_cost_no_result(turning, closed):
    words = " ".join(f"'{word}'" for word in SCRIPT)
    line = f"{words} calibrate imu.parquet table.parquet -o c.json {closed}"
    done = subprocess.run(["bash", "-c", line], cwd=turning, env=ENVIRONMENT, timeout=60)
    assert done.returncode == 0
    assert json.loads((turning / "c.json").read_text())["kind"] == "calibration"


def test_a_batch_runs_without_standard_streams(runs):
    words = " ".join(f"'{word}'" for word in SCRIPT)
    line = f"{words} calibrate --batch . --jobs 2 <&- >&- 2>&-"
    done = subprocess.run(["bash", "-c", line], cwd=runs, env=ENVIRONMENT, timeout=60)
    assert done.returncode == 0
    assert len(list(runs.rglob("calibration.json"))) == 2


def test_a_pipe_under_the_name_of_a_draft_contains_no_writer_up(turning, rotcli):
    os.mkfifo(turning / ".d.json.12345678.part")
    out = turning / "d.json"
    logs = (turning / "imu.parquet", turning / "table.parquet")
    assert rotcli("calibrate", *logs, "-o", out).status == 0
    assert out.exists()


def test_a_rig_that_is_a_pipe_is_rejected(turning, rotcli):
    os.mkfifo(turning / "rigf")
    logs = (turning / "imu.parquet", turning / "table.parquet")
    done = rotcli("calibrate", *logs, "--rig", turning / "rigf")
    assert done.status == 1
    assert "a pipe or device, not a file" in done.err


def test_a_rig_that_is_a_pipe_does_not_stop_a_simulation(tmp_path, rotcli):
    os.mkfifo(tmp_path / "rig.toml")
    done = rotcli("simulate", "--imu", "nav440", "--rate", 10, "-o", tmp_path)
    assert done.status == 1
    assert done.err.count("\n") == 1


def test_a_usage_error_keeps_its_status_on_a_full_disk(tmp_path):
    words = " ".join(f"'{word}'" for word in SCRIPT)
    line = f"{words} calibrate --nonsense 2>/dev/full"
    done = subprocess.run(["bash", "-c", line], cwd=tmp_path, env=ENVIRONMENT, timeout=60)
    assert done.returncode == 2


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.write_bytes(b"font.size: x\n\xff")])
def test_settings_of_matplotlib_in_the_folder_of_the_data_are_not_read(still, tmp_path, make):
    make(still / "matplotlibrc")
    variables = {"MPLCONFIGDIR": str(still / "imu.csv"), "MPLBACKEND": "nonsense"}
    environment = ENVIRONMENT | variables
    done = subprocess.run(
        [*SCRIPT, "allan", "imu.csv", "--plot", "p.png", "-o", "a.json", "--quiet"],
        cwd=still,
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (still / "p.png").stat().st_size > 10_000


def test_a_working_directory_that_was_removed_does_not_stop_a_figure(still, tmp_path):
    gone = tmp_path / "gone"
    gone.mkdir()
    script = 'rmdir "$PWD" && exec "$@"'
    files = [still / "imu.csv", "--plot", still / "p.png", "-o", still / "a.json", "--quiet"]
    command = ["sh", "-c", script, "sh", *SCRIPT, "allan", *map(str, files)]
    done = subprocess.run(command, cwd=gone, env=ENVIRONMENT, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert (still / "p.png").stat().st_size > 10_000


def test_a_backend_of_nonsense_does_not_stop_a_figure(still, rotcli, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "nonsense")
    done = run(SCRIPT, still, "allan", "imu.csv", "--plot", "p.png", "-o", "a.json")
    assert done.returncode == 0
    assert (still / "p.png").stat().st_size > 10_000


def test_control_characters_of_a_file_do_not_reach_the_terminal(turning, rotcli):
    logs = (turning / "imu.parquet", turning / "table.parquet")
    assert rotcli("calibrate", *logs, "-o", turning / "c.json").status == 0
    doc = json.loads((turning / "c.json").read_text())
    doc["rig"]["imu"]["name"] = "\x1b]0;pwn\x07"
    doc["warnings"] = ["=1+1", "\u202egnp.exe", "a\x00b"]
    (turning / "e.json").write_text(json.dumps(doc))
    for suffix in ("txt", "md", "tex", "csv", "html"):
        done = rotcli("report", turning / "e.json", "-o", turning / f"r.{suffix}")
        assert done.status == 0
        text = (turning / f"r.{suffix}").read_text()
        for sign in ("\x1b", "\x07", "\u202e", "\x00"):
            assert sign not in text, (suffix, sign)
            assert sign not in done.err
    for suffix in ("html", "md"):
        done = rotcli("certificate", turning / "e.json", "-o", turning / f"certificate.{suffix}")
        assert done.status == 0
        text = (turning / f"certificate.{suffix}").read_text()
        assert "\\x1b]0;pwn\\x07" in text
        assert not any(sign in text + done.err for sign in "\x1b\x07")
    log = (turning / "imu.parquet").rename(turning / "\x1b[1m.parquet")
    assert "\x1b" not in rotcli("inspect", log).out
    assert "\n=1+1" not in (turning / "r.csv").read_text()
    assert ",=1+1" not in (turning / "r.csv").read_text()
