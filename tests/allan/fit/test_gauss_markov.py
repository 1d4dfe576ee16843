import math

import numpy as np
import pytest

from rotcli.allan.deviation import phase_from_rate
from rotcli.allan.fit import gauss_markov
from rotcli.models.sensors import NoiseFigures, noise
from rotcli.units import DEG_PER_HOUR, DEG_PER_ROOT_HOUR

SIGMA, TIME = 24 * DEG_PER_HOUR, 120.0
WHITE = 3 * DEG_PER_ROOT_HOUR


def found(seconds, seed, interval=0.5, **figures):
    rate = noise(
        np.random.default_rng(seed), round(seconds / interval), interval, NoiseFigures(**figures)
    )
    return gauss_markov.fit(*gauss_markov.block_averages(phase_from_rate(rate, interval), interval))


def test_six_hours_give_sigma_and_time_within_their_spread():
    runs = [
        found(21_600, seed, white=WHITE, markov_sigma=SIGMA, markov_time=TIME) for seed in range(50)
    ]
    known = [r for r in runs if r.time is not None]
    assert len(known) >= 48
    z_time = np.array([math.log(r.time / TIME) / r.time_spread for r in known])
    z_sigma = np.array([math.log(r.sigma / SIGMA) / r.sigma_spread for r in known])
    assert 0.7 < z_time.std() < 1.4
    assert 0.7 < z_sigma.std() < 1.4
    assert abs(z_time.mean()) < 0.5
    assert abs(z_sigma.mean()) < 0.5
    # A plain fit of the autocorrelation left 68 % within 0.77 to 1.29, a half width of 0.26 in
    # ln T; fifty draws know such a quantile to about 0.06.
    low, middle, high = np.quantile([math.log(r.time / TIME) for r in known], [0.16, 0.5, 0.84])
    assert 0.5 * (high - low) < 0.26 + 0.06
    assert abs(middle) < 0.26 / 2


def test_the_expected_periodogram_is_that_of_simulated_averages():
    n, size, blocks = 400, 20, 30.0
    theta = np.log([2.0, blocks, 0.5])
    frequency = 2 * math.pi * np.arange(1, n // 2) / n
    total = np.zeros(n // 2 - 1)
    for seed in range(300):
        rate = noise(
            np.random.default_rng(seed),
            n * size,
            1.0 / size,
            NoiseFigures(white=math.sqrt(0.5), markov_sigma=math.sqrt(2.0), markov_time=blocks),
        )
        mean = rate.reshape(n, size).mean(axis=1)
        total += np.abs(np.fft.rfft(mean - mean.mean())[1 : n // 2]) ** 2 / n / 300
    ratio = total / gauss_markov._expected(theta, frequency, n)
    # Exponential draws, 300 of them: 5.8 % each; the mean of 199 far less.
    assert np.abs(ratio - 1.0).max() < 5 * 0.058
    assert abs(ratio.mean() - 1.0) < 0.015


@pytest.mark.parametrize(
    ("seconds", "figures", "reason"),
    [
        (140, {"white": WHITE, "markov_sigma": SIGMA}, "record below 150 s"),
        (7200, {"white": WHITE}, "white noise explains the record"),
        (7200, {"markov_sigma": SIGMA, "markov_time": 700}, "beyond a thirtieth of the record"),
        (7200, {"white": WHITE / 20, "markov_sigma": SIGMA, "markov_time": 2}, "below 5 blocks"),
        (21_600, {"white": WHITE / 5, "bias_instability": SIGMA}, "flicker or random walk fit"),
        (2000, {"white": WHITE, "markov_sigma": SIGMA, "markov_time": 60}, "factor above"),
    ],
)
def test_what_a_record_cannot_give_is_refused_with_a_reason(seconds, figures, reason):
    runs = [found(seconds, seed, **figures) for seed in range(25)]
    assert any(r.reason is not None and reason in r.reason for r in runs)
    for run in runs:
        assert (run.time is None) == (run.sigma is None) == (run.reason is not None)


def test_white_flicker_and_walking_records_are_refused_by_every_seed():
    for figures in (
        {"white": WHITE},
        {"white": WHITE / 7, "bias_instability": 15 * DEG_PER_HOUR},
        {"white": WHITE, "rate_random_walk": 2.6 * DEG_PER_HOUR},
    ):
        known = sum(found(7200, seed, **figures).time is not None for seed in range(25))
        # Twice a log-likelihood gain of ten by chance: below one in a hundred.
        assert known <= 1, figures


def test_a_remaining_trend_is_refused():
    ramp = 300 * DEG_PER_HOUR / 3600
    trend = found(21_600, 0, white=WHITE / 3, markov_sigma=SIGMA, markov_time=60, rate_ramp=ramp)
    assert trend.time is None
    averages = np.random.default_rng(0).standard_normal(1000)
    assert gauss_markov.fit(averages, 1.0, has_trend=True).reason == (
        "a linear trend remains in the record"
    )


def test_a_constant_record_is_refused():
    assert gauss_markov.fit(np.zeros(1000), 1.0).reason == "the record is constant"
