"""The gyro rate along the table axis next to the table rate, over tenths of a second."""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.logs.record import ImuSource, TableLog
from rotcli.run.motion import crop_table, encoder_noise
from rotcli.units import DEG, FloatArray

_RATE_BLOCK = 0.1  # s, over which rates are compared
MIN_BLOCKS = 10  # blocks of common time
# times sigma of an angle over the squared block: a slope is the difference of four angles over two
# blocks, of sigma 1; 1e5 blocks exceed 5 of it with a chance of 0.05
_SLOPE_SIGMAS = 5.0
_MIN_TURNING_RATE = 1.0 * DEG  # rad/s: a slower table shows no lag
_MIN_RATE_CHANGE = 0.02  # of the rate: a table at constant rate shows no lag
_MAX_LAG_DURATION = 7200.0  # s of a log that show its lag; of longer ones the liveliest part


@dataclass(frozen=True, eq=False)
class Series:
    """Gyro rates (n,), rad/s, between edges (n + 1,), s, and the table log they belong to."""

    table: TableLog
    edges: FloatArray
    measured: FloatArray
    angle_sigma: float = 0.0

    @property
    def slope_noise(self) -> float:
        """Slope of the table rate (rad/s^2) that the noise of the encoder does not exceed."""
        return _SLOPE_SIGMAS * self.angle_sigma / self.width**2

    @property
    def width(self) -> float:
        """Length of a block, s."""
        return float(self.edges[1] - self.edges[0])

    def rates(self, shift: FloatArray | float) -> FloatArray:
        """Return the table rates (n,), rad/s, between the edges less a shift (s)."""
        return self._rates_between(self.edges - shift)

    def rates_and_slopes(self, shift: FloatArray | float) -> tuple[FloatArray, FloatArray]:
        """Return the rates (n,), and their slopes (n,), rad/s^2, from block before to block after.

        These blocks are next to a block: their noise has nothing in common with the block's own.
        """
        shifted = self.edges - shift
        outer = shifted[0] - self.width, shifted[-1] + self.width
        rates = self._rates_between(np.concatenate([outer[:1], shifted, outer[1:]]))
        return rates[1:-1], (rates[2:] - rates[:-2]) / (2.0 * self.width)

    def _rates_between(self, edges: FloatArray) -> FloatArray:
        angle = np.interp(edges, self.table.time, self.table.angle)
        return np.asarray(np.diff(angle) / self.width)


def rate_series(imu: ImuSource, table: TableLog, axis: FloatArray) -> Series | None:
    """Return the rates that both logs share; None where the table does not change its rate."""
    block = max(2, round(_RATE_BLOCK / imu.interval))
    width = block * imu.interval
    start, end = float(imu.time[0]), float(imu.time[-1])
    noise = encoder_noise(table)
    if end - start > _MAX_LAG_DURATION:
        start, end = _liveliest_part(table, start, end, width)
        table = crop_table(table, start - _MAX_LAG_DURATION, end + _MAX_LAG_DURATION)
    inside = imu.within(start, end)
    count = (inside.stop - inside.start) // block
    if count < MIN_BLOCKS:
        return None
    first = float(imu.times(slice(inside.start, inside.start + 1))[0])
    log = imu.crop(first, first + imu.interval * (count * block - 1))
    measured = (log.gyro @ axis).reshape(count, block).mean(axis=1)
    # A sample represents half an interval to either side, a mean for the interval before it.
    lead = 1.0 if imu.sampling == "average" else 0.5
    edges = first + imu.interval * (block * np.arange(count + 1.0) - lead)
    series = Series(table, edges, measured, noise.sigma)
    rate = series.rates(0.0)
    size = float(np.max(np.abs(rate)))
    if size < _MIN_TURNING_RATE or np.all(np.abs(np.diff(rate)) < _MIN_RATE_CHANGE * size):
        return None
    return series


def _liveliest_part(table: TableLog, start: float, end: float, width: float) -> tuple[float, float]:
    """Return the part (s) between start and end around the largest change of the table rate."""
    largest, at = -1.0, start
    for first in np.arange(start, end, _MAX_LAG_DURATION):
        edges = np.arange(first, min(first + _MAX_LAG_DURATION + 2.0 * width, end), width)
        if len(edges) > 2:
            part = crop_table(table, edges[0] - 1.0, edges[-1] + 1.0)
            if not len(part.time):
                continue
            change = np.abs(np.diff(np.interp(edges, part.time, part.angle), 2))
            if change.max() > largest:
                largest, at = float(change.max()), float(edges[int(np.argmax(change))])
    start = min(max(start, at - 0.5 * _MAX_LAG_DURATION), end - _MAX_LAG_DURATION)
    return start, start + _MAX_LAG_DURATION
