"""Sound simulated runs, the commands that read them, and their columns."""

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tomlkit
from numpy.typing import NDArray

from rotcli.files.columns import write_columns
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import rig_from_dict
from rotcli.rig.scenario import Leg, Scenario
from rotcli.simulate.document import _imu_columns, _rig, _table_columns
from rotcli.simulate.estimate import simulate
from rotcli.units import DEG

Array = NDArray[np.float64]


Columns = dict[str, Array]


DEFAULT_SITE = {
    "site": {"latitude": 51.08, "longitude": -114.13, "height": 1100.0},
    "attitude": {"pitch": 0.0, "roll": 0.0, "azimuth": 0.0},
}


@dataclass
class Run:
    """A run before it is written: columns as the files name them, the rig as its file has it."""

    imu: Columns
    table: Columns
    rig: dict


# Motion of a run: legs of s, deg/s, sweep deg/s, stage.
def _legs(motion: str, rate: float) -> list[Leg]:
    w, turn = rate * DEG, max(15.0, 380.0 / abs(rate))
    legs = [Leg(12.0, stage="static")]
    if motion == "still":
        return [*legs, Leg(12.0, stage="navigation")]
    legs.append(Leg(turn, w, stage="rotation"))
    if motion == "rates":
        legs.append(Leg(turn, -w, stage="rotation"))
    swing = {"sweep": 0.5 * abs(w), "period": 6.0} if motion == "swing" else {}
    return [*legs, Leg(18.0, w, stage="navigation", **swing)]


def clean(unit: str, rate: float, seed: int, *, motion: str = "turning", **rig: dict) -> Run:
    """Return a run without a fault: still, then as `motion` says, navigating at the end.

    motion: turning, still, rates (two of them), swing. rig: sections laid over the laboratory's.
    """
    set_up = rig_from_dict({**DEFAULT_SITE, **rig})
    played = Scenario(read_profile(unit), tuple(_legs(motion, rate)), set_up, seed=seed)
    made = simulate(played)
    return Run(_imu_columns(played, made), _table_columns(played, made), _rig(played, made))


def write(run: Run, folder: Path, suffix: str = "parquet") -> None:
    """Write a run's imu and table logs and rig.toml."""
    folder.mkdir(parents=True, exist_ok=True)
    write_columns(folder / f"imu.{suffix}", run.imu)
    write_columns(folder / f"table.{suffix}", run.table)
    (folder / "rig.toml").write_text(tomlkit.dumps(run.rig))


def commands(folder: Path, suffix: str = "parquet") -> dict[str, list[str]]:
    """Return the command lines that read a run; those that begin with `still` read no table."""
    imu, table = str(folder / f"imu.{suffix}"), str(folder / f"table.{suffix}")
    calibration = str(folder / "calibration.json")
    return {
        "calibrate": ["calibrate", imu, table, "-o", calibration],
        "navigate": ["navigate", imu, table, "--mode", "conventional"],
        "full": ["navigate", imu, table, "--calibration", calibration, "--mode", "full"],
        "swing": ["navigate", imu, table, "--mode", "conventional"],
        "observe": ["observe", imu, table],
        "still navigate": ["navigate", imu],
        "still observe": ["observe", imu],
        "still allan": ["allan", imu],
    }


def rotcli(args: list[str], **options) -> subprocess.CompletedProcess:
    """Run the command line in a process of its own; one that hangs ends as status -9."""
    root = str(Path(__file__).parents[3])
    environment = {**os.environ, "PYTHONPATH": root, **options.pop("env", {})}
    program = [sys.executable, "-m", "rotcli", *args]
    options = {"env": environment, "timeout": 120.0, "check": False, **options}
    try:
        return subprocess.run(program, capture_output=True, text=True, **options)
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(program, -9, "", f"hung: {args}")


def columns(before: Columns, part: slice) -> list[str]:
    """Return the names of the gyro or accelerometer columns."""
    return list(before)[part]
