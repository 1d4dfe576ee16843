import numpy as np
import pytest

from rotcli.allan.survey.clipping import find_clipping


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_readings_that_pile_up_at_one_end_are_clipped(sign):
    noise = np.random.default_rng(0).standard_normal(20_000)
    found = find_clipping(sign * np.minimum(noise, 1.75))
    assert found.value == sign * 1.75
    # The normal distribution has 4.0 % beyond 1.75 sigma.
    assert found.share == pytest.approx(0.040, abs=0.005)


def test_the_stronger_side_is_returned():
    noise = np.random.default_rng(1).standard_normal(20_000)
    assert find_clipping(np.clip(noise, -1.0, 2.0)).value == -1.0
    assert find_clipping(np.clip(noise, -2.0, 1.0)).value == 1.0


@pytest.mark.parametrize("digit", [0.0, 0.3, 1.0, 3.0])
def test_noise_is_not_clipped_whatever_its_digit(digit):
    for seed in range(20):
        noise = np.random.default_rng(seed).standard_normal(20_000)
        readings = np.round(noise / digit) * digit if digit else noise
        assert find_clipping(readings) is None


def test_constant_readings_are_not_called_clipped():
    assert find_clipping(np.ones(1000)) is None
