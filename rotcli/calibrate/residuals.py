"""Residuals of a calibration, sample by sample."""

from collections.abc import Iterator

import numpy as np

from rotcli.calibrate.estimate import Calibration
from rotcli.logs.record import ImuSource, TableLog
from rotcli.models.base import FixedBase
from rotcli.run.consistency.blocks import EarthHarmonics
from rotcli.run.table_angle import angle_at
from rotcli.units import FloatArray


def residual_chunks(
    imu: ImuSource, table: TableLog, result: Calibration, base: FixedBase | None
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Yield times (n,), s, table angles (n,), rad, and residuals of the readings (n, 3), rad/s."""
    column, bias = result.values[:3], result.values[3:]
    earth = EarthHarmonics.of(base, result.axis)
    for segment in result.segments:
        for log in imu.chunks(imu.within(segment.start, segment.end)):
            angle = angle_at(table, log.time)
            rate = np.full(len(angle), segment.rate)
            if result.lag is not None:
                rate = np.gradient(angle, imu.interval)
            model = earth.at(np.cos(angle), np.sin(angle)) + np.outer(rate, result.axis + column)
            yield log.time, angle, log.gyro - model - bias
