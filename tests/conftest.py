"""Small simulated campaigns that several tests share."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from rotcli.logs.profile import read_profile
from rotcli.logs.rig import rig_from_dict
from rotcli.logs.scenario import Leg, Scenario

DEG = np.pi / 180


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
    """The makers of small result documents, tests/results/documents.py."""
    path = Path(__file__).parent / "results" / "documents.py"
    spec = importlib.util.spec_from_file_location("documents", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
