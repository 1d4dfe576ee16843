"""The validated records that everything above works on: SI arrays, regular in time.

`rotcli.logs.imu` makes them from files; simulations and tests make them directly. A record may be
trusted: finite values, one constant sample interval, increasing time.

A log of days need not be in memory: `ImuSource` is the interface of a record and of a stream of
one (`rotcli.logs.stream`); code that asks it for pieces works on logs of any length.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import field, replace
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.files.channels import AXES
from rotcli.units import FloatArray, show_time

LATE_CLOCK = 1e6  # s; a clock that starts later is an epoch's, not the run's own
Sampling = Literal["instant", "average"]
Progress = Callable[[float], None]

CHUNK_SAMPLES = 100_000  # samples worked on at a time: 17 min at 100 Hz, 6 MB of numbers


class ImuSource(Protocol):
    """An IMU log that can be had piece by piece: an `ImuLog`, or a stream too long to hold.

    Spans are slices of its samples. time: s; only the first and the last may be there.
    """

    @property
    def path(self) -> str: ...  # noqa: D102
    @property
    def interval(self) -> float: ...  # noqa: D102
    @property
    def sampling(self) -> Sampling: ...  # noqa: D102
    @property
    def rows(self) -> int: ...  # noqa: D102
    @property
    def warnings(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def time(self) -> FloatArray: ...  # noqa: D102
    @property
    def samples(self) -> int: ...  # noqa: D102
    @property
    def stamp(self) -> tuple[int, int] | None: ...  # noqa: D102
    @property
    def channels(self) -> tuple[str, ...]: ...  # noqa: D102

    def between(self, start: float, end: float) -> slice:
        """Return the span of the samples whose time lies within [start, end] (s)."""

    def within(self, start: float, end: float) -> slice:
        """Return the span of the samples that speak of [start, end] (s) and of nothing else."""

    def times(self, span: slice) -> FloatArray:
        """Return the times (k,) of a span, s."""

    def crop(self, start: float, end: float) -> "ImuLog":
        """Return the samples within [start, end] (s) as a log in memory."""

    def chunks(self, span: slice) -> "Iterator[ImuLog]":
        """Yield the logs of a span that follow one another, about PIECE samples each."""

    def fill(self, out: FloatArray, name: str, span: slice) -> None:
        """Write one axis, `gyro_x` … `accel_z`, of a span into out (k,), rad/s or m/s^2."""


def epoch_clock_hint(wanted: tuple[float, float], there: tuple[float, float]) -> str:
    """Return a hint for a segment (s) that misses a log on an epoch's clock, else nothing.

    >>> epoch_clock_hint((0.0, 60.0), (1.7e9, 1.7e9 + 420.0))
    ' (the times are on the clock of the log, which starts at 1700000000 s)'
    >>> epoch_clock_hint((400.0, 460.0), (0.0, 300.0))
    ''
    """
    if there[0] < LATE_CLOCK or (wanted[0] <= there[1] and wanted[1] >= there[0]):
        return ""
    return f" (the times are on the clock of the log, which starts at {show_time(there[0])} s)"


@dataclass(frozen=True, eq=False)
class ImuLog:
    """An IMU log in the sensor frame s.

    time: (n,) s, on the log's own clock, equally spaced by `interval`.
    gyro: (n, 3) rad/s. accel: (n, 3) m/s^2 (specific force).
    sampling: what a sample means: the value at its time stamp, or the mean over the interval
        that ends there. (Logged increments are divided by the interval: they are averages.)
    missing: (n,) bool, True where the logger lost the sample and it was interpolated.
    path: the file it came from, for messages and provenance; rows: the records in that file.
    warnings: what a user must know about the log (bridged gaps, jitter, clipped samples).
    stamp: size and time of change of the file when it was read (in the other records, too).
    channels: the axes that the file contains; the others are 0.
    extras: optional channels that the log contains, (n,) each, such as `temperature`, degC.
    """

    path: str
    time: FloatArray
    gyro: FloatArray
    accel: FloatArray
    interval: float
    sampling: Sampling = "instant"
    missing: NDArray[np.bool_] | None = None
    rows: int = 0
    warnings: tuple[str, ...] = ()
    stamp: tuple[int, int] | None = None
    channels: tuple[str, ...] = AXES
    extras: Mapping[str, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.time)
        if self.gyro.shape != (n, 3) or self.accel.shape != (n, 3):
            raise ValueError(f"gyro {self.gyro.shape} and accel {self.accel.shape} for {n} times")

    @property
    def samples(self) -> int:
        """How many samples there are, bridged ones counted."""
        return len(self.time)

    @property
    def temperature(self) -> FloatArray | None:
        """The temperature (n,), degC, or None."""
        return self.extras.get("temperature")

    def between(self, start: float, end: float) -> slice:
        """Return the slice of the samples whose time lies within [start, end] (s).

        Half a sample of tolerance keeps a sample on the limit.
        """
        first = int(np.searchsorted(self.time, start - 0.5 * self.interval))
        last = int(np.searchsorted(self.time, end + 0.5 * self.interval))
        return slice(first, last)

    def within(self, start: float, end: float) -> slice:
        """Return the slice of the samples that speak of [start, end] (s) and of nothing else.

        A mean over an interval that began before the start is left out.
        """
        kept = self.between(start, end)
        return slice(kept.start + (self.sampling == "average"), kept.stop)

    def crop(self, start: float, end: float) -> "ImuLog":
        """Return the log's samples within [start, end] (s)."""
        return self._part(self.between(start, end))

    def times(self, span: slice) -> FloatArray:
        """Return the times (k,) of a span, s."""
        return self.time[span]

    def chunks(self, span: slice) -> "Iterator[ImuLog]":
        """Yield the logs of a span that follow one another, at most PIECE samples each."""
        for first in range(span.start, span.stop, CHUNK_SAMPLES):
            yield self._part(slice(first, min(first + CHUNK_SAMPLES, span.stop)))

    def column(self, name: str) -> FloatArray:
        """Return one axis, `gyro_x` … `accel_z`, (n,), rad/s or m/s^2, or an optional channel.

        Raises LogError for a channel that the log does not contain.
        """
        if name not in AXES:
            if name not in self.extras:
                raise LogError(self.path, f"no {name} column; set [imu] columns {name}")
            return self.extras[name]
        values = self.gyro if name.startswith("gyro") else self.accel
        return values[:, "xyz".index(name[-1])]

    def fill(self, out: FloatArray, name: str, span: slice) -> None:
        """Write one axis, `gyro_x` … `accel_z`, of a span into out (k,), rad/s or m/s^2."""
        out[:] = self.column(name)[span]

    def _part(self, kept: slice) -> "ImuLog":
        return replace(
            self,
            time=self.time[kept],
            gyro=self.gyro[kept],
            accel=self.accel[kept],
            missing=None if self.missing is None else self.missing[kept],
            extras={name: values[kept] for name, values in self.extras.items()},
        )


def joined(pieces: Iterable[ImuLog]) -> ImuLog:
    """Return the one log of pieces (one at least) that follow one another."""
    parts = list(pieces)
    if len(parts) == 1:
        return parts[0]
    lost = None
    if any(part.missing is not None for part in parts):
        lost = np.concatenate(
            [np.zeros(len(p.time), dtype=bool) if p.missing is None else p.missing for p in parts]
        )
    return replace(
        parts[0],
        time=np.concatenate([part.time for part in parts]),
        gyro=np.concatenate([part.gyro for part in parts]),
        accel=np.concatenate([part.accel for part in parts]),
        missing=lost,
        extras={
            name: np.concatenate([part.extras[name] for part in parts])
            for name in parts[0].extras
            if all(name in part.extras for part in parts)
        },
    )


def align_chunks(pieces: Iterable[ImuLog], size: int) -> Iterator[ImuLog]:
    """Yield the pieces cut so that each except the last is complete blocks of `size` samples."""
    left: list[ImuLog] = []
    for piece in pieces:
        log = joined([*left, piece])
        count = len(log.time) // size * size
        if count:
            yield log._part(slice(0, count))
        left = [log._part(slice(count, len(log.time)))] if count < len(log.time) else []
    yield from left


@dataclass(frozen=True, eq=False)
class TableLog:
    """The log of one table axis.

    time: (m,) s, on the IMU's clock (the rig's `time_offset` is added), increasing; as logged,
        so not exactly regular.
    angle: (m,) rad, unwrapped, right-handed about the rig's axis (its `direction` is applied).
    interval: s, the median spacing.
    """

    path: str
    time: FloatArray
    angle: FloatArray
    interval: float
    rows: int = 0
    warnings: tuple[str, ...] = ()
    stamp: tuple[int, int] | None = None


@dataclass(frozen=True, eq=False)
class ReferenceLog:
    """Reference position and velocity (GNSS, Doppler log, truth), whichever columns were there.

    time: (m,) s. values: name (`latitude`, `longitude` in rad, `height` in m, `v_east`,
    `v_north`, `v_up` in m/s) to (m,) array.
    """

    path: str
    time: FloatArray
    values: dict[str, FloatArray] = field(default_factory=dict)
    rows: int = 0
    warnings: tuple[str, ...] = ()
    stamp: tuple[int, int] | None = None


@dataclass(frozen=True)
class Segment:
    """A segment of a log in which the table is still or turns at one constant rate.

    start, end: s, on the log's clock, ramps left out. rate: rad/s, right-handed about the rig's
    axis, from the encoder over the complete segment; 0 when still. angle: rad turned.
    """

    start: float
    end: float
    rate: float = 0.0
    angle: float = 0.0

    @property
    def duration(self) -> float:
        """Length of the segment, s."""
        return self.end - self.start
