"""Find why no signs of the table's axes explain the readings, and the axis or sensor at fault.

Called when a log and its rig contradict each other. Each cause leaves its own mark: a dead sensor
does not vary where the motion demands it; a dead encoder lets the gyros turn while the log is
still; exchanged axes fit in another order; a reversed sensor fits a mirror image of one triad.
"""

from dataclasses import replace
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.triad import parameters as p
from rotcli.models.triad.blocks import Blocks
from rotcli.models.triad.kinematics import Pose, Table, motion
from rotcli.rig.rig import TableSettings
from rotcli.rig.values import AXIS_COLUMNS
from rotcli.triad.residuals import CHANNELS
from rotcli.triad.table.signs import MAX_MISFIT, SignCheck, check_signs
from rotcli.units import DEG, FloatArray

BoolArray = NDArray[np.bool_]

_DEAD = 0.02  # of the expected scatter of the block means: a scale factor is not that wrong
_MIN_SCATTER = 0.1  # of the RMS of the triad: less is expected of a channel that hardly moves
_TURNING = 3.0 * DEG  # rad/s, far above biases and far below the rates of a calibration
_MIN_SHARE = 0.03  # of the blocks, for a cause that concerns blocks of one kind
_MAX_LAG = 60.0  # s searched; clocks started by hand
_LAG_MISFIT = 0.1  # of the RMS rate: blocks of 0.5 s smear the ramps
_FREE_MISFIT = 0.15  # of the RMS reading, after a regression on all three axes


@dataclass(frozen=True, eq=False)
class _Data:
    """Model rates and forces (3, n) of the rig, blocks, its angle columns and time offset (s)."""

    table: Table
    blocks: Blocks
    rates: FloatArray
    forces: FloatArray
    columns: tuple[str, ...]
    time_offset: float

    @property
    def readings(self) -> FloatArray:
        """Block means (6, n), gyros first."""
        return self.blocks.means

    def share(self, which: BoolArray) -> float:
        """Return the share of the samples in some blocks."""
        return float(np.average(which, weights=self.blocks.count))


def diagnose(table: Table, blocks: Blocks, check: SignCheck, settings: TableSettings) -> str:
    """Return what contradicts the rig, and what to do; settings: [table] of the rig."""
    zero = np.zeros(p.count(table.mounting_count))
    moved = motion(
        Pose(table, zero, blocks.angles[:, 0], blocks.mounting),
        zero, blocks.rates[:, 0], 0.0 * blocks.rates[:, 0],
    )  # fmt: skip
    names = AXIS_COLUMNS[table.axis_count]
    named = tuple(str(settings.columns.get(name, name)) for name in names)
    data = _Data(
        table, blocks, moved.table_rate + moved.earth_rate, moved.force, named, settings.time_offset
    )
    for cause in (_dead_channel, _silent_encoder, _shifted_clock, _other_order, _odd_sensor):
        text = cause(data)
        if text:
            return text
    return (
        f"no signs of the table's axes explain the readings (misfit {check.best.misfit:.0%})"
        f"{_worst_axis(data)}; check [table] axes, the units and the time offset"
    )


def _dead_channel(data: _Data) -> str:
    """Return the channel that does not vary although the motion demands it."""
    for k, name in enumerate(CHANNELS):
        expected = data.rates[k] if k < 3 else data.forces[k - 3]
        triad = data.rates if k < 3 else data.forces
        scatter = float(np.std(expected))
        if scatter < _MIN_SCATTER * float(np.sqrt(np.mean(triad**2))):
            continue
        if float(np.std(data.readings[k])) < _DEAD * scatter:
            return (
                f"{name} does not change although the table turns; the sensor is dead, or "
                "[imu] columns names a wrong column"
            )
    return ""


def _turning(data: _Data) -> tuple[BoolArray, BoolArray]:
    """Return which blocks (n,) turn by the gyros and which by the table log."""
    gyro, table = (np.linalg.norm(v, axis=0) for v in (data.readings[:3], data.rates))
    return gyro > _TURNING, table > _TURNING


def _silent_encoder(data: _Data) -> str:
    """Return the axis whose angle is constant while the gyros turn."""
    gyro, table = _turning(data)
    alone = gyro & ~table
    constant = [k for k, a in enumerate(data.blocks.angles[:, 0]) if np.ptp(a) < DEG]
    if not constant or data.share(alone) < _MIN_SHARE:
        return ""
    which = " and ".join(f"{k + 1} (column {data.columns[k]})" for k in constant)
    time = data.blocks.time[alone]
    rate = float(np.linalg.norm(data.readings[:3, alone], axis=0).max()) / DEG
    return (
        f"the gyros read up to {rate:.3g} deg/s between {time[0]:.5g} and {time[-1]:.5g} s while "
        f"the table log is still, and its axis {which} never moves; check that encoder, and "
        "[table] columns"
    )


def _shifted_clock(data: _Data) -> str:
    """Return the time by which the gyros' size of rate follows that of the table log."""
    gyro, table = (np.linalg.norm(v, axis=0) for v in (data.readings[:3], data.rates))
    time = data.blocks.time
    size = float(np.sqrt(np.mean(gyro**2)))

    def misfit(lag: float) -> float:
        inside = (time - lag > time[0]) & (time - lag < time[-1])
        left = gyro[inside] - np.interp(time[inside] - lag, time, table)
        return float(np.sqrt(np.mean(left**2)))

    lag = 0.0
    for reach, step in ((_MAX_LAG, 0.25), (0.25, 0.01)):
        steps = lag + np.arange(-reach, reach + 0.5 * step, step)
        lag = float(min(steps, key=lambda k: misfit(float(k))))
    if misfit(lag) > _LAG_MISFIT * size or misfit(lag) > 0.5 * misfit(0.0):
        return ""
    offset = data.time_offset + lag
    return (
        f"the gyros turn {abs(lag):.2f} s {'after' if lag > 0 else 'before'} the table log; set "
        f"[table] time_offset = {offset:.2f}"
    )


def _other_order(data: _Data) -> str:
    """Return the order of columns or axes that explains the readings."""
    count = data.table.axis_count
    names = AXIS_COLUMNS[count]
    for order in permutations(range(count)):
        at = list(order)
        if at == sorted(at):
            continue
        b = data.blocks
        columns = replace(
            b, angles=b.angles[at], rates=b.rates[at], accelerations=b.accelerations[at]
        )
        if _fits(check_signs(data.table, columns)):
            listed = ", ".join(f'{n} = "{data.columns[k]}"' for n, k in zip(names, at, strict=True))
            return (
                "the angle columns of the table log are in another order; set [table] columns = "
                f"{{ {listed} }}"
            )
        axes = replace(data.table, axes=data.table.axes[at])
        if _fits(check_signs(axes, b)):
            rows = [[float(f"{v:.6g}") for v in row] for row in axes.axes]
            return f"the axes of the table are in another order; set [table] axes = {rows}"
    return ""


def _fits(check: SignCheck) -> bool:
    return check.best.misfit < MAX_MISFIT


def _regression(reading: FloatArray, model: FloatArray) -> tuple[FloatArray, float]:
    """Return A (3, 3) of reading = A model + offset, and the misfit relative to the reading."""
    rows = np.vstack([model, np.ones(model.shape[1])]).T
    found = np.linalg.lstsq(rows, reading.T, rcond=None)[0]
    left = reading.T - rows @ found
    return np.asarray(found[:3].T), float(np.sqrt(np.sum(left**2) / np.sum(reading**2)))


def _odd_sensor(data: _Data) -> str:
    """Return the sensor that is reversed or exchanged against the other triad."""
    angles, rates = data.blocks.angles[:, 0], data.blocks.rates[:, 0]
    zero = np.zeros(p.count(data.table.mounting_count))
    best: tuple[float, FloatArray, FloatArray] | None = None
    for signs in product((1.0, -1.0), repeat=data.table.axis_count):
        s = np.array(signs)[:, None]
        pose = Pose(data.table, zero, s * angles, data.blocks.mounting)
        moved = motion(pose, zero, s * rates, 0.0 * rates)
        A, gyro = _regression(data.readings[:3], moved.table_rate + moved.earth_rate)
        B, accel = _regression(data.readings[3:], moved.force)
        if best is None or gyro + accel < best[0]:
            best = (gyro + accel, A, B)
    assert best is not None
    if best[0] > 2.0 * _FREE_MISFIT:
        return ""
    odd, base = (best[1], "gyro"), (best[2], "accel")
    if np.linalg.det(odd[0]) > 0.0 > np.linalg.det(base[0]):
        odd, base = base, odd
    D = _signed_permutation(odd[0]) @ _signed_permutation(base[0]).T
    parts = []
    for i, row in enumerate(D):
        j = int(np.argmax(np.abs(row)))
        if j != i:
            parts.append(f"{odd[1]}_{'xyz'[i]} measures along {base[1]}_{'xyz'[j]}")
        elif row[j] < 0.0:
            parts.append(f"{odd[1]}_{'xyz'[i]} is reversed against {base[1]}_{'xyz'[j]}")
    if not parts:
        return ""
    return f"{', '.join(parts)}; check [imu] columns, and reverse signs by [imu] scale"


def _signed_permutation(A: FloatArray) -> FloatArray:
    """Return the signed permutation (3, 3) closest to A."""
    order = max(permutations(range(3)), key=lambda o: sum(abs(A[i, o[i]]) for i in range(3)))
    found = np.zeros((3, 3))
    for i, j in enumerate(order):
        found[i, j] = np.sign(A[i, j]) or 1.0
    return found


def _worst_axis(data: _Data) -> str:
    """Return which axis contradicts its gyro rate most, empty for a table of one axis."""
    rates = np.abs(data.blocks.rates[:, 0])
    total = rates.sum(axis=0)
    gyro = np.linalg.norm(data.readings[:3], axis=0)
    worst, ratio = -1, 1.0
    for k in range(data.table.axis_count):
        alone = (rates[k] > _TURNING) & (rates[k] > 0.99 * total)
        if alone.sum() < 3:
            continue
        found = float(np.median(gyro[alone] / rates[k][alone]))
        if abs(np.log(max(found, 1e-9))) > abs(np.log(ratio)):
            worst, ratio = k, max(found, 1e-9)
    if worst < 0 or abs(np.log(ratio)) < 0.1:
        return ""
    return f": where only axis {worst + 1} turns the gyros read {ratio:.3g} times its rate"
