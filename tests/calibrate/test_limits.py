"""Limits of a calibration that need no log: clipping, steadiness, sizes of errors, turns."""

from types import SimpleNamespace

import numpy as np
import pytest

from rotcli.calibrate.limits import clipping_test, steadiness_test
from rotcli.calibrate.plausibility import check_result, check_segment_lengths, excess
from rotcli.logs.record import Segment
from rotcli.run.consistency.steadiness import CLIPPED_SHARE, block_deviations

NAMES = ("Kgxz", "Kgyz", "Kgz")


def scanned(start, clipped, rows, gyro_range=5.0):
    scan = SimpleNamespace(clipped=np.array(clipped), rows=rows, gyro_range=gyro_range)
    return SimpleNamespace(scan=scan, segment=Segment(start, start + 60.0))


def test_the_segment_with_the_largest_share_at_the_range_is_named():
    few = scanned(0.0, [0, 3, 0], 6000)
    many = scanned(100.0, [1, 40, 1], 4000)
    found = clipping_test([few, many])
    assert found.value == pytest.approx(42 / 4000)
    assert found.exceeded
    assert found.limit == CLIPPED_SHARE
    assert found.where.startswith("100")
    clean = clipping_test([scanned(0.0, [0, 0, 0], 6000)])
    assert (clean.value, clean.exceeded, clean.where) == (0.0, False, "")
    assert clipping_test([scanned(0.0, [9, 9, 9], 6000, None)]) is None


def test_the_block_that_deviates_most_is_named_as_a_share_of_its_limit():
    rng = np.random.default_rng(1)
    made = []
    for start, spike in ((0.0, 0.01), (100.0, 0.03), (200.0, 0.02)):
        deviation = 1e-5 * rng.standard_normal((60, 3))
        deviation[20, 1] = spike
        edges = start + np.arange(61.0)
        made.append(
            SimpleNamespace(deviations=deviation, segment=Segment(start, start + 60.0), edges=edges)
        )
    found = steadiness_test(made)
    assert found.value == pytest.approx(0.03 / block_deviations(made[1])[1][1])
    assert found.exceeded
    assert found.where == "gyro_y near 120 s"
    for b in made:
        b.deviations[20, 1] = 0.0
    assert not steadiness_test(made).exceeded
    assert steadiness_test([SimpleNamespace(deviations=None)]) is None


def test_errors_are_implausible_where_they_exceed_ten_sigmas_of_the_rig_with_significance():
    values = np.array([0.02, -0.0115, 0.0095, 0.0, 0.0, 0.0])
    covariance = np.diag([1e-8, 25e-8, 1e-8, 1.0, 1.0, 1.0])  # 100, 500, 100 ppm
    sigma = np.full(3, 1e-3)
    beyond = excess(values, covariance, sigma)
    np.testing.assert_allclose(beyond, [0.02 - 0.0104, 0.0115 - 0.012, 0.0095 - 0.0104], rtol=1e-9)
    (finding,) = check_result("imu.csv", values, covariance, NAMES, sigma)
    assert "Kgxz is 20000 ppm, 20 times scale_sigma" in finding.text
    assert (finding.value, finding.limit) == pytest.approx((20000.0, 10000.0))
    assert check_result("imu.csv", values, covariance, NAMES, None) == []


def test_segments_of_less_than_a_turn_are_named():
    segments = [Segment(0.0, 10.0, 0.5, -4.0), Segment(20.0, 40.0, 0.5, 7.0)]
    (finding,) = check_segment_lengths("imu.csv", segments, earth_known=False)
    assert finding.value == pytest.approx(4.0 / (2.0 * np.pi))
    assert "covers 0.64 turns" in finding.text
    assert "Earth rate biases" in finding.text
    (known,) = check_segment_lengths("imu.csv", segments, earth_known=True)
    assert "Earth rate" not in known.text
