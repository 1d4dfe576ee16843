"""Root mean square at the ends of the range of numbers."""

import numpy as np
import pytest

from rotcli.models.noise_numbers import root_mean_square


@pytest.mark.parametrize("scale", [1e-300, 1.0, 1e300])
def test_no_square_overflows_or_vanishes(scale):
    # 3, 4 and 0: sqrt(25/3), whatever the scale.
    values = scale * np.array([3.0, -4.0, 0.0])
    assert root_mean_square(values) == pytest.approx(scale * np.sqrt(25.0 / 3.0), rel=1e-14)


def test_zeros_have_zero():
    assert root_mean_square(np.zeros(3)) == 0.0
