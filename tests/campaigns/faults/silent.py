"""Logs that can be read and are wrong: each a sound simulated run with one fault put in.

`FAULTS` names them, with every command to which the fault matters and what it must say; `judge`
makes the run and gives it to the command. `alarms` gives clean logs to the same commands.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rotcli.units import DEG, STANDARD_GRAVITY
from tests.campaigns.faults.runs import Run, clean, columns, commands, rotcli, write

GYRO, ACCEL = slice(1, 4), slice(4, 7)


@dataclass(frozen=True)
class Fault:
    """How a run is spoilt, and what each command must say: a pattern with the advice."""

    change: Callable[[Run, np.random.Generator], None]
    says: dict[str, str]


def _scaled(part: slice, factor: float) -> Callable[[Run, np.random.Generator], None]:
    def change(run: Run, _: np.random.Generator) -> None:
        for name in columns(run.imu, part):
            run.imu[name] = run.imu[name] * factor

    return change


def _swapped(part: slice, order: tuple[int, int, int], signs=(1, 1, 1)):
    def change(run: Run, _: np.random.Generator) -> None:
        names = columns(run.imu, part)
        before = [run.imu[name] for name in names]
        for name, source, sign in zip(names, order, signs, strict=True):
            run.imu[name] = sign * before[source]

    return change


def _other_way(run: Run, _: np.random.Generator) -> None:
    run.rig["table"] = {**run.rig.get("table", {}), "direction": -1}


def _stamps(log: str, factor: float):
    def change(run: Run, _: np.random.Generator) -> None:
        before = getattr(run, log)
        before["time [s]"] = before["time [s]"] * factor

    return change


def _offset(run: Run, rng: np.random.Generator) -> None:
    run.table["time [s]"] = run.table["time [s]"] + rng.choice([-1, 1]) * rng.uniform(0.015, 0.2)
    stages = run.rig["stages"]  # so that both logs hold them all the same
    stages["static"] = [0.5, 11.5]
    stages["navigation"] = [stages["navigation"][0], stages["navigation"][1] - 0.5]


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
    run.rig = {**run.rig, "stages": other.rig["stages"]}


def _means(run: Run, _: np.random.Generator) -> None:
    name = columns(run.imu, GYRO)[2]
    before = run.imu[name]
    run.imu[name] = np.concatenate([before[:1], 0.5 * (before[1:] + before[:-1])])


_TURNING = ("calibrate", "navigate", "full", "observe")
_STILL = ("still navigate", "still observe")
_ALL = (*_TURNING, *_STILL, "still allan")


def _in(names: tuple[str, ...], text: str) -> dict[str, str]:
    return dict.fromkeys(names, text)


_FACTOR = r"a factor of 57\.3: .* set \[imu\] units = \{ gyro = "
_UNITS = rf"{_FACTOR}|not the same rate; check the units|check the units of both logs"
_DEG = rf"wrong unit \(set \[imu\] units gyro\)|{_FACTOR}"
_GRAVITY = r"in g\?;? (name|set) the unit|mean specific force at rest .* set \[imu\] units"
_WHERE = r"gravity is \d+\.\d deg from .*\[imu\] mount|check the unit, and the order"
_AXIS = r"about another axis; check \[table\] axis and \[imu\] mount"
_WAY = r"opposite sense; set \[table\] direction = -?1|opposite sense.* the IMU points down"
_MS = r"records per second, expected .* set units time"
_CLOCK = r"by \d+\.\d+ ms .* set \[table\] time_offset"
_TOUCHED = "was disturbed near .*; exclude this part|is not still: .* choose another"
FAULTS: dict[str, Fault] = {
    "deg/s read as rad/s": Fault(
        _scaled(GYRO, 1 / DEG),
        {
            **_in(("calibrate", "full", "observe", "swing"), _UNITS),
            "navigate": f"{_UNITS}|{_DEG}",
            **_in(_STILL, f"{_DEG}|is not still: .* choose another"),
            "still allan": _DEG,
        },
    ),
    "rad/s read as deg/s": Fault(
        _scaled(GYRO, DEG),
        {
            **_in((*_TURNING, "swing"), _UNITS),
            **_in(_STILL, r"probably rad/s"),
        },
    ),
    "g read as m/s^2": Fault(_scaled(ACCEL, 1 / STANDARD_GRAVITY), _in(_ALL, _GRAVITY)),
    "mg read as m/s^2": Fault(
        _scaled(ACCEL, 1e3 / STANDARD_GRAVITY),
        {
            **_in(("calibrate", "navigate", "full", "observe", *_STILL), "check the unit"),
            "still allan": r"set \[imu\] units = . accel = .mg. .",
        },
    ),
    "accelerometer axes swapped": Fault(
        _swapped(ACCEL, (2, 0, 1)), _in(("navigate", "full", "observe", *_STILL), _WHERE)
    ),
    "accelerometer axes flipped": Fault(
        _swapped(ACCEL, (0, 1, 2), (-1, 1, -1)),
        _in(("calibrate", "navigate", "full", "observe", *_STILL), r"gravity is 1[78]\d"),
    ),
    "gyro axes swapped": Fault(_swapped(GYRO, (2, 0, 1)), _in((*_TURNING, "swing"), _AXIS)),
    "gyro axes flipped": Fault(
        _swapped(GYRO, (0, 1, 2), (1, -1, -1)), _in((*_TURNING, "swing"), _WAY)
    ),
    "table turning the other way": Fault(_other_way, _in((*_TURNING, "swing"), _WAY)),
    "IMU stamps in ms read as s": Fault(_stamps("imu", 1e3), _in(_ALL, _MS)),
    "table stamps in ms read as s": Fault(
        _stamps("table", 1e3),
        {
            **_in(("calibrate", "navigate", "full"), f"{_MS}|or the unit of its stamps"),
            "observe": _MS,
        },
    ),
    "stamps in s read as ms": Fault(_stamps("imu", 1e-3), _in(_ALL, _MS)),
    "clocks offset by more than a sample": Fault(_offset, _in((*_TURNING, "swing"), _CLOCK)),
    "a still segment touched": Fault(
        _touched,
        {
            **_in(("calibrate", "navigate", "observe", *_STILL), _TOUCHED),
            "still allan": r"motion \(.* excluded",
        },
    ),
    "a calibration of another unit": Fault(
        _other_unit, {"full": r"made for the IMU .* calibrate this unit, or correct \[imu\] name"}
    ),
    "a calibration of another day": Fault(
        _other_bias, {"full": "on average after correction.*calibrate again"}
    ),
    "a calibration of another rate": Fault(
        _other_rate, {"full": "made at 30 deg/s.* calibrate at that rate"}
    ),
    "Earth rate without azimuth": Fault(
        _no_azimuth,
        {
            "calibrate": "azimuth: missing; .*add it to the rig",
            **_in(("navigate", "full", "still navigate"), "taken as 0 .north.*add it"),
            **_in(("observe", "still observe"), "azimuth is missing; 0 deg is assumed"),
        },
    ),
    "samples dropped in bursts": Fault(
        _dropped, _in(_ALL, r"gaps? \(\d+ samples?\), first after .* exclude these parts")
    ),
    "table records dropped": Fault(
        _table_dropped, _in(_TURNING, "gaps? in the table log.* exclude this part")
    ),
    "a stuck axis": Fault(
        _stuck,
        {
            **_in(_TURNING, f"is constant|do not sense|{_UNITS}|{_GRAVITY}|{_WHERE}"),
            **_in(_STILL, f"is constant|{_GRAVITY}|{_WHERE}"),
            "still allan": "is constant|are constant; exclude this axis",
        },
    ),
    "a frozen logger": Fault(_frozen, _in(_ALL, "logger stopped; exclude this part|is not still")),
    "quantised data": Fault(_quantised, _in(_ALL, "only .* distinct values.* log more digits")),
    "clipped samples": Fault(
        _clipped,
        _in(
            _TURNING, r"samples at or past the range .* exclude this part|are clipped at gyro_range"
        ),
    ),
    "means read as instants": Fault(_means, _in(_TURNING, r"\[imu\] sampling")),
}
# Every fault and each command to which it matters.
CASES = [(name, command) for name, fault in FAULTS.items() for command in fault.says]


def judge(name: str, command: str, seed: int, folder: Path, call=rotcli) -> str | None:
    """Make one fault and run a command; return None when it reports, else what happened."""
    fault, rng = FAULTS[name], np.random.default_rng(seed)
    suffix = ("parquet", "csv")[seed % 2]
    lines = commands(folder, suffix)
    kind = command.split()[0]
    motion = kind if kind in ("still", "swing") else "turning"
    run = clean("nav440", 30.0, seed, motion=motion)
    if command == "full":
        write(run, folder, suffix)
        made = call(lines["calibrate"])
        if made.returncode:
            return made.stderr
    fault.change(run, rng)
    write(run, folder, suffix)
    done = call(lines[command])
    reported = [line for line in done.stderr.splitlines() if is_alarm(line)]
    errors = [line for line in reported if line.startswith("rotcli: error: ")]
    sound = len(errors) == done.returncode and done.returncode in (0, 1)
    if sound and any(re.search(fault.says[command], line) for line in reported):
        return None
    return f"{done.returncode}: {done.stderr or 'not a word'}"


def alarms(seed: int, folder: Path, call=rotcli) -> list[str]:
    """Run every command on a clean log; return the warnings and errors, of which none is right.

    The seed decides the IMU, the axis, the rate, the attitude, what a sample means, the lever arm,
    the motion and the kind of file.
    """
    rng = np.random.default_rng(seed)
    suffix = ("parquet", "csv", "csv.gz")[seed % 3]
    motion = ("turning", "rates", "still", "swing")[seed // 2 % 4]
    rig = {
        "attitude": {
            "pitch": float(rng.choice([0.0, 10.0, -30.0])),
            "roll": float(rng.choice([0.0, 5.0, -20.0])),
            "azimuth": float(rng.choice([0.0, 45.0, 200.0])),
        },
        "imu": {
            "sampling": str(rng.choice(["instant", "average", "increment"])),
            "lever_arm": [0.1, 0.05, 0.0] if rng.random() < 0.3 else [0.0, 0.0, 0.0],
        },
        "table": {"axis": "xyz"[rng.integers(3)], "direction": int(rng.choice([1, -1]))},
    }
    rate = float(rng.choice([10.0, -20.0, 30.0, -60.0, 100.0]))
    write(clean(("nav440", "mti-g")[seed % 2], rate, seed, motion=motion, **rig), folder, suffix)
    names = {
        "still": ["still navigate", "still observe", "still allan"],
        "swing": ["calibrate", "observe"],
    }.get(motion, ["calibrate", "full", "observe"])
    found = []
    for name in names:
        done = call(commands(folder, suffix)[name])
        found += [f"{name}: {line}" for line in done.stderr.splitlines() if is_alarm(line)]
    return found


def is_alarm(line: str) -> bool:
    """Return whether a line on standard error is a warning, an error or worse."""
    return any(word in line for word in ("warning:", "Warning", "error:", "Traceback"))
