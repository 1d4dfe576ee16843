"""Run the command line in this process, as a shell would see it."""

import shutil
from pathlib import Path
from typing import NamedTuple

import pytest

from rotcli.cli.main import main

FIXTURES = Path(__file__).parents[2] / "fixtures"


class Outcome(NamedTuple):
    status: int
    out: str
    err: str


@pytest.fixture
def rotcli(capfd):
    """Return a function that runs `rotcli ARGS` and returns status, stdout and stderr."""

    def run(*args):
        capfd.readouterr()
        with pytest.raises(SystemExit) as stop:
            main([str(arg) for arg in args])
        captured = capfd.readouterr()
        return Outcome(stop.value.code, captured.out, captured.err)

    return run


@pytest.fixture
def turning(tmp_path):
    """A copy of the small turning log: a folder with imu.parquet, table.parquet and rig.toml."""
    return Path(shutil.copytree(FIXTURES / "nav440_rate_60", tmp_path / "turning"))


@pytest.fixture
def still(tmp_path):
    """A copy of the small still log, as CSV."""
    return Path(shutil.copytree(FIXTURES / "nav440_still", tmp_path / "still"))
