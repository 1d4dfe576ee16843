"""The sections of a scenario about temperature, nonlinearity and warm-up."""

import numpy as np
import pytest

from rotcli.errors import RigError
from rotcli.rig.environment import read_environment
from rotcli.rig.scenario import read_scenario

DEG = np.pi / 180
DPH = DEG / 3600


def read(**sections):
    return read_environment("s.toml", sections)


def test_the_sections_are_read_in_their_units():
    found = read(
        temperature={"profile": [[0, 20], [60, 80.0]], "lag": 30, "step": 0.1},
        thermal={"gyro_bias": [3.6, 0.36], "gyro_scale": [[1], [2], [3]], "accel_bias": [1e-4]},
        nonlinearity={"quadratic": 30.0, "knee": [60, 15]},
        warm_up={"amplitude": 36.0, "time": 100},
    )
    np.testing.assert_array_equal(found.temperature, [[0, 20], [60, 80]])
    assert (found.thermometer_lag, found.thermometer_step, found.reference) == (30, 0.1, 20)
    np.testing.assert_allclose(found.gyro_bias, np.tile(np.array([3.6, 0.36]) * DPH, (3, 1)))
    np.testing.assert_allclose(found.gyro_scale[:, 0], [1e-6, 2e-6, 3e-6])
    assert found.accel_bias.shape == (3, 1)
    assert found.nonlinearity.full_scale == pytest.approx(100 * DEG)
    assert found.nonlinearity.knee_rate == pytest.approx(15 * DEG)
    assert found.warm_up == pytest.approx(36 * DPH)
    assert found.warm_up_time == 100


def test_a_scenario_without_the_sections_has_no_environment():
    data = {"site": {"latitude": 1.0}}
    assert read_environment("s.toml", data) is None
    assert data == {"site": {"latitude": 1.0}}


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        ({"temperature": {}}, "profile: missing"),
        ({"temperature": {"profile": [[0]]}}, r"\[0\] is not \[s, degC\]"),
        ({"temperature": {"profile": [[9, 1], [3, 1]]}}, "must not decrease"),
        ({"temperature": {"profil": []}}, "similar: profile"),
        ({"thermal": {"gyro_bias": [1]}}, r"no \[temperature\] profile"),
        ({"warm_up": {"time": 0}}, "allowed: above 0"),
        ({"nonlinearity": {"knee": 3}}, r"must be \[deg/h, deg/s\]"),
        ({"nonlinearity": {"full_scale": 0}}, "allowed: above 0"),
    ],
)
def test_an_impossible_section_is_an_error(sections, message):
    with pytest.raises(RigError, match=message):
        read(**sections)


def test_three_lists_of_powers_or_one_are_allowed():
    profile = {"profile": [[0, 20]]}
    for wrong in ([[1], [2]], 5, [1, 2, 3, 4, 5, 6]):
        with pytest.raises(RigError, match="gyro_bias"):
            read(temperature=profile, thermal={"gyro_bias": wrong})


@pytest.mark.parametrize("name", ["scale-test", "thermal-test"])
def test_installed_scenarios_are_found_by_name(name):
    found = read_scenario(name)
    assert found.environment is not None
    assert len(found.legs) > 10
    with pytest.raises(RigError, match="cannot be read"):
        read_scenario("no-such-test")
