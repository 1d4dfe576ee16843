"""Noise of the triads that the residuals enlarge."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from rotcli.models.triad import parameters as p
from rotcli.models.triad import sequences
from rotcli.models.triad.blocks import expected_means
from rotcli.triad import selection
from rotcli.triad.estimate import KindGoodness
from tests.triad import bench


@pytest.mark.parametrize(("gyro", "accel"), [(2.0, 1.0), (1.0, 3.0)])
def test_noise_larger_than_stated_is_found_for_each_triad(gyro, accel):
    problem, blocks = bench.problem(bench.three_axes()), bench.blocks(sequences.m5())
    noise = np.random.default_rng(3).standard_normal((6, len(blocks)))
    noise *= (np.repeat([gyro, accel], 3) * bench.SIGMA_1)[:, None] / np.sqrt(blocks.count)
    means = expected_means(problem.table, np.zeros(p.count()), blocks) + noise
    fit, factors = selection.weighted_fit(problem, replace(blocks, means=means), None)
    # Of 3 n values: a relative sigma of 1 / sqrt(6 n), 1 % for 1300 blocks.
    assert factors == pytest.approx((gyro, accel), rel=0.04)
    assert fit.chi2 / fit.dof == pytest.approx(1.0, abs=0.05)
    np.testing.assert_allclose(
        fit.problem.sigma_1, bench.SIGMA_1 * np.repeat(factors, 3), rtol=1e-12
    )


@dataclass(frozen=True)
class Goodness:
    kinds: list
    rank: int = 5
    passes: int = 2


@dataclass(frozen=True)
class Weights:
    sigma_1: np.ndarray


@pytest.mark.parametrize(("ratio", "factor"), [(1.1330, 1.0), (1.1337, np.sqrt(1.1337))])
def test_noise_is_enlarged_beyond_four_sigma_of_chi_squared(ratio, factor, monkeypatch):
    # 600 blocks have 1800 values a triad: 1 + 4 sqrt(2 / 1800) is 1.13333.
    kinds = [KindGoodness("still", 200, 1.0, 1.0), KindGoodness("turn", 400, 1.0, 1.0)]
    spread = [replace(kinds[0], accel=ratio + 0.2), replace(kinds[1], accel=ratio - 0.1)]
    given = []

    def estimate(problem, blocks, *, drift, start):
        given.append(problem.sigma_1)
        return Goodness(kinds, rank=0)

    class First(Goodness):
        x = None

    monkeypatch.setattr(selection, "_first_fit", lambda *_: First(spread))
    monkeypatch.setattr(selection, "estimate", estimate)
    fit, factors = selection.weighted_fit(Weights(np.ones(6)), range(600), None)
    assert factors == pytest.approx((1.0, factor))
    if factor > 1.0:
        np.testing.assert_allclose(given, [[1.0] * 3 + [factor] * 3])
        assert (fit.rank, fit.passes) == (5, 4)
    else:
        assert not given


@dataclass(frozen=True)
class Trial:
    azimuth: float
    converged: bool
    chi2: float


@pytest.mark.parametrize(("sigma", "starts"), [(29.0, 0), (31.0, 4)])
def test_an_unknown_azimuth_is_searched_from_four_quarters(sigma, starts, monkeypatch):
    tried = []

    def estimate(problem, blocks, *, drift, start=None):
        if start is None:
            return Trial(0.0, True, 0.0)
        tried.append(np.degrees(start[p.BASE_AZIMUTH]))
        assert np.count_nonzero(start) <= 1
        # The least chi-squared of those that converge counts.
        return Trial(tried[-1], tried[-1] != 180.0, {180.0: 1.0, -90.0: 2.0}.get(tried[-1], 3.0))

    monkeypatch.setattr(selection, "estimate", estimate)
    problem = bench.problem(bench.three_axes())
    priors = problem.prior_sigma.copy()
    priors[p.BASE_AZIMUTH] = np.radians(sigma)
    found = selection._first_fit(replace(problem, prior_sigma=priors), None, None)
    assert sorted(tried) == pytest.approx([-90.0, 0.0, 90.0, 180.0] if starts else [])
    assert found.azimuth == (pytest.approx(-90.0) if starts else 0.0)
