"""A log that arrives in two parts, the first as long as a block and what is needed behind it."""

import numpy as np
import pytest

from rotcli.models import strapdown


@pytest.mark.parametrize("averages", [False, True])
@pytest.mark.parametrize(("cut", "done"), [(16_411, 0), (16_420, 0), (16_421, 16_384)])
def test_a_block_waits_for_the_samples_behind_it(cut, done, averages):
    interval, n = 0.01, 16_500
    rng = np.random.default_rng(3)
    w = np.array([0.3, 0.4, -0.2]) + 0.01 * rng.standard_normal((n, 3))
    f = np.array([0.1, -0.2, 9.8]) + 0.02 * rng.standard_normal((n, 3))
    start = strapdown.InitialState(0.9, 0.0, 100.0, np.array([1.0, 2.0, 0.0]), np.eye(3))
    complete = strapdown.mechanize_log(w, f, interval, start, averages=averages)
    parts = strapdown.Mechanization(interval, start, averages=averages)
    first = parts.advance(w[:cut], f[:cut])
    rest = parts.advance(w[cut:], f[cut:], last=True)
    assert len(first.height) == done
    joined = np.concatenate([first.v_n, rest.v_n])
    np.testing.assert_allclose(joined, complete.v_n, rtol=0.0, atol=1e-12)
