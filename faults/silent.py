"""Logs that can be read and are wrong: each a sound simulated run with one fault put in.

`FAULTS` names them; `make` writes the run, `run` gives it to the command that must tell.
"""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tomlkit
from numpy.typing import NDArray

from rotcli.logs.profile import read_profile
from rotcli.logs.rig import rig_from_dict
from rotcli.logs.scenario import Leg, Scenario
from rotcli.logs.write import write_columns
from rotcli.results.simulation import _imu_columns, _rig, _table_columns
from rotcli.stages.simulate import simulate
from rotcli.units import DEG, STANDARD_GRAVITY

Array = NDArray[np.float64]
Columns = dict[str, Array]
GYRO, ACCEL = slice(1, 4), slice(4, 7)
LABORATORY = {
    "site": {"latitude": 51.08, "longitude": -114.13, "height": 1100.0},
    "attitude": {"pitch": 0.0, "roll": 0.0, "azimuth": 0.0},
}


@dataclass
class Run:
    """A run before it is written: columns as the files name them, the rig as its file holds it."""

    imu: Columns
    table: Columns
    rig: dict


@dataclass(frozen=True)
class Fault:
    """How a run is spoilt, the command that must tell, and what it must say (a pattern)."""

    change: Callable[[Run, np.random.Generator], None]
    says: str
    command: str = "calibrate"
    status: int = 0
    still: bool = False
    imu: str = "nav440"
    rate: float = 30.0


def scenario(imu: str, rate: float, seed: int, *, still: bool = False) -> Scenario:
    """Return a short run as the papers': still, turning, navigating."""
    legs = [Leg(12.0, stage="static")]
    legs += [] if still else [Leg(15.0, rate * DEG, stage="rotation")]
    legs += [Leg(12.0, 0.0 if still else rate * DEG, stage="navigation")]
    return Scenario(read_profile(imu), tuple(legs), rig_from_dict(LABORATORY), seed=seed)


def clean(imu: str, rate: float, seed: int, *, still: bool = False) -> Run:
    """Return a run without a fault."""
    played = scenario(imu, rate, seed, still=still)
    made = simulate(played)
    return Run(_imu_columns(played, made), _table_columns(played, made), _rig(played, made))


def write(run: Run, folder: Path) -> None:
    """Write a run's imu.parquet, table.parquet and rig.toml."""
    folder.mkdir(parents=True, exist_ok=True)
    write_columns(folder / "imu.parquet", run.imu)
    write_columns(folder / "table.parquet", run.table)
    (folder / "rig.toml").write_text(tomlkit.dumps(run.rig))


def commands(folder: Path, *, still: bool = False) -> dict[str, list[str]]:
    """Return the command lines that read a run."""
    imu, table = str(folder / "imu.parquet"), str(folder / "table.parquet")
    calibration = str(folder / "calibration.json")
    return {
        "calibrate": ["calibrate", imu, table, "-o", calibration],
        "navigate": ["navigate", imu, *([] if still else [table]), "--mode", "conventional"],
        "full": ["navigate", imu, table, "--calibration", calibration],
        "observe": ["observe", imu, *([] if still else [table])],
        "allan": ["allan", imu],
    }


def rotcli(args: list[str], **options) -> subprocess.CompletedProcess:
    """Run the command line in a process of its own."""
    root = str(Path(__file__).parents[1])
    environment = {**os.environ, "PYTHONPATH": root, **options.pop("env", {})}
    return subprocess.run(
        [sys.executable, "-m", "rotcli", *args],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
        **options,
    )


def columns(held: Columns, part: slice) -> list[str]:
    """Return the names of the gyro or accelerometer columns."""
    return list(held)[part]


def _scaled(part: slice, factor: float) -> Callable[[Run, np.random.Generator], None]:
    def change(run: Run, _: np.random.Generator) -> None:
        for name in columns(run.imu, part):
            run.imu[name] = run.imu[name] * factor

    return change


def _swapped(part: slice, order: tuple[int, int, int], signs=(1, 1, 1)):
    def change(run: Run, _: np.random.Generator) -> None:
        names = columns(run.imu, part)
        held = [run.imu[name] for name in names]
        for name, source, sign in zip(names, order, signs, strict=True):
            run.imu[name] = sign * held[source]

    return change


def _other_way(run: Run, _: np.random.Generator) -> None:
    run.rig["table"] = {**run.rig.get("table", {}), "direction": -1}


def _stamps(log: str, factor: float):
    def change(run: Run, _: np.random.Generator) -> None:
        held = getattr(run, log)
        held["time [s]"] = held["time [s]"] * factor

    return change


def _offset(run: Run, rng: np.random.Generator) -> None:
    run.table["time [s]"] = run.table["time [s]"] + rng.choice([-1, 1]) * rng.uniform(0.015, 0.2)


def _touched(run: Run, rng: np.random.Generator) -> None:
    time = run.imu["time [s]"]
    start = rng.uniform(3.0, 9.0)
    inside = (time > start) & (time < start + 0.5)
    name = columns(run.imu, GYRO)[int(rng.integers(3))]
    run.imu[name] = run.imu[name] + inside * 1.5 * DEG * np.sin(2 * np.pi * 4 * (time - start))


def _dropped(run: Run, rng: np.random.Generator) -> None:
    n = len(run.imu["time [s]"])
    starts = rng.integers(100, n - 100, 6)
    lost = np.unique(np.concatenate([s + np.arange(4) for s in starts]))
    run.imu = {name: np.delete(column, lost) for name, column in run.imu.items()}


def _table_dropped(run: Run, rng: np.random.Generator) -> None:
    start = int(rng.integers(700, 1000))
    lost = np.arange(start, start + 60)
    run.table = {name: np.delete(column, lost) for name, column in run.table.items()}


def _stuck(run: Run, rng: np.random.Generator) -> None:
    name = list(run.imu)[1 + int(rng.integers(6))]
    run.imu[name] = np.full_like(run.imu[name], run.imu[name][0])


def _frozen(run: Run, rng: np.random.Generator) -> None:
    start = int(rng.integers(100, 900))
    for name in list(run.imu)[1:]:
        run.imu[name] = run.imu[name].copy()
        run.imu[name][start : start + 80] = run.imu[name][start]


def _quantised(run: Run, rng: np.random.Generator) -> None:
    for name in columns(run.imu, GYRO)[:2]:
        step = np.ptp(run.imu[name]) / float(rng.integers(2, 12))
        run.imu[name] = step * np.round(run.imu[name] / step)


def _clipped(run: Run, _: np.random.Generator) -> None:
    limit = 29.9 * DEG
    run.rig["imu"]["gyro_range"] = 29.9
    for name in columns(run.imu, GYRO):
        run.imu[name] = np.clip(run.imu[name], -limit, limit)


def _no_azimuth(run: Run, _: np.random.Generator) -> None:
    del run.rig["attitude"]["azimuth"]


def _other_unit(run: Run, _: np.random.Generator) -> None:
    run.rig["imu"]["name"] = "another unit"


def _other_bias(run: Run, rng: np.random.Generator) -> None:
    for name in columns(run.imu, GYRO):
        run.imu[name] = run.imu[name] + rng.choice([-1, 1]) * rng.uniform(0.3, 1.0) * DEG


def _other_rate(run: Run, _: np.random.Generator) -> None:
    other = clean("nav440", 20.0, 7)
    run.imu, run.table = other.imu, other.table
    run.rig["stages"] = other.rig["stages"]


def _means(run: Run, _: np.random.Generator) -> None:
    name = columns(run.imu, GYRO)[2]
    held = run.imu[name]
    run.imu[name] = np.concatenate([held[:1], 0.5 * (held[1:] + held[:-1])])


GRAVITY = r"in g\? name the unit"
FAULTS: dict[str, Fault] = {
    "deg/s read as rad/s, turning": Fault(
        _scaled(GYRO, 1 / DEG), "not the same rate; check the units", status=1
    ),
    "deg/s read as rad/s, still, navigate": Fault(
        _scaled(GYRO, 1 / DEG), r"deg/s read as rad/s\?|is not still", "navigate", still=True
    ),
    "deg/s read as rad/s, still, allan": Fault(
        _scaled(GYRO, 1 / DEG), r"deg/s read as rad/s\?", "allan", still=True
    ),
    "rad/s read as deg/s, turning": Fault(
        _scaled(GYRO, DEG), "not the same rate; check the units", status=1
    ),
    "g read as m/s^2, navigate": Fault(
        _scaled(ACCEL, 1 / STANDARD_GRAVITY), GRAVITY, "navigate", 1, still=True
    ),
    "g read as m/s^2, allan": Fault(
        _scaled(ACCEL, 1 / STANDARD_GRAVITY), r"in g\?", "allan", still=True
    ),
    "g read as m/s^2, observe": Fault(
        _scaled(ACCEL, 1 / STANDARD_GRAVITY), r"accel biases end|in g\?|off the attitude", "observe"
    ),
    "accelerometer axes swapped": Fault(
        _swapped(ACCEL, (2, 0, 1)), r"gravity is felt \d+\.\d deg", "navigate", 1, still=True
    ),
    "accelerometer axes flipped": Fault(
        _swapped(ACCEL, (0, 1, 2), (-1, 1, -1)),
        r"gravity is felt 1[78]\d",
        "navigate",
        1,
        still=True,
    ),
    "gyro axes swapped": Fault(_swapped(GYRO, (2, 0, 1)), "about another axis", status=1),
    "gyro axes flipped": Fault(
        _swapped(GYRO, (0, 1, 2), (1, -1, -1)), "turns the other way", status=1
    ),
    "table turning the other way": Fault(_other_way, "turns the other way", status=1),
    "IMU stamps in ms read as s": Fault(
        _stamps("imu", 1e3), r"name the unit .* time \[ms\]", status=1
    ),
    "table stamps in ms read as s": Fault(
        _stamps("table", 1e3), r"name the unit .* time \[ms\]|or the unit of its stamps", status=1
    ),
    "stamps in s read as ms": Fault(
        _stamps("imu", 1e-3), r"name the unit .* time \[ms\]", status=1
    ),
    "clocks offset by more than a sample": Fault(_offset, r"time_offset|not still|still stretch"),
    "a still stretch touched": Fault(_touched, r"is not still", "navigate", still=True),
    "a calibration of another unit": Fault(_other_unit, "made for the IMU", "full", 1),
    "a calibration of another day": Fault(_other_bias, "of this unit and this day", "full"),
    "a calibration of another rate": Fault(_other_rate, "made at 30 deg/s", "full", 1),
    "Earth rate without azimuth, navigate": Fault(
        _no_azimuth, "taken as 0 .north.", "navigate", still=True
    ),
    "Earth rate without azimuth, calibrate": Fault(_no_azimuth, "azimuth: missing", status=1),
    "Earth rate without azimuth, observe": Fault(_no_azimuth, "names no azimuth", "observe"),
    "samples dropped in bursts": Fault(_dropped, r"gaps? \(\d+ samples?\) bridged"),
    "table records dropped": Fault(_table_dropped, "drop-out"),
    "a stuck axis": Fault(
        _stuck, "the axis is stuck|never changes|not the same rate", "allan|calibrate"
    ),
    "a frozen logger": Fault(_frozen, "a logger that froze", "navigate", still=True),
    "quantised data": Fault(_quantised, "distinct values only", "navigate", still=True),
    "clipped samples": Fault(_clipped, r"\d+ samples at or past the range"),
    "means read as instants": Fault(_means, r"\[imu\] sampling"),
}


def judge(name: str, seed: int, folder: Path, call=rotcli) -> str | None:
    """Make one fault and run its command; return None when it tells, else what happened."""
    fault, rng = FAULTS[name], np.random.default_rng(seed)
    lines = commands(folder, still=fault.still)
    command = fault.command.split("|")[seed % len(fault.command.split("|"))]
    run = clean(fault.imu, fault.rate, seed, still=fault.still)
    if command == "full":
        write(run, folder)
        made = call(lines["calibrate"])
        if made.returncode:
            return made.stderr
    fault.change(run, rng)
    write(run, folder)
    done = call(lines[command])
    told = re.search(fault.says, done.stderr)
    one_line = done.returncode == 0 or len(re.findall("error:", done.stderr)) == 1
    refused = bool(fault.status) or done.returncode == 0 or "error" in done.stderr
    ok = told and one_line and refused and (not fault.status or done.returncode == fault.status)
    return None if ok and "Traceback" not in done.stderr else f"{done.returncode}: {done.stderr}"


def alarms(seed: int, folder: Path, call=rotcli) -> list[str]:
    """Run every command on a clean log; return the warnings and errors, of which none is right."""
    imu = ("nav440", "mti-g")[seed % 2]
    rate = (10.0, -30.0, 60.0, 100.0)[seed // 2 % 4]
    still = seed % 5 == 4
    write(clean(imu, rate, seed, still=still), folder)
    names = ["navigate", "observe", "allan"] if still else ["calibrate", "full", "observe"]
    found = []
    for name in names:
        done = call(commands(folder, still=still)[name])
        found += [line for line in done.stderr.splitlines() if _is_alarm(line)]
    return found


# What is said of a short log rightly: it is not a fault.
_RIGHT = ("less than one", "no calibration of the gyros", "trend", "record", "scale factor and")


def _is_alarm(line: str) -> bool:
    told = "warning:" in line or "error:" in line or "Traceback" in line
    return told and not any(text in line for text in _RIGHT)
