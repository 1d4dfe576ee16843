"""The linear filter against batch least squares and against simulated truth."""

import numpy as np

from rotcli.models.kalman import (
    gain_sequence,
    mean_bounds,
    normalized_squares,
    predict,
    smoothing_corrections,
    update,
)

DT = 0.5
PHI = np.array([[1.0, DT], [0.0, 1.0]])
Q = np.diag([0.0, 0.04])
R = np.array([[0.25]])
P0 = np.diag([4.0, 1.0])
H = np.array([[1.0, 0.0]])


def model(n):
    return np.broadcast_to(PHI, (n, 2, 2)), np.broadcast_to(H, (n, 1, 2))


def simulate(runs, n, rng):
    """Truth and measurements of the model itself: half the process noise before, half after."""
    x = rng.normal(size=(runs, 2)) * np.sqrt(np.diag(P0))
    truth, z = [], []
    for _ in range(n):
        half = np.sqrt(np.diag(Q) / 2.0)
        x = (x + rng.normal(size=x.shape) * half) @ PHI.T + rng.normal(size=x.shape) * half
        truth.append(x)
        z.append(x @ H.T + rng.normal(size=(runs, 1)) * np.sqrt(R[0, 0]))
    return np.array(truth), np.array(z)


def run(gains, z):
    x = np.zeros((z.shape[1], 2))
    estimates, innovations, corrections = [], [], []
    for k in range(len(z)):
        x = x @ gains.Phi[k].T
        innovation = z[k] - x @ H.T
        correction = innovation @ gains.K[k].T
        x = x + correction
        estimates.append(x)
        innovations.append(innovation)
        corrections.append(correction)
    return np.array(estimates), np.array(innovations), np.array(corrections)


def test_joseph_update_equals_the_information_form():
    K, S, P = update(P0, H, R)
    np.testing.assert_allclose(
        np.linalg.inv(P), np.linalg.inv(P0) + H.T @ np.linalg.inv(R) @ H, rtol=1e-13
    )
    np.testing.assert_allclose(K, P @ H.T @ np.linalg.inv(R), rtol=1e-13)
    np.testing.assert_allclose(S, [[4.25]])


def test_predict_adds_the_noise_half_before_and_half_after():
    expected = PHI @ P0 @ PHI.T + 0.5 * Q + 0.5 * PHI @ Q @ PHI.T
    np.testing.assert_allclose(predict(P0, PHI, Q), expected, rtol=1e-14)


def test_filter_and_smoother_equal_batch_least_squares():
    n = 12
    gains = gain_sequence(P0, *((model(n)[0]), Q, model(n)[1]), R)
    truth, z = simulate(3, n, np.random.default_rng(1))
    estimates, _, corrections = run(gains, z)
    added, covariance, _ = smoothing_corrections(gains, corrections)
    # Batch: the joint Gaussian of the complete trajectory, conditioned on all measurements at once.
    step = PHI @ (0.5 * Q) @ PHI.T + 0.5 * Q
    joint = np.zeros((2 * n, 2 * n))
    P = P0
    for i in range(n):
        P = PHI @ P @ PHI.T + step
        block = P
        for j in range(i, n):
            joint[2 * j : 2 * j + 2, 2 * i : 2 * i + 2] = block
            joint[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] = block.T
            block = PHI @ block
    HH = np.kron(np.eye(n), H)
    gain = joint @ HH.T @ np.linalg.inv(HH @ joint @ HH.T + R[0, 0] * np.eye(n))
    smoothed = np.einsum("ij,jr->ri", gain, z[:, :, 0]).reshape(3, n, 2).swapaxes(0, 1)
    after = (joint - gain @ HH @ joint).reshape(n, 2, n, 2)
    np.testing.assert_allclose(estimates + added, smoothed, atol=1e-12)
    for k in range(n):
        np.testing.assert_allclose(covariance[k], after[k, :, k], atol=1e-12)
    np.testing.assert_allclose(gains.posterior[-1], after[-1, :, -1], atol=1e-12)
    assert truth.shape == estimates.shape


def test_a_run_in_parts_is_the_run_in_one():
    n, cut = 12, 5
    Phi, H_all = model(n)
    complete = gain_sequence(P0, Phi, Q, H_all, R)
    _, z = simulate(3, n, np.random.default_rng(1))
    _, _, corrections = run(complete, z)
    first = gain_sequence(P0, Phi[:cut], Q, H_all[:cut], R)
    second = gain_sequence(first.posterior[-1], Phi[cut:], Q, H_all[cut:], R)
    for name in ("K", "S", "prior", "posterior"):
        parts = np.concatenate([getattr(first, name), getattr(second, name)])
        np.testing.assert_array_equal(parts, getattr(complete, name))
    added, covariance, _ = smoothing_corrections(complete, corrections)
    late, covariance_late, later = smoothing_corrections(second, corrections[cut:])
    early, covariance_early, _ = smoothing_corrections(first, corrections[:cut], later)
    np.testing.assert_array_equal(np.concatenate([early, late]), added)
    np.testing.assert_array_equal(np.concatenate([covariance_early, covariance_late]), covariance)


def test_a_gain_sequence_is_predict_and_update_in_turn():
    gains = gain_sequence(P0, *((model(3)[0]), Q, model(3)[1]), R)
    P = P0
    for k in range(3):
        prior = predict(P, PHI, Q)
        K, S, P = update(prior, H, R)
        for found, expected in zip(
            (gains.prior, gains.K, gains.S, gains.posterior), (prior, K, S, P), strict=True
        ):
            np.testing.assert_allclose(found[k], expected, rtol=1e-14)


def test_nees_and_nis_of_matched_truth_stay_within_their_bounds():
    n, runs = 40, 2000
    gains = gain_sequence(P0, *((model(n)[0]), Q, model(n)[1]), R)
    truth, z = simulate(runs, n, np.random.default_rng(2))
    estimates, innovations, _ = run(gains, z)
    nis = normalized_squares(innovations, gains.S[:, None])
    low, high = mean_bounds(1, n * runs, confidence=0.999)
    assert low < nis.mean() < high
    nees = normalized_squares(truth[-1] - estimates[-1], gains.posterior[-1])
    low, high = mean_bounds(2, runs, confidence=0.999)
    assert low < nees.mean() < high
    # The test can fail: a filter that believes in half the noise leaves the band.
    assert (
        not low
        < normalized_squares(truth[-1] - estimates[-1], gains.posterior[-1] / 2).mean()
        < high
    )


def test_bounds_of_a_mean_are_those_of_the_chi_squared_distribution():
    from scipy.stats import chi2

    for degrees, count in ((1, 1), (3, 100), (12, 40), (3, 400), (3, 6000), (2, 100_000)):
        low, high = mean_bounds(degrees, count)
        expected = chi2.ppf([0.025, 0.975], degrees * count) / count
        np.testing.assert_allclose([low, high], expected, rtol=2e-6)
