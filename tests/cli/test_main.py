"""The command line: help, start-up, statuses, and that its words are true."""

import re
import shlex
import subprocess
import sys

import numpy as np
import pytest

from rotcli import __main__ as program
from rotcli.cli import main as main_module
from rotcli.cli.main import COMMANDS
from tests.cli.commands import leaf_commands


@pytest.mark.parametrize("name", [name for name, _ in leaf_commands()])
def test_every_command_explains_itself(name, rotcli):
    help_text = rotcli(*name.split(), "--help")
    assert help_text.status == 0
    assert "Usage: rotcli" in help_text.out
    assert "Example:\n" in help_text.out
    assert "--quiet" in help_text.out


@pytest.mark.parametrize(("name", "command"), leaf_commands())
def test_the_example_of_every_command_runs(name, command, rotcli, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    example = command.epilog.split("Example:\n")[1]
    assert example.strip()
    for step in example.splitlines():
        words = shlex.split(step)
        assert words[0] == "rotcli"
        outcome = rotcli(*words[1:])
        assert outcome.status == 0, (words, outcome.err)


def test_help_lists_the_commands_without_importing_any(rotcli):
    listed = rotcli("--help")
    assert listed.status == 0
    for name in COMMANDS:
        assert re.search(rf"^  {name} ", listed.out, re.MULTILINE)


# What no command may load without need: heavy modules, and the rooms of other commands.
HEAVY = {
    *("numpy", "pandas", "scipy", "matplotlib", "allantools", "jinja2", "pyarrow", "tomlkit"),
    *("numpy.random", "pyarrow.csv", "pyarrow.parquet", "multiprocessing.pool", "distributed"),
    *("concurrent.futures.process", "rotcli.report.page"),
}
READS = {"numpy", "pyarrow", "pyarrow.parquet"}
LOADS = [
    # In one process: what one of them loaded would show.
    (" ; ".join(["--help", *(f"{name} --help" for name in COMMANDS)]), set()),
    (
        "simulate --imu nav440 --rate 20 -o run",
        {*READS, "numpy.random", "simulate", "tomlkit", "scipy"},
    ),
    ("calibrate run/imu.parquet run/table.parquet -o c.json", {*READS, "calibrate"}),
    (
        "navigate run/imu.parquet run/table.parquet --calibration c.json -o n.json",
        {*READS, "navigate"},
    ),
    (
        "navigate run/imu.parquet run/table.parquet --plot n.png",
        {*READS, "navigate", "matplotlib", "numpy.random"},
    ),
    ("allan run/imu.parquet --window 0:59 -o a.json", {*READS, "allan", "scipy", "numpy.random"}),
    ("convert run/imu.parquet -o i.csv", {*READS, "pyarrow.csv"}),
    (
        "budget --imu nav440 --rig run/rig.toml -o b.json",
        {"numpy", "budget", "scipy", "numpy.random", "pyarrow"},
    ),
    ("observe --axis z --rate 10 -o o.json", {"numpy"}),
    (
        "observe run/imu.parquet run/table.parquet -o z.json",
        READS,
    ),
    ("report n.json -o r.md", {"numpy"}),
    ("calibrate --batch run --jobs 1", {*READS, "calibrate"}),
    ("calibrate --batch run", {"concurrent.futures.process", *READS, "calibrate"}),
]


@pytest.fixture(scope="module")
def a_run_with_results(tmp_path_factory):
    """A folder with the logs run/imu.parquet, run/table.parquet and the results c.json, n.json."""
    place = tmp_path_factory.mktemp("loads")
    run, calibration = place / "run", place / "c.json"
    logs = (run / "imu.parquet", run / "table.parquet")
    for command in (
        ("simulate", "--imu", "nav440", "--rate", "20", "-o", run),
        ("calibrate", *logs, "-o", calibration),
        ("navigate", *logs, "--calibration", calibration, "-o", place / "n.json"),
    ):
        with pytest.raises(SystemExit, match="0"):
            main_module.main([str(word) for word in command])
    return place


@pytest.mark.parametrize(("line", "allowed"), LOADS, ids=[line[:60] for line, _ in LOADS])
def test_a_command_loads_only_what_it_needs(line, allowed, a_run_with_results):
    code = (
        "import sys\n"
        "from rotcli.cli.main import main\n"
        "for line in ' '.join(sys.argv[1:]).split(';'):\n"
        "    try:\n        main(line.split())\n"
        "    except SystemExit as stop:\n        assert stop.code == 0, stop.code\n"
        "print(*sys.modules, file=sys.stderr)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *line.split()],
        cwd=a_run_with_results,
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = set(done.stderr.split())
    rooms = {name.split(".")[1] for name in loaded if re.fullmatch(r"rotcli\.\w+\.estimate", name)}
    heavy = HEAVY & loaded
    if "numpy" in heavy and np.lib.NumpyVersion(np.__version__) < "2.0.0":
        heavy -= {"numpy.random"}  # numpy 1 imports it by itself
    assert heavy | rooms <= allowed


def test_an_unknown_command_names_the_nearest(rotcli):
    outcome = rotcli("navigat")
    assert outcome.status == 2
    assert "similar: navigate" in outcome.err


def test_the_version_is_the_package_s(rotcli):
    from rotcli import __version__

    assert rotcli("--version").out == f"rotcli, version {__version__}\n"


def test_an_interrupt_ends_with_one_line_and_130(rotcli, monkeypatch):
    def interrupt(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(main_module.cli, "main", interrupt)
    outcome = rotcli("navigate")
    assert outcome == (130, "", "rotcli: interrupted; no partial files remain\n")


def test_a_reader_that_goes_away_is_no_traceback(turning):
    command = f"{sys.executable} -m rotcli navigate {turning}/imu.parquet {turning}/table.parquet"
    done = subprocess.run(
        ["bash", "-c", f"{command} --quiet -o - | head -n 1"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "{\n"
    assert done.stderr == ""


class _Interrupted:
    def __set_name__(self, owner, name):
        raise KeyboardInterrupt


def test_an_interrupt_amid_the_making_of_a_class_is_one_line(monkeypatch, capsys):
    # Python 3.11 raises RuntimeError from what __set_name__ meets.
    def run():
        type("Made", (), {"part": _Interrupted()})

    left = []
    monkeypatch.setattr("rotcli.cli.main.main", run)
    monkeypatch.setattr("rotcli.__main__._leave", left.append)
    program.main()
    assert left == [130]
    assert capsys.readouterr().err == "rotcli: interrupted; no partial files remain\n"

    def wrong():
        raise ValueError("a fault of ours")

    monkeypatch.setattr("rotcli.cli.main.main", wrong)
    with pytest.raises(ValueError, match="a fault of ours"):
        program.main()
