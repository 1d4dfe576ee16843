"""Medians, quantiles and distinct values are numpy's."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from rotcli.order import distinct, median, quantile

NUMBERS = st.floats(-1e6, 1e6)


@given(arrays(float, st.tuples(st.integers(1, 5), st.integers(1, 9)), elements=NUMBERS))
def test_the_median_is_numpys(values):
    assert median(values) == np.median(values)
    for axis in (0, 1):
        found = median(values, axis=axis, keepdims=True)
        np.testing.assert_array_equal(found, np.median(values, axis=axis, keepdims=True))


@given(arrays(float, st.integers(1, 40), elements=NUMBERS), st.floats(0.0, 1.0))
def test_the_quantile_is_numpys(values, share):
    # Rounding of the interpolation, of numbers up to 1e6.
    np.testing.assert_allclose(quantile(values, share), np.quantile(values, share), atol=1e-9)


@given(arrays(float, st.integers(1, 20), elements=st.integers(-3, 3).map(float)))
def test_the_distinct_values_are_numpys(values):
    np.testing.assert_array_equal(distinct(values), np.unique(values))
