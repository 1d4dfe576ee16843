"""Filters, repeated samples and lines are found, and N is that of the noise before them."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter, welch

from rotcli.allan.deviation import averaging_factors, integrate, overlapping_variance
from rotcli.allan.fit.coefficients import fit_noise
from rotcli.allan.fit.summary import summarize
from rotcli.allan.survey.spectrum import Line, find_lines, repeats, survey, welch_density

N = 0.3 / 60 * np.pi / 180  # rad/s/sqrt(Hz)


def analyse(readings, interval):
    """Return the spectrum and the fit of readings."""
    phase = np.concatenate([[0.0], readings])
    spectrum = survey([phase[1:]], interval)
    integrate(phase, interval)
    factors = averaging_factors(len(readings), None, interval)
    record = summarize([phase], factors, interval, None, spectrum)
    return spectrum, fit_noise(record, "instant")


def white(rng, n, rate):
    return rng.standard_normal(n) * N * np.sqrt(rate)


def filtered(rng, n, rate, cutoff):
    """White noise behind a second-order low-pass filter, in its steady state."""
    warm = 20 * int(rate / cutoff)
    return lfilter(*butter(2, 2.0 * cutoff / rate), white(rng, n + warm, rate))[warm:]


def test_the_density_is_that_of_scipy():
    readings = np.random.default_rng(0).standard_normal(20_000)
    frequency, density = welch_density([readings], 0.01)
    length = 2 * round(1.0 / (frequency[1] - frequency[0]) * 100 / 2)
    expected = welch(readings, 100.0, "hann", length, detrend="constant")
    np.testing.assert_allclose(frequency, expected[0][3:-1], rtol=1e-12)
    np.testing.assert_allclose(density, expected[1][3:-1], rtol=1e-9)


@pytest.mark.parametrize(("rate", "cutoff"), [(100, 20), (100, 5), (1000, 40)])
def test_behind_a_filter_n_is_within_its_sigma_and_no_b_is_invented(rate, cutoff):
    rng, z, found_count = np.random.default_rng(cutoff), [], 0
    for _ in range(8):
        spectrum, fit = analyse(filtered(rng, 50_000, rate, cutoff), 1.0 / rate)
        assert spectrum.cutoff == pytest.approx(cutoff, rel=0.25)
        n = fit.coefficients["random_walk"]
        z.append((n.value - N) / n.sigma)
        found_count += fit.coefficients["bias_instability"].value is not None
    # The mean of eight scatters by 0.35; asked over 24 axes: within 0.5.
    assert abs(np.mean(z)) < 1.2
    assert 0.4 < np.std(z) < 1.8
    assert found_count == 0


@pytest.mark.campaign
@pytest.mark.parametrize(("rate", "cutoff"), [(100, 20), (100, 10), (100, 5), (100, 2), (1000, 40)])
def test_the_mean_error_behind_a_filter_is_below_half_a_sigma(rate, cutoff):
    rng, z, found_count = np.random.default_rng(100 + cutoff), [], 0
    for _ in range(96):
        _, fit = analyse(filtered(rng, 50_000, rate, cutoff), 1.0 / rate)
        n = fit.coefficients["random_walk"]
        z.append((n.value - N) / n.sigma)
        found_count += fit.coefficients["bias_instability"].value is not None
    # The sigma is honest too: of 24 axes one is beyond two sigma by chance, of 96 four.
    assert abs(np.mean(z)) < 0.5
    assert 0.75 < np.std(z) < 1.25
    assert np.mean(np.abs(z) > 2.0) < 0.12
    assert found_count <= 4


def test_a_strong_filter_leaves_n_right_or_null():
    rng = np.random.default_rng(2)
    for _ in range(6):
        _, fit = analyse(filtered(rng, 50_000, 100, 2), 0.01)
        n = fit.coefficients["random_walk"]
        assert n.value is None or abs(n.value - N) < 4 * n.sigma
        assert fit.coefficients["bias_instability"].value is None


def test_repeated_samples_are_counted_and_do_not_lower_n():
    repeated = np.repeat(white(np.random.default_rng(1), 40_000, 100), 10)
    spectrum, fit = analyse(repeated, 0.001)
    assert spectrum.repeats == 10
    n = fit.coefficients["random_walk"]
    assert n.value == pytest.approx(N, abs=3 * n.sigma)
    assert fit.coefficients["bias_instability"].value is None


def test_a_coarse_reading_is_not_a_repeated_one():
    coarse = np.round(np.random.default_rng(1).standard_normal(40_000) * 0.3)
    assert np.mean(np.diff(coarse) == 0.0) > 0.6
    assert repeats(coarse) == 1


def test_a_line_is_named_and_removed_from_n():
    rng = np.random.default_rng(3)
    time = np.arange(60_000) * 0.01
    amplitude = 0.02 * np.pi / 180
    readings = white(rng, 60_000, 100) + amplitude * np.sin(2 * np.pi * 0.5 * time + 0.3)
    spectrum, fit = analyse(readings, 0.01)
    (line,) = spectrum.lines
    assert line.frequency == pytest.approx(0.5, abs=0.005)
    assert line.amplitude == pytest.approx(amplitude, rel=0.05)
    n = fit.coefficients["random_walk"]
    assert n.value == pytest.approx(N, abs=2.5 * n.sigma)
    assert fit.coefficients["bias_instability"].value is None


def test_the_variance_of_a_line_is_that_of_a_sampled_sine():
    time = np.arange(200_000) * 0.01
    phase = np.concatenate([[0.0], 3.0 * np.sin(2 * np.pi * 0.37 * time)])
    integrate(phase, 0.01)
    factors = np.array([10, 100, 350, 1000])
    expected = Line(0.37, 3.0).variance(factors * 0.01)
    # Sums of samples against integrals: (pi f dt)^2 / 6 = 2e-5 and the ends of the record.
    np.testing.assert_allclose(overlapping_variance(phase, factors, 0.01), expected, rtol=0.02)


def test_clean_noise_has_no_line_no_filter_and_fits():
    rng, values = np.random.default_rng(4), []
    for _ in range(20):
        spectrum, fit = analyse(white(rng, 50_000, 100), 0.01)
        assert spectrum.lines == ()
        assert spectrum.cutoff is None
        assert spectrum.repeats == 1
        values.append(fit.goodness.p_value)
    assert min(values) > 1e-4
    assert 0.2 < np.mean(values) < 0.8  # uniform: 0.5, scatter 0.065


def test_noise_of_all_kinds_has_no_filter():
    rng = np.random.default_rng(5)
    walk = np.cumsum(rng.standard_normal(200_000)) * N * 0.02
    spectrum, _ = analyse(white(rng, 200_000, 100) + walk, 0.01)
    assert spectrum.cutoff is None
    assert spectrum.lines == ()


def test_a_curve_that_the_terms_cannot_follow_is_a_misfit():
    rng = np.random.default_rng(6)
    # Noise in a band of half an octave: no line, and none of the five terms.
    band = lfilter(*butter(2, [0.02, 0.03], "bandpass"), rng.standard_normal(60_000))
    _, fit = analyse(white(rng, 60_000, 100) + 20 * N * band, 0.01)
    assert fit.goodness.p_value < 1e-6
    assert abs(fit.goodness.largest) > 0.1


def test_lines_of_white_noise_are_rare():
    rng, found = np.random.default_rng(7), 0
    for _ in range(40):
        found += len(find_lines(*welch_density([rng.standard_normal(30_000)], 0.01)))
    assert found == 0


def test_a_long_record_has_windows_without_overlap():
    """Sixteen windows of 65536 and a rest: the density of scipy without overlap."""
    readings = np.random.default_rng(3).standard_normal(16 * 65536 + 1000)
    frequency, density = welch_density([readings], 0.01)
    expected = welch(readings, 100.0, "hann", 65536, noverlap=0, detrend="constant")
    np.testing.assert_allclose(frequency, expected[0][3:-1], rtol=1e-12)
    np.testing.assert_allclose(density, expected[1][3:-1], rtol=1e-9)


def test_the_density_of_segments_is_the_mean_of_their_windows():
    rng = np.random.default_rng(4)
    first, second = rng.standard_normal(20_000), 2.0 * rng.standard_normal(20_000)
    frequency, density = welch_density([first, second], 0.01)
    one, other = (welch_density([part], 0.01)[1] for part in (first, second))
    np.testing.assert_allclose(density, 0.5 * (one + other), rtol=1e-12)
    assert len(frequency) == len(density)
