"""The singular values of an SRINS and their states, next to the paper's table 1."""

import numpy as np
import pytest

from rotcli.srins.filter import FilterSettings
from rotcli.srins.model import STATES, VehicleMotion
from rotcli.srins.observability import dominant_states, observe
from rotcli.srins.observability_document import PUBLISHED, fields, singular_table
from rotcli.srins.plot import singular_figure
from rotcli.srins.reciprocation import RotationScheme

MOTION = VehicleMotion(np.radians(42.3), v_east=1.0)


@pytest.fixture(scope="module")
def document():
    rotation = RotationScheme(np.radians(6.0))
    result = observe(MOTION, FilterSettings(), rotation, hours=0.1)
    return fields(result, MOTION, rotation)


def test_the_nine_published_values_are_in_the_rows_of_their_states(document):
    rows = singular_table(document).rows
    assert {row[1]: row[3] for row in rows[:9]} == PUBLISHED
    assert all(row[3] is None for row in rows[9:])
    ours = {row[1]: row[2] for row in rows}
    # The values that a correct model shares with the paper: tilt about east and drift x to 0.5 %
    # (the size of gravity), position and velocity, the axial drift (g W cos L) to 0.2 %.
    for name in ("phi_E", "gyro_bias_x", "dV_N", "d_latitude", "d_longitude", "gyro_bias_z"):
        assert ours[name] == pytest.approx(PUBLISHED[name], rel=6e-3)
    # Tilts and drifts come in pairs of equal values: the paper's differ by a factor of 5.
    assert ours["phi_N"] == pytest.approx(ours["phi_E"], rel=1e-6)
    assert ours["gyro_bias_y"] == pytest.approx(ours["gyro_bias_x"], rel=1e-6)


def test_each_state_belongs_to_one_singular_value(document):
    assert sorted(document["singular_states"]) == sorted(STATES)


def test_the_states_of_equal_values_do_not_depend_on_the_basis_of_their_subspace():
    rng = np.random.default_rng(1)
    singular = np.array([3.0, 2.0, 2.0, 2.0, 1.0])
    names = set()
    for _ in range(20):
        Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        Vt = np.eye(5)
        Vt[1:4, 1:4] = Q
        found = dominant_states(singular, Vt)
        assert (found[0], found[4]) == (STATES[0], STATES[4])
        names.add(frozenset(found[1:4]))
    assert names == {frozenset(STATES[1:4])}


def test_the_histogram_has_a_bar_for_each_value_above_the_threshold(document):
    # S, figure 3: nine values, the paper's in the places of the same states.
    ours, paper = (bars for bars in singular_figure(document).axes[0].containers)
    heights = np.array([bar.get_height() for bar in ours])
    assert np.count_nonzero(np.isfinite(heights)) == 9
    np.testing.assert_allclose(heights[:9], document["singular_values"][:9])
    states = [state for state, bar in zip(document["singular_states"], paper, strict=True)
              if np.isfinite(bar.get_height())]  # fmt: skip
    assert set(states) == set(PUBLISHED)
