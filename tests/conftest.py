"""Fixtures that several tests share: simulated campaigns, small logs, the command line."""

import gc
import os
import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import settings

from rotcli.cli.main import main
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import rig_from_dict
from rotcli.rig.scenario import Leg, Scenario

# The same examples in every run of the tests; `make test-campaign` searches at random for others.
settings.register_profile("same", derandomize=True, deadline=None, max_examples=50)
settings.register_profile("random", max_examples=2000, deadline=None)
settings.load_profile("same")

# Tests start some hundred processes of rotcli: each would compile it again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# What is imported to collect the tests stays: to look for what may be freed is a third of the time.
gc.disable()


def pytest_collection_finish(session):
    gc.enable()
    gc.freeze()


DEG = np.pi / 180
FIXTURES = Path(__file__).parents[1] / "fixtures"


@pytest.fixture(scope="session")
def laboratory():
    """The papers' laboratory as a rig's dictionary: site and a level table facing north."""
    return {
        "site": {"latitude": 51.08, "longitude": -114.13, "height": 1100.0},
        "attitude": {"pitch": 0.0, "roll": 0.0, "azimuth": 0.0},
    }


@pytest.fixture(scope="session")
def papers_run(laboratory):
    """Return a maker of the papers' scenario: still, turning, navigating at one rate (deg/s)."""

    def make(sensors="ideal", rate=10.0, seed=0, static=60.0, rotation=60.0, navigation=0.0, **rig):
        profile = read_profile(sensors) if isinstance(sensors, str) else sensors
        legs = [Leg(static, stage="static")] if static else []
        legs += [Leg(rotation, rate * DEG, stage="rotation")] if rotation else []
        legs += [Leg(navigation, rate * DEG, stage="navigation")] if navigation else []
        return Scenario(
            profile=profile,
            legs=tuple(legs),
            rig=rig_from_dict({**laboratory, **rig}),
            seed=seed,
        )

    return make


@pytest.fixture(scope="session")
def documents():
    """The makers of small result documents, tests/documents.py."""
    from tests import documents

    return documents


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
