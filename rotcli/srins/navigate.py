"""Run the level-channel mechanization over a long log and subtract GNSS from it.

IMU chunks become increments over blocks of about a second; only the blocks stay in memory.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.errors import LogError, RigError
from rotcli.logs import plausible
from rotcli.logs.record import ImuSource, ReferenceLog, TableLog
from rotcli.models import earth, rotation
from rotcli.rig.rig import TableSettings
from rotcli.run.alignment.checks import check_lag
from rotcli.run.checks import judge
from rotcli.run.evidence.gravity import check_gravity
from rotcli.run.findings import texts
from rotcli.srins import level_ins
from rotcli.srins.level_ins import LevelIncrements, LevelSolution, LevelState, mechanize
from rotcli.srins.model import Damping
from rotcli.units import DEG, FloatArray, format_span, wrap_pi

BLOCK = 1.0  # s, or the nearest number of samples
_SAME_START = 60.0  # s, within which GNSS must begin
_HEADING_LIMIT = 3.0 * DEG


class Piece(Protocol):
    """Consecutive samples of an IMU log."""

    @property
    def time(self) -> FloatArray: ...  # noqa: D102
    @property
    def gyro(self) -> FloatArray: ...  # noqa: D102
    @property
    def accel(self) -> FloatArray: ...  # noqa: D102
    @property
    def interval(self) -> float: ...  # noqa: D102


def preintegrate_log(pieces: Iterable[Piece], *, averages: bool) -> tuple[LevelIncrements, float]:
    """Return the increments of the blocks and where the first begins (s on the log's clock).

    averages: samples are means over the interval they end, else instants.
    """
    parts: list[LevelIncrements] = []
    kept_gyro = kept_accel = np.empty((0, 3))
    start, end, samples = 0.0, 0.0, 0
    for piece in pieces:
        if not samples:
            samples = max(1, round(BLOCK / piece.interval))
            start = float(piece.time[0]) - piece.interval * averages
        gyro = np.concatenate([kept_gyro, piece.gyro])
        accel = np.concatenate([kept_accel, piece.accel])
        sum_over = level_ins.preintegrate_means if averages else level_ins.preintegrate_instants
        part = sum_over(gyro, accel, piece.interval, samples)
        used = len(part) * samples
        kept_gyro, kept_accel = gyro[used:].copy(), accel[used:].copy()
        left = len(kept_gyro) - (not averages)
        end = float(piece.time[-1]) - left * piece.interval
        parts.append(part)
    increments = LevelIncrements.join(parts)
    return replace(increments, duration=(end - start) / max(len(increments), 1)), start


@dataclass(frozen=True, eq=False)
class SrinsRun:
    """A mechanized log. time: (n + 1,) s at the blocks' edges; block: s."""

    time: FloatArray
    block: float
    solution: LevelSolution
    damping: Damping
    warnings: tuple[str, ...] = ()

    def since(self, moment: float) -> "SrinsRun":
        """Return the run from a moment (s on the log's clock) on."""
        k = int(np.clip(round((moment - self.time[0]) / self.block), 0, len(self.time) - 1))
        s = self.solution
        part = LevelSolution(
            s.velocity[:, k:], s.latitude[k:], s.longitude[k:], s.u[:, k:], s.q_ns[:, k:]
        )
        return replace(self, time=self.time[k:], solution=part)


def navigate_level(
    increments: LevelIncrements,
    start: float,
    table: TableLog,
    attitude: tuple[float, float, float],
    gnss: ReferenceLog,
    speed: ReferenceLog | None,
    damping: Damping,
) -> SrinsRun:
    """Mechanize the increments from `start` (s), beginning at the first GNSS epoch's position.

    attitude: pitch, roll, azimuth of the body at the start, rad. speed: the Doppler log; without
    one GNSS velocity is the reference.

    Raises LogError where a log does not cover the run or lacks columns, RigError where the
    gyros contradict the table.
    """
    _require_columns(gnss, "v_east", "v_north", "latitude", "longitude")
    reference = gnss if speed is None else speed
    _require_columns(reference, "v_east", "v_north")
    n = len(increments)
    time = start + increments.duration * np.arange(n + 1, dtype=float)
    _check_coverage(table.path, table.time, time)
    for log in {gnss.path: gnss, reference.path: reference}.values():
        _check_coverage(log.path, log.time, time)
    first = int(np.searchsorted(gnss.time, start - 0.5 * increments.duration))
    theta = float(np.interp(start, table.time, table.angle))
    up = np.array([0.0, 0.0, 1.0])
    C_bs = rotation.rotate_about(up, np.full(3, theta), np.eye(3)).T
    begin = LevelState(
        rotation.quaternion_from_matrix(rotation.attitude_matrix(*attitude) @ C_bs),
        (gnss.values["v_east"][first], gnss.values["v_north"][first]),
        gnss.values["latitude"][first],
        gnss.values["longitude"][first],
    )
    middle = 0.5 * (time[1:] + time[:-1])
    v_ref = np.stack(
        [np.interp(middle, reference.time, reference.values[k]) for k in ("v_east", "v_north")]
    )
    solution = mechanize(increments, begin, v_ref, damping)
    turned = solution.theta - np.interp(time, table.time, table.angle)
    warnings = [*_heading(turned - turned[0], table), *_speed_gaps(reference)]
    return SrinsRun(time, increments.duration, solution, damping, tuple(warnings))


def check_start(
    imu: ImuSource,
    table: TableLog,
    attitude: tuple[float, float, float],
    gnss: ReferenceLog,
    *,
    settings: TableSettings,
) -> tuple[str, ...]:
    """Check that the IMU measures gravity along up and rotates with the table.

    attitude: pitch, roll, azimuth of the body at the start, rad. Returns warnings; raises
    LogError where units or axes must be wrong.
    """
    _require_columns(gnss, "latitude")
    plausible.check_spans(table.path, table.time, table.interval, imu.time)
    up = np.array([0.0, 0.0, 1.0])
    first = next(iter(imu.chunks(slice(0, imu.samples))))
    angle = np.interp(first.time, table.time, table.angle)
    f_b = rotation.sum_rotated(up, angle, first.accel) / len(angle)
    gravity = float(earth.normal_gravity(gnss.values["latitude"][0], 0.0))
    expected = gravity * rotation.attitude_matrix(*attitude)[2]
    lag = check_lag(imu, table, up, settings=settings)
    return tuple(texts(judge("srins", (*check_gravity(imu, f_b, expected), *lag))))


def _require_columns(log: ReferenceLog, *names: str) -> None:
    missing = [name for name in names if name not in log.values]
    if missing:
        raise LogError(log.path, f"no {', '.join(missing)}; the reference of a long run needs them")


def _check_coverage(path: str, logged: FloatArray, time: FloatArray) -> None:
    """Raise LogError unless a log (n,) s begins and ends with the run."""
    if logged[0] > time[0] + _SAME_START or logged[-1] < time[-1] - _SAME_START:
        raise LogError(
            path,
            f"covers {format_span(logged[0], logged[-1])}, the IMU log "
            f"{format_span(time[0], time[-1])}; give logs of the same run, on one clock",
        )


def _speed_gaps(log: ReferenceLog) -> list[str]:
    """Return a warning about gaps of the speed reference, which are interpolated linearly."""
    steps = np.diff(log.time)
    gaps = np.flatnonzero(steps > max(10.0, 3.0 * float(np.median(steps))))
    if not gaps.size:
        return []
    worst = gaps[np.argmax(steps[gaps])]
    return [
        f"{log.path}: {gaps.size} gap{'s' * (gaps.size > 1)} in the speed reference, longest "
        f"{steps[worst]:.0f} s from {log.time[worst]:.0f} s; interpolated"
    ]


def _heading(turned: FloatArray, table: TableLog) -> list[str]:
    """Judge the difference (n,) rad between gyro heading and table angle over time.

    In a long run the vehicle may turn; a table of the wrong sense differs within one turn.
    """
    hour = turned[: min(len(turned), 3600)]
    if np.ptp(hour) > np.pi:
        raise RigError(
            f"{table.path}: the gyro heading and the table angle differ by "
            f"{np.ptp(hour) / DEG:.0f} deg in the first hour; check [table] direction and units"
        )
    if np.abs(turned).max() > _HEADING_LIMIT:
        return [
            f"{table.path}: the gyro heading and the table angle differ by "
            f"{np.abs(turned).max() / DEG:.1f} deg: the vehicle turned, or a scale factor is off"
        ]
    return []


def gnss_differences(run: SrinsRun, gnss: ReferenceLog) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return INS - GNSS (4, n) summed at the ends of the blocks, and the epochs (n,) there.

    `[dV_E, dV_N, d_latitude, d_longitude]`, m/s and rad; the INS is interpolated to each epoch,
    which counts for the nearest block's end.
    """
    block, n = run.block, len(run.time) - 1
    inside = (gnss.time > run.time[0] + 0.5 * block) & (gnss.time < run.time[-1] + 0.5 * block)
    time = np.minimum(gnss.time[inside], run.time[-1])
    s = run.solution
    ours = (*s.velocity, s.latitude, s.longitude)
    names = ("v_east", "v_north", "latitude", "longitude")
    found = np.stack(
        [
            np.interp(time, run.time, x) - gnss.values[name][inside]
            for x, name in zip(ours, names, strict=True)
        ]
    )
    found[3] = wrap_pi(found[3])
    index = np.clip(np.rint((time - run.time[0]) / block).astype(np.int64) - 1, 0, n - 1)
    sums = np.zeros((4, n))
    for total, row in zip(sums, found, strict=True):
        np.add.at(total, index, row)
    return sums, np.bincount(index, minlength=n).astype(np.int64)
