"""Disturbed blocks of residuals whose noise is correlated."""

import numpy as np

from rotcli.models.expected.companions import _disturbed_blocks


def test_a_disturbed_block_is_named_without_its_neighbours():
    # An autoregressive process: a block's residual given the others is white.
    n, rho = 40, 0.95
    covariance = rho ** np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    means = np.zeros(n)
    means[17] = 8.0 * np.sqrt((1.0 - rho**2) / (1.0 + rho**2))
    assert _disturbed_blocks(means, np.linalg.cholesky(covariance)) == {17}
