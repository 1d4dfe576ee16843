"""Sensor errors invert; noise has the Allan deviation that was put in (allantools judges)."""

import allantools
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rotcli.models.sensors import FLICKER_FLOOR, NoiseFigures, TriadErrors, correct, distort, noise

matrices = st.lists(st.floats(-0.01, 0.01), min_size=9, max_size=9).map(
    lambda v: np.array(v).reshape(3, 3)
)
vectors = st.lists(st.floats(-5.0, 5.0), min_size=3, max_size=3).map(np.array)


@given(matrices, vectors, vectors)
def test_correction_inverts_the_error_model(matrix, bias, true):
    errors = TriadErrors(matrix, bias)
    # Rounding of numbers of size 10 through a matrix within a hundredth of the identity.
    np.testing.assert_allclose(correct(errors, distort(errors, true[None])), true[None], atol=1e-14)


def test_an_installation_error_kgxz_shows_on_gyro_x_when_turning_about_z():
    errors = TriadErrors(matrix=np.array([[0, 0, 2e-3], [0, 0, 0], [0, 0, 1e-3]]))
    np.testing.assert_allclose(distort(errors, np.array([[0, 0, 10.0]])), [[0.02, 0, 10.01]])


def test_the_flicker_floor_is_0_664():
    assert pytest.approx(0.664, abs=5e-4) == FLICKER_FLOOR


CASES = {
    "quantization": NoiseFigures(quantization=1.0),
    "white": NoiseFigures(white=1.0),
    "bias instability": NoiseFigures(bias_instability=1.0),
    "rate random walk": NoiseFigures(rate_random_walk=1.0),
    "rate ramp": NoiseFigures(rate_ramp=1.0),
    "Gauss-Markov": NoiseFigures(markov_sigma=1.0, markov_time=1.0),
    "together": NoiseFigures(0.01, 0.5, 0.3, 0.2, 0.01, 0.4, 2.0),
}


@pytest.mark.parametrize("figures", CASES.values(), ids=CASES)
def test_the_coefficients_put_in_come_out_of_allantools(figures):
    interval, n, runs = 0.05, 20_000, 40
    taus = np.array([0.5, 1.0, 2.0, 10.0, 50.0])
    found = np.zeros(len(taus))
    for seed in range(runs):
        samples = noise(np.random.default_rng(seed), n, interval, figures)
        result = allantools.oadev(samples, rate=1 / interval, data_type="freq", taus=taus)
        found += result[1] ** 2 / runs
    # The longest tau has about 20 clusters a run: sigma of the variance sqrt(2/20/40) = 5 %;
    # three of them. Clusters of ten samples or more: shorter ones show that the noise is sampled.
    np.testing.assert_allclose(found, figures.allan_variance(taus), rtol=0.15)
    np.testing.assert_allclose(found[1:3], figures.allan_variance(taus)[1:3], rtol=0.04)


def test_the_same_seed_gives_the_same_noise_and_figures_do_not_disturb_each_other():
    white = noise(np.random.default_rng(5), 100, 0.01, NoiseFigures(white=1.0))
    again = noise(np.random.default_rng(5), 100, 0.01, NoiseFigures(white=1.0))
    both = noise(np.random.default_rng(5), 100, 0.01, NoiseFigures(white=1.0, rate_ramp=1.0))
    np.testing.assert_array_equal(white, again)
    np.testing.assert_allclose(both - white, 0.01 * np.arange(100), atol=1e-12)
