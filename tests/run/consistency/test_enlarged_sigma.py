"""Sigmas of a log that contradicts its noise figures, against errors of a drift that is known.

The simulation adds drifts to the readings that the fit does not know: the errors over the sigmas
that a contradicted log gets should have about unit spread.
"""

import numpy as np
import pytest

from rotcli.calibrate.fit import fit_triad
from rotcli.models.mean_covariance import SlowNoise, mean_covariance
from rotcli.run.consistency.goodness import check_fit
from rotcli.run.consistency.means import SegmentMeans, TriadNoise
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR

Z = np.array([0.0, 0.0, 1.0])
SLOW = SlowNoise(15.66 * DEG_PER_HOUR, 0.35 * DEG_PER_HOUR)
NOISE = TriadNoise(np.full(3, 0.4 * DEG_PER_ROOT_HOUR), [SLOW] * 3)
PARTS, SECONDS = 12, 60.0
TWO, FIVE = (0.0, 30.0), (0.0, 30.0, 0.0, -30.0, 0.0)
DRIFTS = {
    "line": lambda t, rng: t / t[-1],
    "warm-up": lambda t, rng: 1.0 - np.exp(-t / 60.0),
    "step": lambda t, rng: (t > rng.uniform(0.0, t[-1])).astype(float),
    "walk": lambda t, rng: np.cumsum(rng.standard_normal(len(t))) / np.sqrt(len(t)),
}


def parts(rates):
    start = np.concatenate(
        [(SECONDS + 1.0) * k + SECONDS / PARTS * np.arange(PARTS) for k in range(len(rates))]
    )
    n, rate = len(start), np.repeat(np.array(rates) * DEG, PARTS)
    return SegmentMeans(start, start + SECONDS / PARTS, np.zeros((n, 3)), rate, np.zeros((n, n)))


def segments(means):
    z = means.z.reshape(-1, PARTS, 3).mean(axis=1)
    k = len(z)
    return SegmentMeans(
        means.start[::PARTS],
        means.end[PARTS - 1 :: PARTS],
        z,
        means.rate[::PARTS],
        np.zeros((k, k)),
    )


def ratios(rates, drift, size, seeds):
    """Return error over sigma of the axis column of contradicted gyros: enlarged, and not."""
    run = parts(rates)
    middle = 0.5 * (run.start + run.end)
    S = mean_covariance(run.start, run.end, SLOW)
    S += np.diag(NOISE.white[0] ** 2 / (run.end - run.start))
    factor = np.linalg.cholesky(S)
    enlarged, plain = [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        z = factor @ rng.standard_normal((len(middle), 3))
        for i in range(3):
            z[:, i] += size * DEG_PER_HOUR * rng.standard_normal() * DRIFTS[drift](middle, rng)
        drawn = SegmentMeans(run.start, run.end, z, run.rate, run.rate_covariance)
        test = check_fit("imu", drawn, NOISE, Z, flicker=np.zeros(3), judged=True)
        fit = fit_triad(segments(drawn), NOISE, Z, (run.end[-1], run.end[-1] + 300.0))
        bad = [gyro.contradicted for gyro in test.gyros]
        for covariance, result in (
            (test.enlarged(fit.covariance), enlarged),
            (fit.covariance, plain),
        ):
            result.append((fit.values[:3] / np.sqrt(np.diag(covariance)[:3]))[bad])
    return np.concatenate(enlarged), np.concatenate(plain)


@pytest.mark.parametrize(
    ("rates", "drift", "low", "high"),
    [
        # A drift or a step that the parts show is contained in the sigma.
        (TWO, "line", 0.7, 1.7),
        (TWO, "warm-up", 0.7, 1.7),
        (TWO, "step", 0.7, 1.7),
        (FIVE, "line", 0.4, 1.3),
        (FIVE, "step", 0.6, 1.6),
        # A walk of the bias that no column explains has sigmas that are too small by two.
        (TWO, "walk", 1.5, 3.5),
    ],
)
def test_errors_under_a_drift_are_of_the_size_of_the_enlarged_sigma(rates, drift, low, high):
    enlarged, plain = ratios(rates, drift, 1000.0, range(25))
    assert len(enlarged) > 50  # of 75 gyros
    assert low < np.std(enlarged) < high
    assert np.std(plain) > 3.0


def test_the_sigmas_of_a_log_without_drift_stay():
    enlarged, _ = ratios(TWO, "line", 0.0, range(25))
    assert len(enlarged) == 0
