"""A step of a bias in the middle of a log: statistic, size and time against least squares."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.triad import parameters as p
from rotcli.models.triad import sequences
from rotcli.models.triad.blocks import expected_means
from rotcli.triad import estimate as estimate_module
from rotcli.triad.bias_steps import STEP_SIGMAS, StepTest, whitened_rows
from rotcli.triad.drift import Drift
from rotcli.triad.estimate import estimate
from rotcli.triad.residuals import residual_findings
from rotcli.triad.selection import weighted_fit
from rotcli.units import DEG_PER_HOUR
from tests.triad import bench

_SLOW = SlowNoise(bias_instability=15.66 * DEG_PER_HOUR, rate_random_walk=0.35 * DEG_PER_HOUR)
_DRIFT = Drift((_SLOW,) * 3 + (SlowNoise(bias_instability=4.5e-4),) * 3, 1.0 / bench.RATE)
_STEP = 412.0 * DEG_PER_HOUR


def _case(rng, *, channel=1, size=0.0, at=0.5):
    """Return problem and blocks of white noise with a step of a channel at a share of the log."""
    problem, blocks = bench.problem(bench.three_axes()), bench.blocks(sequences.m5())
    means = expected_means(problem.table, np.zeros(p.count()), blocks)
    means += bench.SIGMA_1[:, None] / np.sqrt(blocks.count) * rng.standard_normal(means.shape)
    middle = blocks.time[0] + at * (blocks.time[-1] - blocks.time[0])
    means[channel, blocks.time > middle] += size
    return problem, replace(blocks, means=means)


def _findings(problem, blocks, drift):
    fit, factors = weighted_fit(problem, blocks, drift)
    return residual_findings(fit, factors, blocks, "imu", np.ones(2))


@pytest.mark.parametrize("drift", [None, _DRIFT])
def test_the_statistic_is_the_gain_of_a_fit_with_the_step_as_parameter(drift):
    problem, blocks = _case(np.random.default_rng(5), size=0.3 * _STEP)
    fit = estimate(problem, blocks, drift=drift)
    test = StepTest(fit, len(blocks))
    # Evenly over the log, without its ends.
    np.testing.assert_array_equal(test.at, np.round(len(blocks) * np.arange(1.0, 25.0) / 25.0))
    k = len(test.at) // 2
    step = np.zeros((6, len(blocks), 1))
    step[1, test.at[k] :] = 1.0
    whitened, A, h = fit.whitening.begin(), [], []
    for which, rows in whitened_rows(fit, blocks):
        test.add(which, rows)
        A.append(rows)
        h.append(whitened.rows(which, step[:, which]))
    A = np.concatenate(A, axis=1).reshape(-1, len(problem.free))
    h = np.concatenate(h, axis=1).reshape(-1, 1)
    # Priors as further rows; the step as one further column of ordinary least squares.
    prior = np.diag(problem.size / problem.prior_sigma[problem.free])
    joined = np.block([[A, h], [prior, np.zeros((len(prior), 1))]])
    right = np.concatenate([fit.innovations.ravel(), np.zeros(len(prior))])
    solution, left, *_ = np.linalg.lstsq(joined, right, rcond=None)
    before = np.linalg.lstsq(joined[:, :-1], right, rcond=None)[1]
    channel, found, size, z = test.largest()
    assert channel == 1
    power = test.statistics()
    assert power[1, k] ** 2 == pytest.approx((before - left)[0] / fit.scale**2, rel=1e-3)
    if found == k:
        assert size == pytest.approx(solution[-1], rel=1e-3)
    assert z >= power[1, k]


def test_a_step_that_the_parameters_imitate_keeps_a_millionth_of_its_information():
    power = np.array([[4e8, 4e8, 0.0]])
    joint = np.array([[[2e4, 1e4, 0.0]]])  # the square is what the parameter explains
    problem = SimpleNamespace(size=np.array([10.0]))
    fit = SimpleNamespace(problem=problem, covariance=np.array([[900.0]]), scale=3.0)
    test = SimpleNamespace(_fit=fit, _joint=joint, _power=power)
    np.testing.assert_allclose(StepTest._left(test), [[4e2, 3e8, np.inf]], rtol=1e-9)


@pytest.mark.parametrize("kept", [True, False])
def test_a_step_that_no_kind_of_block_shows_is_reported(kept, monkeypatch):
    if not kept:  # as of a log of many hours
        monkeypatch.setattr(estimate_module, "KEPT_BLOCKS", 0)
    problem, blocks = _case(np.random.default_rng(6), size=_STEP)
    found = _findings(problem, blocks, _DRIFT)
    assert [f.code for f in found] == ["bias-step"]
    size = float(found[0].text.split("gyro_y changes by ")[1].split()[0])
    assert size == pytest.approx(412.0, rel=0.15)
    middle = 0.5 * (blocks.time[0] + blocks.time[-1])
    assert float(found[0].where.split()[0]) == pytest.approx(middle, abs=2.0)
    assert found[0].value > STEP_SIGMAS


def test_a_step_of_an_accelerometer_near_the_end_is_reported():
    problem, blocks = _case(np.random.default_rng(7), channel=5, size=0.01, at=0.85)
    found = _findings(problem, blocks, _DRIFT)
    assert [f.code for f in found] == ["bias-step"]
    assert "accel_z changes by" in found[0].text


@pytest.mark.parametrize("at", [0.015, 0.985])
def test_a_step_beyond_the_outer_candidates_is_found_to_a_fiftieth_of_the_log(at):
    problem, blocks = _case(np.random.default_rng(12), size=5.0 * _STEP, at=at)
    fit = estimate(problem, blocks)
    test = StepTest(fit, len(blocks))
    for which, rows in whitened_rows(fit, blocks):
        test.add(which, rows)
    found = test.result(blocks, lambda: whitened_rows(fit, blocks))
    duration = blocks.time[-1] - blocks.time[0]
    assert found.channel == 1
    assert (found.time - blocks.time[0]) / duration == pytest.approx(at, abs=0.003)
    assert found.size == pytest.approx(5.0 * _STEP, rel=0.1)


def test_without_noise_figures_the_advice_names_them():
    problem, blocks = _case(np.random.default_rng(8), size=0.2 * _STEP)
    (found,) = _findings(problem, blocks, None)
    assert found.code == "bias-step"
    assert "set [imu] bias_instability" in found.text


def test_a_single_deviating_block_is_a_shock():
    problem, blocks = _case(np.random.default_rng(9))
    blocks.means[0, 700] += 30.0 * bench.SIGMA_1[0] / np.sqrt(blocks.count[700])
    (found,) = _findings(problem, blocks, _DRIFT)
    assert found.code == "disturbed-blocks"


def test_statistics_of_right_models_are_standard_normal():
    rng, every = np.random.default_rng(10), []
    for _ in range(12):
        problem, blocks = _case(rng)
        fit = estimate(problem, blocks)
        test = StepTest(fit, len(blocks))
        for which, rows in whitened_rows(fit, blocks):
            test.add(which, rows)
        every.append(test.statistics())
    # 12 runs of 6 channels with some 8 independent times each.
    assert np.sqrt(np.mean(np.square(every))) == pytest.approx(1.0, abs=0.12)
    assert np.max(every) < 4.8


def test_large_slow_noise_and_a_jacobian_of_other_parameters_are_no_step(monkeypatch):
    # As in a log of a day: the white noise of a mean over the log is far below the slow noise, and
    # the rows are computed again at parameters 1e-3 away from those of the estimate's Jacobian.
    monkeypatch.setattr(estimate_module, "KEPT_BLOCKS", 0)
    rng = np.random.default_rng(11)
    problem, blocks = bench.problem(bench.three_axes()), bench.blocks(sequences.m5())
    x = np.zeros(p.count())
    x[problem.free] = rng.standard_normal(len(problem.free)) * problem.size
    quiet = replace(problem, sigma_1=0.02 * bench.SIGMA_1)
    noise = quiet.sigma_1[:, None] / np.sqrt(blocks.count) * rng.standard_normal((6, len(blocks)))
    means = expected_means(problem.table, x, blocks) + noise
    assert _findings(quiet, replace(blocks, means=means), _DRIFT) == []
