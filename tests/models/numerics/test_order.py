"""Median, quantiles and levels against those of numpy."""

import numpy as np
import pytest

from rotcli.models.numerics.order import distinct, median, medians, quantile


@pytest.mark.parametrize("n", [1, 2, 3, 10, 1001])
def test_median_quantile_and_levels_are_those_of_numpy(n):
    rng = np.random.default_rng(n)
    for values in (rng.standard_normal(n), np.round(rng.standard_normal(n)), np.zeros(n)):
        before = values.copy()
        assert median(values) == np.median(values)
        for share in (0.0, 0.05, 0.5, 0.9, 0.95, 0.999, 1.0):
            assert quantile(values, share) == np.quantile(values, share)
        np.testing.assert_array_equal(distinct(values), np.unique(values))
        np.testing.assert_array_equal(values, before)


@pytest.mark.parametrize("axis", [0, 1, -1])
@pytest.mark.parametrize("shape", [(4, 7), (1, 5), (6, 2, 3)])
def test_medians_along_an_axis_are_those_of_numpy(axis, shape):
    values = np.random.default_rng(3).standard_normal(shape)
    expected = np.median(values, axis=axis, keepdims=True)
    np.testing.assert_array_equal(medians(values, axis=axis), expected)
