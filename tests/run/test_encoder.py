"""Resolution of the encoder, ramps that it shows late, and eccentricity."""

import numpy as np
import pytest

from rotcli.logs.record import ImuLog, Segment, TableLog
from rotcli.run.edges import refine_edges
from rotcli.run.motion import encoder_noise, encoder_step
from rotcli.run.segments import encoder_eccentricity, find_segments
from rotcli.units import DEG
from tests.logs.made_logs import table

UP = np.array([0.0, 0.0, 1.0])


def quantised(step, digits=None, rate=20.0):
    """Return a table log of an encoder's step (deg) and printed digits."""
    log, _ = table([(0, 30), (rate, 40)], acceleration=20.0)
    angle = np.rint(log.angle / DEG / step) * step
    if digits is not None:
        angle = np.round(angle, digits)
    return TableLog("t", log.time, angle * DEG, 0.02)


@pytest.mark.parametrize(("step", "digits"), [(360.0 / 4096, 5), (0.1, 3), (1.0, None)])
def test_the_step_of_an_encoder_is_found_behind_finer_digits(step, digits):
    log = quantised(step, digits)
    assert encoder_step(log.angle) / DEG == pytest.approx(step, rel=0.1)
    assert encoder_noise(log).sigma / DEG == pytest.approx(step / np.sqrt(12), rel=0.1)


def test_the_noise_of_steps_that_are_printed_to_few_digits_is_that_of_the_steps():
    """Printed to 2 decimals, steps of 0.0879 deg are multiples of 0.01 deg."""
    noise = encoder_noise(quantised(360.0 / 4096, 2))
    assert 0.02 < noise.sigma / DEG < 0.08  # 0.0254 for a uniform error
    assert noise.resolution / DEG > 0.044


def test_ideal_ramps_and_fine_encoders_have_no_step():
    ideal, _ = table([(0, 30), (20, 40)])
    assert encoder_step(ideal.angle) == 0.0
    rng = np.random.default_rng(1)
    assert encoder_step(ideal.angle + 1e-6 * rng.normal(size=len(ideal.angle))) == 0.0


def test_a_table_that_reverses_without_ramps_has_neither_step_nor_noise():
    """At 15 deg/s and 5 Hz every record moves by 3 deg; that is the motion, not the encoder."""
    time = np.arange(0.0, 2000.0, 0.2)
    rate = np.where((time // 6.0) % 2, 0.0, np.where((time // 12.0) % 2, -15.0, 15.0))
    angle = np.concatenate([[0.0], np.cumsum(rate[:-1])]) * 0.2 * DEG
    assert encoder_step(angle) == 0.0
    assert encoder_noise(TableLog("t", time, angle, 0.2)).sigma == 0.0


@pytest.mark.parametrize("rate", [5.0, 20.0, -50.0])
def test_segments_of_a_coarse_encoder_are_found(rate):
    for step in (360.0 / 4096, 0.1):
        found = find_segments(quantised(step, 5, rate))
        assert [round(s.rate / DEG, 1) for s in found] == [0.0, rate]


def test_the_gyros_trim_the_ramp_that_complete_degrees_do_not_show():
    log = quantised(1.0)
    time = np.arange(0.0, 70.0, 0.01)
    exact, _ = table([(0, 30), (20, 40)], acceleration=20.0)
    rate = np.gradient(np.interp(time, exact.time, exact.angle), 0.01)
    rng = np.random.default_rng(2)
    gyro = np.outer(rate, UP) + 1e-4 * rng.normal(size=(len(time), 3))
    imu = ImuLog("imu", time, gyro, np.tile(9.8 * UP, (len(time), 1)), 0.01)
    still, turning = find_segments(log)
    assert still.end > 30.1  # the first degree of the ramp does not show
    assert refine_edges(imu, UP, still, 2.5).end < 30.0
    assert refine_edges(imu, UP, turning, 2.5).start > 31.0


@pytest.mark.parametrize("interval", [0.01, 0.02])
def test_a_ramp_is_trimmed_by_tenths_of_a_second_and_one_more(interval):
    time = interval * np.arange(round(60.0 / interval))
    gyro = np.zeros((len(time), 3))
    gyro[time < 0.345, 2] = gyro[time > 59.0, 2] = 1.0 * DEG
    imu = ImuLog("imu", time, gyro, np.tile(9.8 * UP, (len(time), 1)), interval)
    found = refine_edges(imu, UP, Segment(0.0, time[-1]), 2.5)
    # Ramps of 0.35 and of 0.98 s: four tenths, and ten, to the grid of the samples.
    assert found.start == pytest.approx(0.5)
    assert time[-1] - found.end == pytest.approx(1.1)


@pytest.mark.parametrize(("times", "start"), [(8.84, 0.0), (8.92, 0.2), (-8.92, 0.2)])
def test_a_block_deviates_beyond_six_sigma_of_those_further_inside(times, start):
    time = 0.01 * np.arange(6000)
    # Blocks of a tenth of a second that scatter by this size: sigma is 1.48 times it.
    size = 0.01 * DEG
    gyro = size * np.outer(np.where(np.arange(6000) // 10 % 2, 1.0, -1.0), UP)
    gyro[:10, 2] = times * size
    imu = ImuLog("imu", time, gyro, np.tile(9.8 * UP, (len(time), 1)), 0.01)
    assert refine_edges(imu, UP, Segment(0.0, 59.99), 2.5).start == pytest.approx(start)


@pytest.mark.parametrize(
    ("blocks", "start"), [([2, 3], 0.5), ([3], 0.0), ([1], 0.3), ([0, 5], 0.2), ([0, 1, 4], 0.6)]
)
def test_half_of_the_blocks_that_are_trimmed_must_deviate(blocks, start):
    gyro = np.zeros((6000, 3))
    for block in blocks:
        gyro[10 * block : 10 * block + 10, 2] = 1.0 * DEG
    imu = ImuLog("imu", 0.01 * np.arange(6000), gyro, np.tile(9.8 * UP, (6000, 1)), 0.01)
    assert refine_edges(imu, UP, Segment(0.0, 59.99), 2.5).start == pytest.approx(start)


def test_a_ramp_is_searched_within_a_third_of_a_segment():
    time = 0.01 * np.arange(6000)
    gyro = np.outer(np.where(time > 6.0, 20.0 * DEG, 0.0), UP)
    imu = ImuLog("imu", time, gyro, np.tile(9.8 * UP, (6000, 1)), 0.01)
    assert refine_edges(imu, UP, Segment(0.0, 5.99), 0.5) == Segment(0.0, 5.99)


def test_a_spike_inside_a_segment_is_no_ramp():
    time = np.arange(0.0, 60.0, 0.01)
    rng = np.random.default_rng(2)
    gyro = 1e-4 * rng.normal(size=(len(time), 3))
    gyro[300:310, 2] += 0.1
    imu = ImuLog("imu", time, gyro, np.tile(9.8 * UP, (len(time), 1)), 0.01)
    segment = Segment(0.0, 59.0)
    assert refine_edges(imu, UP, segment, 2.5) == segment


@pytest.mark.parametrize("size", [0.005, 0.05])
def test_the_eccentricity_of_an_encoder_is_found(size):
    time = np.arange(0.0, 60.0, 0.02)
    true = 30.0 * DEG * time
    angle = true + size * DEG * np.cos(true - 1.0)
    line = float(time.mean()), float(angle.mean()), 30.0 * DEG
    found = encoder_eccentricity(time, angle, line)
    assert found.amplitude / DEG == pytest.approx(size, rel=1e-2)
    assert len(find_segments(TableLog("t", time, angle, 0.02))) == 1
    noise = 1e-3 * np.random.default_rng(1).normal(size=len(time))
    assert encoder_eccentricity(time, true + noise, line) is None
