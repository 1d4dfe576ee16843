"""Parts of segments: their rates from the encoder, and the covariance of its errors by hand."""

import numpy as np
import pytest

from rotcli.logs.record import ImuLog, Segment, TableLog
from rotcli.run.consistency.blocks import EarthHarmonics, reduce_segment
from rotcli.run.consistency.goodness import part_means
from rotcli.run.motion import EncoderNoise

DEG = np.pi / 180
Z = np.array([0.0, 0.0, 1.0])
NOTHING = EarthHarmonics.of(None, Z)


def table_of(rates, seconds=21.0):
    """An IMU and a table that turn at each rate (deg/s) for 21 s; segments of 20 s in them."""
    edges = seconds * np.arange(len(rates) + 1)
    angles = np.concatenate([[0.0], np.cumsum(np.array(rates) * DEG * seconds)])
    time = 0.01 * np.arange(round(edges[-1] / 0.01))
    rate = np.repeat(np.array(rates) * DEG, round(seconds / 0.01))
    gyro = np.outer(rate, Z) + 0.001 * np.array([1.0, 2.0, 3.0])
    imu = ImuLog("imu.csv", time, gyro, np.tile([0.0, 0.0, 9.8], (len(time), 1)), 0.01)
    stamps = np.arange(0.0, edges[-1] + 0.01, 0.02)
    table = TableLog("table.csv", stamps, np.interp(stamps, edges, angles), 0.02)
    segments = [
        Segment(a + 0.5, b - 0.5, r * DEG, r * DEG * (b - a - 1.0))
        for a, b, r in zip(edges[:-1], edges[1:], rates, strict=True)
    ]
    return imu, table, segments


def test_rates_and_residuals_are_those_of_the_parts_and_encoder_errors_correlate_neighbours():
    imu, table, segments = table_of([0.0, 30.0, -12.0])
    blocks = [reduce_segment(imu, table, s, Z, 100) for s in segments]
    sigma, encoder = 1e-5, EncoderNoise(0.0, 1e-4, 1e-5)
    late = encoder.time_sigma
    assert late > 0.0
    means = part_means(blocks, table, NOTHING, Z, encoder)
    # Twenty seconds are four parts of five seconds.
    np.testing.assert_allclose(means.rate, np.repeat([0.0, 30.0, -12.0], 4) * DEG, atol=1e-9)
    expected = np.tile(0.001 * np.array([1.0, 2.0, 3.0]), (12, 1))
    np.testing.assert_allclose(means.z, expected, atol=1e-8)
    tau = means.end - means.start
    covariance = np.zeros((12, 12))
    for first, rate in ((4, 30.0), (8, 12.0)):
        edge = sigma**2 + (late * rate * DEG) ** 2  # of one angle; a still table has none
        for k in range(first, first + 4):
            covariance[k, k] = 2.0 * edge / tau[k] ** 2
            if k > first:
                covariance[k, k - 1] = covariance[k - 1, k] = -edge / (tau[k] * tau[k - 1])
    np.testing.assert_allclose(means.rate_covariance, covariance, rtol=2e-3, atol=1e-18)


def test_harmonics_of_the_residuals_are_removed_from_turning_parts_alone():
    imu, table, segments = table_of([0.0, 30.0])
    angle = np.interp(imu.time, table.time, table.angle)
    sines = np.column_stack([np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)])
    size = np.random.default_rng(1).standard_normal((4, 3)) * 1e-4
    moved = ImuLog(imu.path, imu.time, imu.gyro + sines @ size, imu.accel, 0.01)
    blocks = [reduce_segment(moved, table, s, Z, 25) for s in segments]
    means = part_means(blocks, table, NOTHING, Z, EncoderNoise(0.0, 0.0, 0.0), size)
    clean = 0.001 * np.array([1.0, 2.0, 3.0])
    # Blocks of a quarter of a second average the sines over 7.5 deg: 1e-3 of them.
    np.testing.assert_allclose(means.z[4:], np.tile(clean, (4, 1)), atol=1e-6)
    assert means.z[0] == pytest.approx(clean + size[0] + size[2], abs=1e-9)
