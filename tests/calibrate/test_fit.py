"""Generalised least squares of segment means: published sigmas, design, prediction."""

import numpy as np
import pytest

from rotcli.calibrate.fit import fit_triad
from rotcli.models.mean_covariance import SlowNoise
from rotcli.run.consistency.means import SegmentMeans, TriadNoise
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR, PPM

Z = np.array([0.0, 0.0, 1.0])
HORIZON = (124.0, 424.0)
# Noise figures of the installed profiles: N deg/sqrt(h), B deg/h, K deg/h/sqrt(s).
FIGURES = {"nav440": (0.4, 15.66, 0.35), "mti-g": (3.0, 8.28, 2.6)}


def noise_of(imu):
    N, B, K = FIGURES[imu]
    slow = SlowNoise(B * DEG_PER_HOUR, K * DEG_PER_HOUR)
    return TriadNoise(np.full(3, N * DEG_PER_ROOT_HOUR), [slow] * 3)


def means(rates_dps, spans, z=None):
    start, end = np.array(spans, dtype=float).T
    rate = np.array(rates_dps) * DEG
    k = len(rate)
    return SegmentMeans(start, end, np.zeros((k, 3)) if z is None else z, rate, np.zeros((k, k)))


@pytest.mark.parametrize(
    ("imu", "bias", "own", "scale"),
    [("nav440", 18.65, 8.28, 44.3), ("mti-g", 43.27, 25.11, 105.5)],
)
def test_the_sigmas_of_the_papers_run_are_those_of_an_independent_calculation(
    imu, bias, own, scale
):
    """Of the generalised covariance, by another implementation, to the printed digits."""
    run = means([0.0, 100.0], [(0, 60), (64, 124)])
    fit = fit_triad(run, noise_of(imu), Z, HORIZON)
    sigma = np.sqrt(np.diag(fit.covariance))
    np.testing.assert_allclose(sigma[3:] / DEG_PER_HOUR, bias, atol=0.02)
    np.testing.assert_allclose(fit.own_sigma / DEG_PER_HOUR, own, atol=0.02)
    np.testing.assert_allclose(sigma[:3] / PPM, scale, atol=0.06)


@pytest.mark.parametrize(
    ("spans", "rates", "bias"),
    [
        ([(0, 60), (64, 124)], [0, 100], 18.65),
        ([(0, 60), (64, 124), (128, 188), (192, 252), (256, 316)], [0, 50, 0, -50, 0], 14.6),
    ],
)
def test_more_segments_predict_the_bias_better(spans, rates, bias):
    end = spans[-1][1]
    fit = fit_triad(means(rates, spans), noise_of("nav440"), Z, (end, end + 300.0))
    assert np.sqrt(fit.covariance[5, 5]) / DEG_PER_HOUR == pytest.approx(bias, abs=0.06)


def test_two_segments_predict_the_still_mean_and_the_difference_over_the_rate():
    rng = np.random.default_rng(1)
    z = rng.normal(size=(2, 3)) * 1e-4
    fit = fit_triad(means([0.0, 50.0], [(0, 60), (64, 124)], z), noise_of("nav440"), Z, HORIZON)
    np.testing.assert_allclose(fit.values[3:], z[0], rtol=1e-9)
    np.testing.assert_allclose(fit.values[:3], (z[1] - z[0]) / (50.0 * DEG), rtol=1e-9)


def test_under_white_noise_the_fit_is_weighted_by_time_and_reaches_the_cramer_rao_bound():
    spans = [(0, 30), (30, 120), (120, 140)]
    run = means([0.0, 20.0, -20.0], spans)
    white = TriadNoise(np.full(3, 1e-4), [SlowNoise()] * 3)
    fit = fit_triad(run, white, Z, HORIZON)
    weights = np.diff(np.array(spans))[:, 0] / 1e-8
    information = run.design.T @ (weights[:, None] * run.design)
    expected = np.linalg.inv(information)
    np.testing.assert_allclose(fit.covariance[np.ix_([2, 5], [2, 5])], expected, rtol=1e-9)


def test_an_error_of_the_table_rate_adds_to_the_scale_factor_along_the_axis_only():
    run = means([0.0, 50.0], [(0, 60), (64, 124)])
    noisy = SegmentMeans(run.start, run.end, run.z, run.rate, np.diag([0.0, (1e-3 * DEG) ** 2]))
    exact, coarse = (fit_triad(m, noise_of("nav440"), Z, HORIZON) for m in (run, noisy))
    added = np.diag(coarse.covariance) - np.diag(exact.covariance)
    np.testing.assert_allclose(added[[0, 1, 3, 4, 5]], 0.0, atol=1e-6 * exact.covariance[0, 0])
    assert np.sqrt(added[2]) / PPM == pytest.approx(20.0, rel=1e-6)  # 1e-3 of 50 deg/s


def test_one_rate_does_not_separate_bias_and_scale_factor():
    with pytest.raises(ValueError, match="linearly dependent"):
        fit_triad(means([20.0, 20.0], [(0, 60), (64, 124)]), noise_of("nav440"), Z, HORIZON)


def draw(rng, run, noise, window, count):
    """Draw (count, k + 1) errors of segment means and of the window from the covariance."""
    from rotcli.models.mean_covariance import mean_covariance

    start = np.append(run.start, window[0])
    end = np.append(run.end, window[1])
    S = mean_covariance(start, end, noise.slow[0], span=float(end.max() - start.min()))
    white = np.append(noise.white[0] ** 2 / (run.end - run.start), 0.0)
    factor = np.linalg.cholesky(S + np.diag(white) + 1e-9 * np.diag(np.diag(S)))
    return rng.standard_normal((count, len(start))) @ factor.T


@pytest.mark.parametrize(
    ("imu", "rates"),
    [
        ("nav440", [0, 100]),
        ("mti-g", [0, 50, 0, -50, 0]),
        pytest.param("mti-g", [0, 100], marks=pytest.mark.campaign),
        pytest.param("nav440", [0, 50, 0, -50, 0], marks=pytest.mark.campaign),
    ],
)
def test_errors_have_the_size_of_their_sigma(imu, rates):
    """Error over sigma of bias (for the horizon) and scale factor over 450 draws: 3.3 %."""
    spans = [(64.0 * k, 64.0 * k + 60.0) for k in range(len(rates))]
    window = (spans[-1][1], spans[-1][1] + 300.0)
    run, noise = means(rates, spans), noise_of(imu)
    errors = draw(np.random.default_rng(3), run, noise, window, 450)
    ratios = []
    for k in range(0, 450, 3):
        z = errors[k : k + 3, :-1].T
        fit = fit_triad(SegmentMeans(run.start, run.end, z, run.rate, run.rate_covariance), noise,
                        Z, window)  # fmt: skip
        sigma = np.sqrt(np.diag(fit.covariance))
        difference = fit.values - np.concatenate([np.zeros(3), errors[k : k + 3, -1]])
        ratios.append(difference / sigma)
    ratios = np.array(ratios)
    assert np.std(ratios[:, :3]) == pytest.approx(1.0, abs=0.1)
    assert np.std(ratios[:, 3:]) == pytest.approx(1.0, abs=0.1)
