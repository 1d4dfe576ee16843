"""What the commands say while they work: a bar on a terminal, -v, --quiet."""

import os
import pty
import re
import select
import subprocess
import sys
from pathlib import Path

import pytest

from rotcli.cli import messages
from tests.cli.commands import leaf_commands

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("name", "command"), leaf_commands())
def test_every_command_takes_verbose_and_quiet(name, command):
    flags = {flag for parameter in command.params for flag in parameter.opts}
    assert {"-v", "--verbose", "--quiet"} <= flags


def test_verbose_says_on_standard_error_what_is_done(rotcli, turning):
    logs = (turning / "imu.parquet", turning / "table.parquet")
    loud = rotcli("calibrate", *logs, "-v", "-o", turning / "c.json")
    assert f"rotcli: rig: {turning / 'rig.toml'}" in loud.err
    assert re.search(rf"read {logs[0]}: \d+ records, 0 to [\d.]+ s, 100 Hz", loud.err)
    assert re.search(r"segment 0 to [\d.]+ s, still", loud.err)
    assert ", turning at 60 deg/s" in loud.err
    assert f"{turning / 'c.json'}: written" in loud.err
    plain = rotcli("calibrate", *logs, "-o", turning / "d.json")
    assert "read " not in plain.err
    assert loud.out == plain.out == ""
    assert (turning / "c.json").read_bytes() == (turning / "d.json").read_bytes()
    args = ("navigate", *logs, "--calibration", turning / "c.json", "--mode", "full", "-v")
    assert "navigating full, table at 60 deg/s, window " in rotcli(*args).err


def test_quiet_leaves_nothing_on_standard_error(rotcli, turning):
    logs = (turning / "imu.parquet", turning / "table.parquet")
    assert rotcli("calibrate", *logs, "--quiet", "-o", turning / "c.json").err == ""


def on_a_terminal(program, cwd):
    """Run a Python program whose standard error is a terminal; return what appears there."""
    main, end = pty.openpty()
    child = subprocess.Popen(
        [sys.executable, "-c", program],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=end,
    )
    os.close(end)
    shown = b""
    while True:
        ready = select.select([main], [], [], 30.0)[0]
        try:
            part = os.read(main, 4096) if ready else b""
        except OSError:  # the terminal closes with the program
            part = b""
        if not part:
            break
        shown += part
    out = child.communicate()[0]
    os.close(main)
    assert child.returncode == 0, shown
    assert out == b""
    return shown.decode()


# Bars from the start on: the files here take no second to read.
PROGRAM = """
import sys
from rotcli.cli import messages
from rotcli.cli.main import main
messages._MIN_PROGRESS_TIME = {soon}
main({args!r})
"""


@pytest.mark.parametrize(
    ("args", "label"),
    [
        (["allan", "imu.csv", "-o", "a.json"], "analysing"),
        (["convert", "imu.csv", "-o", "imu.parquet"], "reading"),
        (
            [
                "simulate",
                "--imu",
                "ideal",
                "--rate",
                "0",
                "--static",
                "5",
                "--navigation",
                "0",
                "-o",
                "s",
            ],
            "simulating",
        ),
        (
            ["navigate", "imu.csv", "--mode", "conventional", "--static", "1:10", "-o", "n.json"],
            "navigating",
        ),
        (["observe", "imu.csv", "--latitude", "51", "-o", "o.json"], "filtering"),
    ],
)
def test_a_terminal_shows_a_bar_that_ends_full(still, args, label):
    shown = on_a_terminal(PROGRAM.format(soon=0.0, args=args), still)
    assert label in shown
    assert "100%" in shown
    assert "\n" in shown.split("100%")[-1]  # the message is on a line of its own


def test_quick_work_and_quiet_show_no_bar(still):
    args = ["convert", "imu.csv", "-o", "imu.parquet"]
    assert "%" not in on_a_terminal(PROGRAM.format(soon=60.0, args=args), still)
    assert on_a_terminal(PROGRAM.format(soon=0.0, args=[*args, "--quiet"]), still) == ""


def test_a_pipe_shows_no_bar(rotcli, still, monkeypatch):
    monkeypatch.setattr(messages, "_MIN_PROGRESS_TIME", 0.0)
    done = rotcli("convert", still / "imu.csv", "-o", still / "imu.parquet")
    assert "%" not in done.err
    assert "\r" not in done.err
