"""Errors of a known size that are put into a clean run, for the power of the checks."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rotcli.logs.record import ImuLog, TableLog
from rotcli.rig.rig import Rig
from rotcli.units import DEG, DEG_PER_HOUR, PPM

HALF_TURNING = 90.0  # s, in the middle of the turning minute
WINDOW = 150.0  # s, in the middle of the navigation


@dataclass
class Run:
    """IMU log, table log and rig of one run, to be changed; rate: rad/s."""

    imu: ImuLog
    table: TableLog
    rig: Rig
    rate: float

    def copy(self) -> "Run":
        """Return a run whose logs can be changed."""
        imu = replace(self.imu, gyro=self.imu.gyro.copy(), accel=self.imu.accel.copy())
        table = replace(self.table, time=self.table.time.copy(), angle=self.table.angle.copy())
        return Run(imu, table, self.rig, self.rate)

    def at(self, start: float, count: int) -> slice:
        """Return the span of `count` samples of the IMU log from a time (s)."""
        first = int(np.searchsorted(self.imu.time, start))
        return slice(first, first + count)


Change = Callable[[Run, float], None]


def drift(run: Run, size: float) -> None:
    run.imu.gyro[:, 0] += size * DEG_PER_HOUR * run.imu.time / 121.0


def step(run: Run, size: float) -> None:
    run.imu.gyro[run.imu.time >= 30.0, 0] += size * DEG_PER_HOUR


def turning_step(run: Run, size: float) -> None:
    run.imu.gyro[run.imu.time >= HALF_TURNING, 0] += size * DEG_PER_HOUR


def sine(order: int) -> Change:
    def change(run: Run, size: float) -> None:
        angle = np.interp(run.imu.time, run.table.time, run.table.angle)
        run.imu.gyro[:, 0] += size * DEG_PER_HOUR * np.sin(order * angle)

    return change


def spike(start: float, samples: int) -> Change:
    def change(run: Run, size: float) -> None:
        run.imu.gyro[run.at(start, samples), 0] += size * DEG

    return change


def accel_spike(run: Run, size: float) -> None:
    run.imu.accel[run.at(WINDOW, 1), 0] += size


def zeros(run: Run, size: float) -> None:
    rows = run.at(HALF_TURNING, int(size))
    run.imu.gyro[rows] = run.imu.accel[rows] = 0.0


def line(run: Run, size: float) -> None:
    first = run.at(HALF_TURNING, 1).start
    last = first + int(size) + 1  # rows between two that were measured
    for values in (run.imu.gyro, run.imu.accel):
        share = np.linspace(0.0, 1.0, last - first + 1)[:, None]
        values[first : last + 1] = values[first] + share * (values[last] - values[first])


def copied(run: Run, size: float) -> None:
    source, target = run.at(70.0, int(size)), run.at(HALF_TURNING, int(size))
    run.imu.gyro[target], run.imu.accel[target] = run.imu.gyro[source], run.imu.accel[source]


def repeated(run: Run, size: float) -> None:
    n = len(run.imu.gyro)
    kept = np.random.default_rng(0).random(n) >= 0.01 * size
    rows = np.maximum.accumulate(np.where(kept, np.arange(n), 0))  # the last one that is kept
    run.imu.gyro[:], run.imu.accel[:] = run.imu.gyro[rows], run.imu.accel[rows]


def ramp_step(run: Run, size: float) -> None:
    run.imu.gyro[run.imu.time < 60.0, 2] += size * PPM * run.rate


def leap(run: Run, size: float) -> None:
    run.table.angle[run.table.time >= HALF_TURNING] += size * DEG


def eccentric(run: Run, size: float) -> None:
    run.table.angle[:] += size * DEG * np.sin(run.table.angle)


def scale(run: Run, size: float) -> None:
    run.imu.gyro[:, 2] *= 1.0 + size * PPM


def noise(run: Run, size: float) -> None:
    mean = run.imu.gyro[:, 0].mean()
    run.imu.gyro[:, 0] = mean + (1.0 + size) * (run.imu.gyro[:, 0] - mean)


def lag(run: Run, size: float) -> None:
    run.table.time[:] += 1e-3 * size


def clock(run: Run, size: float) -> None:
    run.table.time[:] *= 1.0 + size * PPM


def bias(run: Run, size: float) -> None:
    run.imu.gyro[run.imu.time >= 121.0, 0] += size * DEG_PER_HOUR


def accel_bias(run: Run, size: float) -> None:
    run.imu.accel[run.imu.time >= 121.0, 0] += size


def tilt(run: Run, size: float) -> None:
    run.rig = run.rig.override({"attitude": {"pitch": size}})
