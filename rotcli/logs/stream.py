"""An IMU log too long to hold, a piece at a time, evenly sampled.

One pass over the file; each piece is put on its own straight clock line, so that a clock may
drift over days. Short gaps, also between pieces, are bridged by straight lines.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.logs.clock import Line, spread, straight_line
from rotcli.logs.columns import Loaded, load_batches, open_log
from rotcli.logs.files import imu_columns, read_times
from rotcli.logs.rig import Rig

Array = NDArray[np.float64]

PIECE = 100_000  # records: 6 MB of numbers


@dataclass(frozen=True, eq=False)
class ImuPiece:
    """Consecutive samples in the sensor frame: time (n,) s, even by `interval`; gyro, accel (n, 3).

    share: of the file read so far.
    """

    time: Array
    gyro: Array
    accel: Array
    interval: float
    share: float


class ImuStream:
    """Read an IMU log piece by piece; what it knows of the whole is there once all were read.

    path, rows, time ((first, last), s) and warnings are those of an `ImuLog`.
    """

    def __init__(self, path: str | Path, rig: Rig, *, max_gap: int = 5) -> None:
        self.header = open_log(path)
        self.path = self.header.path
        self.rig = rig
        self.max_gap = max_gap
        self.rows = 0
        self.time: tuple[float, float] = (0.0, 0.0)
        self._units: list[str] = []
        self._wanted, self._scales = imu_columns(self.header, rig, self._units)
        self._gaps: list[tuple[float, int]] = []
        self._jitter = 0.0
        self._clipped = 0

    @property
    def warnings(self) -> list[str]:
        """What a user must know of the log, of the pieces read so far."""
        told = list(self._units)
        if self._gaps:
            places = ", ".join(f"{time:.6g} s ({lost})" for time, lost in self._gaps[:3])
            more = f" and {len(self._gaps) - 3} more" if len(self._gaps) > 3 else ""
            total = sum(lost for _, lost in self._gaps)
            told.append(
                f"{self.path}: {len(self._gaps)} gaps ({total} samples) bridged, after "
                f"{places}{more}"
            )
        if self._jitter > 0.1:
            told.append(
                f"{self.path}: the time stamps jitter by up to {self._jitter:.2g} of a sample "
                "about an even clock; the even clock was used"
            )
        if self._clipped:
            told.append(f"{self.path}: {self._clipped} samples at or past the gyros' range")
        return told

    def __iter__(self) -> Iterator[ImuPiece]:
        """Yield the pieces in order; raises LogError for what cannot be used."""
        last: tuple[float, Array] | None = None
        for loaded, share in load_batches(self.header, self._wanted, PIECE):
            if loaded.rows < 2:
                continue
            time, values, line = self._even(loaded, last)
            last = float(time[-1]), values[:, -1]
            self.rows += loaded.rows
            self.time = (self.time[0] if self.rows > loaded.rows else float(time[0]), last[0])
            if not np.array_equal(self.rig.imu.mount, np.eye(3)):
                values = np.concatenate(
                    [self.rig.imu.mount.T @ v for v in (values[:3], values[3:])]
                )
            yield ImuPiece(time, values[:3].T, values[3:].T, line.interval, share)

    def _even(self, loaded: Loaded, last: tuple[float, Array] | None) -> tuple[Array, Array, Line]:
        """Return times, values (6, n) on the piece's even clock, gaps bridged, and the clock."""
        time = read_times(loaded, self._scales[0])
        line = straight_line(time)
        if line is None:
            what = "the time stamps keep to no even clock; a long run needs one: resample the log"
            raise LogError(self.path, what, row=loaded.row(0), column="time")
        self._jitter = max(self._jitter, line.largest / line.interval)
        values = np.empty((6, loaded.rows))
        for k in range(6):
            loaded.fill(values[k], k + 1, self._scales[k + 1])
        if self.rig.imu.sampling == "increment":
            values /= line.interval
        limit = self.rig.imu.gyro_range
        if limit is not None:
            self._clipped += int(np.count_nonzero(np.abs(values[:3]).max(axis=0) >= limit))
        lost = np.diff(line.index) - 1
        for i in np.flatnonzero(lost > 0):
            self._bridge(float(time[i]), int(lost[i]), loaded.row(int(i) + 1))
        values, _ = spread(values, line)
        even = line.times()
        if last is None:
            return even, values, line
        between = round(float(even[0] - last[0]) / line.interval) - 1
        if between < 0:
            what = "time goes back; sort the rows by time"
            raise LogError(self.path, what, row=loaded.row(0), column="time")
        if between:
            self._bridge(last[0], between, loaded.row(0))
            share = np.arange(1, between + 1) / (between + 1)
            missing = last[1][:, None] * (1.0 - share) + values[:, :1] * share
            values = np.concatenate([missing, values], axis=1)
            even = np.concatenate([even[0] - line.interval * np.arange(between, 0, -1), even])
        return even, values, line

    def _bridge(self, after: float, lost: int, row: int) -> None:
        if lost > self.max_gap:
            what = (
                f"{lost} samples missing after {after:.6g} s, more than {self.max_gap}; cut the "
                "log there or raise --max-gap"
            )
            raise LogError(self.path, what, row=row, column="time")
        self._gaps.append((after, lost))
