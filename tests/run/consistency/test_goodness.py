"""Tests of the fit: nominal false alarms, the causes that they name, and their power."""

import re

import numpy as np
import pytest

from rotcli.models.mean_covariance import SlowNoise, mean_covariance
from rotcli.run.consistency.goodness import FALSE_ALARM, check_fit, chi2_limit
from rotcli.run.consistency.means import SegmentMeans, TriadNoise
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR, PPM

Z = np.array([0.0, 0.0, 1.0])
NOISE = TriadNoise(
    np.full(3, 0.4 * DEG_PER_ROOT_HOUR),
    [SlowNoise(15.66 * DEG_PER_HOUR, 0.35 * DEG_PER_HOUR)] * 3,
)
FLICKER = np.full(3, 15.66 * DEG_PER_HOUR)


def parts(rates=(0.0, 30.0), count=12, seconds=60.0):
    """Return the parts of segments of equal length, without errors."""
    start, rate = [], []
    for k, r in enumerate(rates):
        start += [(seconds + 1.0) * k + seconds / count * j for j in range(count)]
        rate += [r * DEG] * count
    start = np.array(start)
    n = len(start)
    return SegmentMeans(
        start, start + seconds / count, np.zeros((n, 3)), np.array(rate), np.zeros((n, n))
    )


def drawn(run, seed):
    rng = np.random.default_rng(seed)
    S = mean_covariance(run.start, run.end, NOISE.slow[0])
    S += np.diag(NOISE.white[0] ** 2 / (run.end - run.start))
    z = np.linalg.cholesky(S) @ rng.standard_normal((len(run.start), 3))
    return z + rng.normal(size=3) * 1e-3 + np.outer(run.rate, rng.normal(size=3) * 1e-3)


def check(run, z):
    changed = SegmentMeans(run.start, run.end, z, run.rate, run.rate_covariance)
    return check_fit("imu.csv", changed, NOISE, Z, flicker=FLICKER, judged=True)


def test_chi_squared_has_its_degrees_of_freedom_and_false_alarms_are_rare():
    run = parts()
    tests = [check(run, drawn(run, seed)) for seed in range(300)]
    chi2 = np.array([[g.chi2 for g in t.gyros] for t in tests])
    # 900 draws of 22 degrees of freedom: mean +- 0.22, four sigma; variance 44 +- 2.9.
    assert chi2.mean() == pytest.approx(22.0, abs=0.9)
    assert chi2.var() == pytest.approx(44.0, abs=12.0)
    assert sum(bool(t.findings) for t in tests) <= 3  # 0.3 expected
    assert FALSE_ALARM == 1e-3
    assert chi2_limit(22) == pytest.approx(51.8, abs=0.1)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda run: 300.0 * DEG_PER_HOUR * run.start / 121.0, "the bias drifts by"),
        (lambda run: 300.0 * DEG_PER_HOUR * (run.start >= 30.0), "changes by .* near 30 s"),
    ],
)
def test_the_cause_of_a_contradiction_is_named(change, says):
    run = parts()
    z = drawn(run, 5)
    z[:, 1] += change(run)
    test = check(run, z)
    (finding,) = test.findings
    assert finding.where == "gyro_y"
    assert finding.code == "fit-contradicted"
    assert re.search(says, finding.text), finding.text
    assert test.sigma_factor[1] > 1.5
    assert test.sigma_factor[0] == test.sigma_factor[2] == 1.0


def test_a_curve_over_the_rates_is_not_one_straight_line():
    run = parts(rates=(0.0, 15.0, -15.0, 30.0), count=6)
    z = drawn(run, 2)
    z[:, 0] += 5000.0 * PPM * run.rate * np.abs(run.rate) / (30.0 * DEG)
    (finding,) = check(run, z).findings
    assert "not one straight line over the rates" in finding.text
    # The curve reaches 5000 ppm at the largest rate.
    ppm = float(re.search(r"\((\S+) ppm\)", finding.text)[1])
    assert ppm == pytest.approx(5000.0, rel=0.1)
    assert "rotcli scale" in finding.text


def test_the_power_of_the_test_of_drift_and_step_is_that_of_the_documentation():
    """Sizes that are found in half of the cases, NAV440, R16's run: docs/explanation."""
    run = parts()
    for size, column in (
        (194.0, run.start / 121.0),
        (79.0, (run.start >= 30.0) & (run.start < 61.0)),
    ):
        found = 0
        for seed in range(60):
            z = drawn(run, seed)
            z[:, 0] += size * DEG_PER_HOUR * column
            found += any(f.where == "gyro_x" for f in check(run, z).findings)
        assert 0.2 < found / 60.0 < 0.8, (size, found)


def test_without_slow_noise_figures_nothing_is_judged():
    run = parts()
    z = drawn(run, 1) * 100.0
    test = check_fit("imu.csv", SegmentMeans(run.start, run.end, z, run.rate, run.rate_covariance),
                     NOISE, Z, flicker=FLICKER, judged=False)  # fmt: skip
    assert test.findings == ()
    np.testing.assert_array_equal(test.sigma_factor, 1.0)
