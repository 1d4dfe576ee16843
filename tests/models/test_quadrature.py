import numpy as np

from rotcli.models import quadrature


def test_instants_come_back_from_averages_to_the_sixth_order():
    t = 0.01 * np.arange(200)
    k = 2 * np.pi * 0.3
    averages = (np.cos(k * (t - 0.01)) - np.cos(k * t))[None] / (0.01 * k)
    # (k h)^6 / 140 = 3e-13 in the middle, up to 30 times that at the ends, and rounding.
    np.testing.assert_allclose(quadrature.instants(averages)[0], np.sin(k * t), atol=5e-11)


def test_integrals_between_samples_are_exact_for_a_quintic_and_run_from_any_sample():
    t = np.arange(12.0)
    powers = np.arange(6)
    y = t ** powers[:, None]
    whole = t ** (powers[:, None] + 1) / (powers[:, None] + 1)
    # Terms up to 11^6 / 6 = 3e5 cancel to the last digits.
    np.testing.assert_allclose(
        quadrature.interval_integrals(y, 1.0), np.diff(whole, axis=1), rtol=1e-10, atol=1e-9
    )
    start = np.arange(6.0)
    run = quadrature.running_integral(y, start, 1.0, 2)
    np.testing.assert_allclose(run - start[:, None], whole - whole[:, [2]], rtol=1e-9, atol=1e-8)
