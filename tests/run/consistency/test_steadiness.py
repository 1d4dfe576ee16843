"""Gyros that do not follow the table inside a segment: what is found, where and how much."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import median_filter
from scipy.stats import norm

from rotcli.logs.record import Segment
from rotcli.run.consistency.blocks import reduce_segment
from rotcli.run.consistency.steadiness import check_clipping, check_steadiness, clipped
from tests.logs.made_logs import DEG, imu, table

Z = np.array([0.0, 0.0, 1.0])
RATE = 10.0  # deg/s


def blocks(change, rate=RATE, noise=1e-4, **options):
    """A segment of a minute in blocks of a quarter of a second; `change` alters the gyros."""
    log = imu(60.0, (0.0, 0.0, rate), noise=noise)
    change(log.gyro)
    turning, _ = table([(rate, 61.0)])
    turned = rate * DEG * 59.99
    return reduce_segment(log, turning, Segment(0.0, 59.99, rate * DEG, turned), Z, 25, **options)


@pytest.mark.parametrize("rate", [RATE, -RATE])
@pytest.mark.parametrize("share", [0.0, 0.7])
def test_rotation_that_is_not_measured_is_found_with_its_duration(rate, share):
    def slow(gyro):
        gyro[2000:2200, 2] -= (1.0 - share) * rate * DEG

    (finding,) = check_steadiness("imu.csv", [blocks(slow, rate)])
    assert finding.code == "rotation-not-followed"
    assert (finding.value, finding.limit) == pytest.approx((2.0, 0.5))  # s
    start, end = finding.text.split("from ")[1].split(" s;")[0].split(" to ")
    # The first interval begins half a sample before the first reading.
    assert (float(start), float(end)) == pytest.approx((19.995, 21.995), abs=1e-3)


def test_rotation_that_is_a_little_slower_is_a_disturbance():
    def slow(gyro):
        gyro[2000:2200, 2] -= 0.19 * RATE * DEG  # a fifth is allowed

    (finding,) = check_steadiness("imu.csv", [blocks(slow)])
    assert finding.code == "segment-disturbed"


def test_faster_rotation_is_a_disturbance_and_not_a_missing_one():
    def fast(gyro):
        gyro[2000:2200, 2] += RATE * DEG

    (finding,) = check_steadiness("imu.csv", [blocks(fast)])
    assert (finding.code, finding.unit) == ("segment-disturbed", "deg/s")
    assert finding.value == pytest.approx(RATE, rel=1e-3)


@pytest.mark.parametrize("rate", [RATE, 0.0])
def test_the_limit_of_a_spike_is_the_ripple_of_the_table_where_there_is_no_noise(rate):
    limit = 2e-3 * rate + 0.02  # deg/s

    def spike(size):
        def change(gyro):
            gyro[3000:3025, 0] += size * DEG

        return change

    assert check_steadiness("imu.csv", [blocks(spike(0.995 * limit), rate, noise=0.0)]) == ()
    (finding,) = check_steadiness("imu.csv", [blocks(spike(-1.005 * limit), rate, noise=0.0)])
    assert (finding.where, finding.limit) == ("gyro_x", pytest.approx(limit))
    assert "was disturbed near 29.995 s" in finding.text or "near 30 s" in finding.text
    assert "deg/s over 0.25 s" in finding.text


def test_the_limit_of_a_spike_in_noise_is_nine_sigma_of_a_block():
    def spike(gyro):
        gyro[3000:3025, 1] += 0.2

    reduced = blocks(spike, noise=0.05)  # rad/s
    (finding,) = check_steadiness("imu.csv", [reduced])
    deviation = reduced.gyro[:, 1] - median_filter(reduced.gyro[:, 1], size=21, mode="mirror")
    sigma = np.median(np.abs(deviation)) / norm.ppf(0.75)
    assert finding.limit * DEG == pytest.approx(9.0 * sigma, rel=3e-3)


def test_gyros_that_show_nothing_at_all_make_no_spike():
    def nothing(gyro):
        gyro[:] = 0.0

    assert all(
        finding.code not in ("segment-disturbed", "rotation-not-followed")
        for finding in check_steadiness("imu.csv", [blocks(nothing, noise=0.0)])
    )


def test_a_segment_with_more_than_a_hundredth_of_clipped_samples_is_rejected():
    def clip(count):
        def change(gyro):
            gyro[:count, 2] = 20.0 * DEG

        return change

    few, many = (blocks(clip(n), gyro_range=20.0 * DEG) for n in (59, 61))
    assert few.scan.rows == many.scan.rows == 6000
    assert clipped([few, many]) == [False, True]
    (finding,) = check_clipping("imu.csv", [few, many])
    assert finding.value == pytest.approx(61 / 6000)
    assert "0.01 of the samples of gyro_z are clipped" in finding.text
    assert check_clipping("imu.csv", [replace(few)]) == []
