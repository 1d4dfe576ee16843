import pytest
from scipy.special import chdtrc, chdtri

from rotcli.models.numerics.chi_squared import exceeding_probability, upper_limit


@pytest.mark.parametrize("dof", [1, 2, 3, 10, 22, 199, 598, 5000])
@pytest.mark.parametrize("probability", [0.99, 0.5, 0.01, 3e-4, 1e-9])
def test_limits_are_those_of_scipy(dof, probability):
    assert upper_limit(dof, probability) == pytest.approx(chdtri(dof, probability), rel=1e-9)


@pytest.mark.parametrize("dof", [1, 7, 300])
@pytest.mark.parametrize("x", [0.01, 3.0, 50.0, 320.0, 900.0])
def test_probabilities_are_those_of_scipy(dof, x):
    assert exceeding_probability(x, dof) == pytest.approx(chdtrc(dof, x), rel=1e-9, abs=1e-14)


@pytest.mark.parametrize("x", [-1.0, 0.0])
def test_chi_squared_exceeds_zero_and_less_with_certainty(x):
    assert exceeding_probability(x, 3) == 1.0
