"""Gauss-Newton on block means: recovery, consistency, drift, goodness by kind."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.triad import parameters as p
from rotcli.models.triad import sequences
from rotcli.models.triad.blocks import expected_means
from rotcli.models.triad.kinematics import table
from rotcli.triad.drift import Drift
from rotcli.triad.estimate import estimate
from rotcli.triad.selection import weighted_fit, without_unseen_groups
from rotcli.units import DEG, DEG_PER_HOUR
from tests.triad import bench

_GYRO_WALK, _ACCEL_WALK = 0.35 * DEG_PER_HOUR, 1e-5


def _truth(rng, problem):
    x = np.zeros(p.count())
    x[problem.free] = rng.standard_normal(len(problem.free)) * problem.size
    for k in (p.BASE_AZIMUTH, p.GRAVITY):
        x[k] = rng.standard_normal() * problem.prior_sigma[k]
    return x


def _noise(rng, blocks):
    return bench.SIGMA_1[:, None] / np.sqrt(blocks.count) * rng.standard_normal(blocks.means.shape)


def _run(rng, problem, blocks, x, **options):
    means = expected_means(problem.table, x, blocks) + _noise(rng, blocks)
    return estimate(problem, replace(blocks, means=means), **options)


def test_exact_means_return_the_parameters_exactly():
    problem, blocks = bench.problem(bench.three_axes()), bench.blocks(sequences.m5())
    x = bench.spot_parameters()
    x[p.GYRO_ASYMMETRY] = x[p.ACCEL_ASYMMETRY] = 0.0
    x[p.BASE_AZIMUTH] = x[p.GRAVITY] = 0.0
    fit = estimate(problem, replace(blocks, means=expected_means(problem.table, x, blocks)))
    error = np.abs(fit.x - x)[problem.free] / fit.sigma[problem.free]
    assert error.max() < 2e-3  # the last step is below 1e-3 sigma
    assert fit.passes <= 4


def test_large_errors_need_four_passes():
    rng = np.random.default_rng(3)
    problem, blocks = bench.problem(bench.three_axes()), bench.blocks(sequences.s2())
    x = np.zeros(p.count())
    x[p.N] = (-0.24 * np.eye(3) + 0.03 * rng.uniform(-1, 1, (3, 3))).ravel()
    x[p.M] = (0.05 * np.eye(3) + 0.03 * rng.uniform(-1, 1, (3, 3))).ravel()
    x[p.ACCEL_BIAS], x[p.GYRO_BIAS] = 0.5, DEG
    x[[p.BASE_EAST, p.MIDDLE_ZERO]] = 0.02
    x[[p.CLOCK_GYRO, p.CLOCK_ACCEL]] = 0.03
    fit = _run(rng, problem, blocks, x)
    error = (fit.x - x)[problem.free] / fit.sigma[problem.free]
    assert np.abs(error).max() < 4.5
    assert np.sqrt(np.mean(error**2)) < 1.4
    assert fit.passes <= 6
    assert fit.scale == 1.0


def test_errors_of_a_few_runs_agree_with_their_sigmas():
    rng = np.random.default_rng(11)
    problem, blocks = bench.problem(bench.three_axes()), bench.blocks(sequences.m5())
    errors = []
    for _ in range(10):
        x = _truth(rng, problem)
        fit = _run(rng, problem, blocks, x)
        errors.append((fit.x - x)[problem.free] / fit.sigma[problem.free])
        assert fit.passes <= 4
    pooled = float(np.sqrt(np.mean(np.square(errors))))
    # 10 runs of 54 parameters, correlated: spread of the pooled value about 0.04.
    assert 0.85 < pooled < 1.15


def test_residuals_of_each_kind_are_white_noise():
    rng = np.random.default_rng(4)
    problem, blocks = bench.problem(bench.three_axes()), bench.blocks(sequences.s2())
    fit = _run(rng, problem, blocks, bench.spot_parameters() * 0.1)
    assert [k.kind for k in fit.kinds] == ["still", "turn", "ramp"]
    assert sum(k.blocks for k in fit.kinds) == len(blocks)
    for kind in fit.kinds:
        spread = 4.0 * np.sqrt(2.0 / (3.0 * kind.blocks))
        assert abs(kind.gyro - 1.0) < spread + 0.1
        assert abs(kind.accel - 1.0) < spread + 0.1


def test_a_clock_that_is_ignored_shows_in_moving_blocks_only():
    rng = np.random.default_rng(4)
    problem, blocks = bench.problem(bench.three_axes()), bench.blocks(sequences.s2())
    free = problem.free[(problem.free != p.CLOCK_GYRO) & (problem.free != p.CLOCK_ACCEL)]
    x = np.zeros(p.count())
    x[p.CLOCK_ACCEL] = 5e-3
    fit = _run(rng, replace(problem, free=free), blocks, x)
    by = {k.kind: k.accel for k in fit.kinds}
    assert by["turn"] > 5.0
    assert by["still"] < 5.0
    assert fit.scale > 1.5


def _random_walk():
    """Return random walks of all channels: 0.35 deg/h/sqrt(s) and 1e-5 m/s^2/sqrt(s)."""
    gyro, accel = (SlowNoise(rate_random_walk=walk) for walk in (_GYRO_WALK, _ACCEL_WALK))
    return Drift((gyro,) * 3 + (accel,) * 3, 1.0 / bench.RATE)


def _drifting_run(rng, problem, blocks, drift):
    """Return an estimate of errors of zero, the biases walking around their mean."""
    walk = np.repeat([_GYRO_WALK, _ACCEL_WALK], 3)
    grid = np.arange(0.0, blocks.time[-1] + 1.0, 0.5)
    path = np.cumsum(rng.standard_normal((6, len(grid))), axis=1) * np.sqrt(0.5)
    path = (path - path.mean(axis=1, keepdims=True)) * walk[:, None]
    means = expected_means(problem.table, np.zeros(p.count()), blocks)
    means += np.array([np.interp(blocks.time, grid, c) for c in path]) + _noise(rng, blocks)
    return estimate(problem, replace(blocks, means=means), drift=drift)


def test_sigmas_contain_a_random_walk_of_the_biases():
    rng = np.random.default_rng(8)
    problem, blocks = bench.problem(bench.three_axes()), bench.blocks(sequences.s2())
    errors = []
    for _ in range(3):
        fit = _drifting_run(rng, problem, blocks, _random_walk())
        assert fit.drift
        assert fit.chi2 / fit.dof == pytest.approx(1.0, abs=0.04)
        errors.append(fit.x[problem.free] / fit.sigma[problem.free])
    # 3 runs of 54 correlated parameters.
    assert 0.7 < np.sqrt(np.mean(np.square(errors))) < 1.3


@pytest.mark.campaign
def test_600_runs_are_consistent_parameter_by_parameter():
    rng = np.random.default_rng(2026)
    problem, blocks = bench.problem(bench.three_axes()), bench.blocks(sequences.s1())
    errors, nees = [], []
    for _ in range(600):
        x = _truth(rng, problem)
        fit = _run(rng, problem, blocks, x)
        error = (fit.x - x)[problem.free]
        errors.append(error / fit.sigma[problem.free])
        nees.append(float(error @ np.linalg.solve(fit.covariance, error)))
        assert fit.passes <= 4
    spread = np.std(errors, axis=0)
    assert spread.min() > 0.9
    assert spread.max() < 1.1
    assert 0.99 < np.sqrt(np.mean(np.square(errors))) < 1.01
    assert abs(np.mean(nees) - 54.0) < 1.96 * np.sqrt(108.0 / 600.0)


@pytest.mark.campaign
def test_300_drifting_runs_are_consistent_parameter_group_by_group():
    rng = np.random.default_rng(77)
    problem, blocks = bench.problem(bench.three_axes()), bench.blocks(sequences.s1())
    fits = (_drifting_run(rng, problem, blocks, _random_walk()) for _ in range(300))
    errors = np.array([fit.x[problem.free] / fit.sigma[problem.free] for fit in fits])
    # Scale factors of the accelerometers depend on the prior of gravity, which has no error here.
    excluded = {p.INDEX[name] for name in ("Kax", "Kay", "Kaz")}
    rms = {}
    for name in ("N", "d", "G", "M", "b", "K2", "R"):
        members = {p.INDEX[n] for n in p.GROUPS[name].names} - excluded
        at = [k for k, q in enumerate(problem.free) if q in members]
        rms[name] = float(np.sqrt(np.mean(np.square(errors[:, at]))))
    assert all(0.95 < value < 1.05 for value in rms.values()), rms


def test_an_unknown_azimuth_is_found_from_the_opposite_direction():
    rng = np.random.default_rng(21)
    priors = p.default_priors()
    priors[p.BASE_AZIMUTH] = np.pi / 2.0
    problem = bench.problem(bench.three_axes(), priors=priors)
    blocks = bench.blocks(sequences.m5())
    x = np.zeros(p.count())
    x[p.BASE_AZIMUTH] = np.deg2rad(175.0)
    means = expected_means(problem.table, x, blocks) + _noise(rng, blocks)
    fit, _ = weighted_fit(problem, replace(blocks, means=means), None)
    assert fit.converged
    assert abs(fit.x[p.BASE_AZIMUTH] - x[p.BASE_AZIMUTH]) < 4.0 * fit.sigma[p.BASE_AZIMUTH]
    assert fit.sigma[p.BASE_AZIMUTH] < 0.3


def _complete_and_reduced(problem, blocks, drift):
    data = replace(blocks, means=expected_means(problem.table, np.zeros(p.count()), blocks))
    complete, factors = weighted_fit(problem, data, drift)
    fit, _, assumed = without_unseen_groups(complete, factors, data, drift, "table")
    return fit, {e.name for e in assumed}


def test_a_group_that_the_noise_hides_stays_in_the_estimate():
    # Flicker noise leaves 3.4 deg/h/g in six minutes: no value, but its effect on others counts.
    noise = SlowNoise(bias_instability=15.66 * DEG_PER_HOUR)
    drift = Drift((noise,) * 3 + (SlowNoise(),) * 3, 1.0 / bench.RATE)
    problem = bench.problem(bench.three_axes(), priors=p.weak_priors())
    fit, assumed = _complete_and_reduced(problem, bench.blocks(sequences.m5()), drift)
    assert fit.sigma[p.G].min() > p.WEAK_FRACTION * 10.0 * p.G_UNIT
    assert assumed == set()
    assert set(range(p.G.start, p.G.stop)) <= set(fit.problem.free)


def test_a_group_that_a_motion_does_not_show_is_assumed_to_be_zero():
    vertical = table("z", latitude=bench.LATITUDE, gravity=bench.GRAVITY)
    problem = bench.problem(vertical, priors=p.weak_priors())
    blocks = bench.blocks(sequences.one_axis(1, (0.0, 180.0), 30.0, turns=3))
    fit, assumed = _complete_and_reduced(problem, blocks, None)
    assert assumed == {*p.GROUPS["G"].names, *p.GROUPS["K2"].names}
    assert fit.sigma[p.GYRO_BIAS.stop - 1] < 3.0 * DEG_PER_HOUR
