"""Test a calibration out of sample: first halves of the segments against their second halves.

The first halves are calibrated, the second halves of those at the first turning rate are corrected
and averaged. What is left of the mean, less Earth rate and table rate, is a linear function of the
means of all halves; its weights sum to zero, so that the covariance of
`rotcli.models.mean_covariance` gives its sigma, white and slow noise and the encoder included.
"""

from collections.abc import Sequence

import numpy as np

from rotcli.calibrate.fit import fit_triad
from rotcli.calibrate.limits import LimitTest
from rotcli.dataclass import dataclass
from rotcli.models.mean_covariance import GlsFit
from rotcli.models.numerics.chi_squared import upper_limit
from rotcli.models.numerics.triangular import solve_triangular
from rotcli.models.sensors import TriadErrors, correct
from rotcli.run.consistency.goodness import FALSE_ALARM
from rotcli.run.consistency.means import SegmentMeans, TriadNoise
from rotcli.run.findings import Finding
from rotcli.units import DEG_PER_HOUR, FloatArray, digits


@dataclass(frozen=True, eq=False)
class OutOfSample:
    """Mean of the corrected gyros (3,), rad/s; its error and the sigma of the error (3,), rad/s."""

    mean: FloatArray
    error: FloatArray
    sigma: FloatArray

    @property
    def test(self) -> LimitTest | None:
        """Chi-squared of the three gyros; None without noise."""
        if not np.all(self.sigma > 0.0):
            return None
        ratio = self.error / self.sigma
        chi2, limit = float(ratio @ ratio), upper_limit(3, FALSE_ALARM)
        where = f"gyro_{'xyz'[int(np.argmax(np.abs(ratio)))]}"
        return LimitTest(chi2, limit, chi2 > limit, where, 3)

    def findings(self, path: str) -> list[Finding]:
        """Return the finding of second halves that the first ones do not predict."""
        test = self.test
        if test is None or not test.exceeded:
            return []
        i = "xyz".index(test.where[-1])
        error, sigma = (float(x[i]) / DEG_PER_HOUR for x in (self.error, self.sigma))
        text = (
            f"{path}: {test.where}: after a calibration of the first halves of the segments the "
            f"second halves read {digits(error)} deg/h too much, {digits(sigma)} deg/h expected "
            f"(chi-squared {test.value:.4g}, limit {test.limit:.4g}). The bias or scale factor "
            "changes within the log; let the IMU warm up"
        )
        code = "mean-after-unexpected"
        return [Finding(code, text, "warning", test.where, test.value, test.limit)]


def out_of_sample(
    first: SegmentMeans,
    second: SegmentMeans,
    partner: Sequence[int],
    samples: FloatArray,
    readings: FloatArray,
    noise: TriadNoise,
    u: FloatArray,
    horizon: tuple[float, float],
) -> OutOfSample:
    """Return the test of the second halves with a calibration of the first ones.

    partner: index of the first half that belongs to each second half; samples: (k,) of the second
    halves; readings: (3,) rad/s, mean of their gyros. horizon: s, for which the bias is predicted.
    """
    fit = fit_triad(first, noise, u, horizon, own_span=False)
    errors = TriadErrors(np.outer(fit.values[:3], u), fit.values[3:])
    weights = samples / samples.sum()
    rate = float(weights @ second.rate)
    error = weights @ second.z - rate * fit.values[:3] - fit.values[3:]
    both = _together(first, second, partner)
    variance = np.empty(3)
    for i, found in enumerate(fit.fits):
        cross = noise.of(first, i).horizon(*horizon).cross
        taken = rate * found.gain[0] + _bias_weights(found, first.design, cross)
        contrast = np.concatenate([-taken, weights])
        variance[i] = contrast @ noise.covariance(both, i, u) @ contrast
    mean = np.asarray(correct(errors, readings[None])[0])
    return OutOfSample(mean, np.asarray(error), np.sqrt(np.maximum(variance, 0.0)))


def _bias_weights(fit: GlsFit, design: FloatArray, cross: FloatArray) -> FloatArray:
    """Return the weights (k,) of the means in the predicted bias, sum 1 (kriging)."""
    half = solve_triangular(fit.factor, cross, lower=True)
    kriged = solve_triangular(fit.factor, half, lower=True, trans="T")
    return np.asarray(fit.gain[1] + kriged - (kriged @ design) @ fit.gain)


def _together(first: SegmentMeans, second: SegmentMeans, partner: Sequence[int]) -> SegmentMeans:
    """Return the means of both halves; the table angle between two halves is that of both rates."""
    n = len(first.rate)
    covariance = np.zeros((n + len(second.rate),) * 2)
    covariance[:n, :n], covariance[n:, n:] = first.rate_covariance, second.rate_covariance
    for j, i in enumerate(partner):
        shared = first.rate_covariance[i, i] * second.rate_covariance[j, j]
        covariance[i, n + j] = covariance[n + j, i] = -0.5 * np.sqrt(shared)
    return SegmentMeans(
        np.concatenate([first.start, second.start]),
        np.concatenate([first.end, second.end]),
        np.concatenate([first.z, second.z]),
        np.concatenate([first.rate, second.rate]),
        covariance,
    )
