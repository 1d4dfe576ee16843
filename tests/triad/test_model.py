"""The forward model and its derivatives, against values of an independent prototype."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rotcli.models.triad import parameters as p
from rotcli.models.triad.jacobian import jacobian
from rotcli.models.triad.kinematics import Pose, motion, table
from rotcli.models.triad.sensor import readings
from rotcli.units import DEG
from tests.triad import bench

# 12 digits of the prototype; its last digit is rounded, its g has ten digits.
_TOLERANCE = 5e-12


def _readings(x, nominal=None):
    return readings(
        nominal or bench.three_axes(),
        x,
        bench.SPOT_ANGLES,
        bench.SPOT_RATES,
        bench.SPOT_ACCELERATIONS,
    )


def test_readings_agree_with_the_prototype_to_its_digits():
    expected = (
        np.array(
            [
                [0.000257300162, -0.000215996887, 0.000439758543],
                [0.028333746724, -0.0117516079, 9.830308280684],
                [-0.614697880931, -0.672403049563, 0.516214660255],
                [-5.75551252986, -6.325739057859, 4.808420059617],
                [0.264125715089, 2.079564760786, 0.464096288162],
                [2.187588034364, 9.460890825956, -1.065917775998],
            ]
        )
        .reshape(3, 6)
        .T
    )
    for k in range(3):
        np.testing.assert_allclose(
            _readings(bench.spot_parameters())[:3, k], expected[:3, k], rtol=0, atol=2e-12
        )
    np.testing.assert_allclose(
        _readings(bench.spot_parameters())[3:], expected[3:], rtol=0, atol=_TOLERANCE
    )


def test_perfect_sensors_agree_with_the_prototype():
    expected = [0.264035986404, 2.082544631336, 0.461117612918]
    expected += [2.385472619026, 9.474060791097, -0.868241027983]
    found = _readings(np.zeros(p.count()))[:, 2]
    np.testing.assert_allclose(found, expected, rtol=0, atol=_TOLERANCE)


def test_motion_agrees_with_the_prototype():
    x = bench.spot_parameters()
    pose = Pose(bench.three_axes(), x, bench.SPOT_ANGLES, np.zeros(3, dtype=np.int64))
    moved = motion(pose, x, bench.SPOT_RATES, bench.SPOT_ACCELERATIONS)
    for found, expected in (
        (moved.table_rate, [0.26307548943, 2.082588508864, 0.461893431651]),
        (moved.earth_rate, [5.824167668e-5, 4.367269087e-5, -4.254090502e-6]),
        (moved.acceleration, [-0.736872864568, -0.137816210958, 0.064059820851]),
        (moved.force, [2.387367850976, 9.475663054718, -0.847559872547]),
    ):
        np.testing.assert_allclose(found[:, 2], expected, rtol=0, atol=_TOLERANCE)


def _difference(nominal, x, k, step, mounting):
    moved = (bench.SPOT_ANGLES, bench.SPOT_RATES, bench.SPOT_ACCELERATIONS)
    moved = tuple(a[: nominal.axis_count] for a in moved)
    up, down = x.copy(), x.copy()
    up[k] += step
    down[k] -= step
    return (readings(nominal, up, *moved, mounting) - readings(nominal, down, *moved, mounting)) / (
        2.0 * step
    )


@pytest.mark.parametrize("axes", [("z", "x", "y"), ("y", "z"), ([0.6, 0.0, 0.8],)])
def test_derivatives_agree_with_differences(axes):
    # Without levers nothing is left out of the derivatives: differences then agree to rounding.
    nominal = table(
        axes,
        latitude=bench.LATITUDE,
        gravity=bench.GRAVITY,
        mountings=bench.cube(bench.X, bench.Y)[:3],
    )
    x = np.concatenate([bench.spot_parameters(), [2e-3, -1e-3, 3e-3, 1e-3, 2e-3, -2e-3]])
    x[p.LEVERS] = 0.0
    mounting = np.array([0, 1, 2])
    moved = (bench.SPOT_ANGLES, bench.SPOT_RATES, bench.SPOT_ACCELERATIONS)
    J = jacobian(nominal, x, *(a[: nominal.axis_count] for a in moved), mounting)
    sizes = p.typical_sizes(3)
    for k in p.select(p.WITH_ASYMMETRY, nominal.axis_count, mountings=3):
        by_difference = _difference(nominal, x, k, 1e-2 * sizes[k], mounting)
        largest = np.abs(by_difference).max()
        error = np.abs(J[:, k] - by_difference).max()
        assert error < 3e-5 * largest + 1e-12, (p.names(3)[k], error, largest)


def test_a_lever_changes_the_dropped_columns_by_less_than_two_percent():
    x = bench.spot_parameters()
    moved = (bench.SPOT_ANGLES, bench.SPOT_RATES, bench.SPOT_ACCELERATIONS)
    J = jacobian(bench.three_axes(), x, *moved)
    sizes = p.typical_sizes()
    for k in (p.BASE_EAST, p.OUTER_MIDDLE, p.MIDDLE_ZERO, p.CLOCK_ACCEL):
        by_difference = _difference(bench.three_axes(), x, k, 1e-2 * sizes[k], np.zeros(3, int))
        error = np.abs(J[:, k] - by_difference).max()
        assert error < 0.02 * np.abs(by_difference).max()


def test_axes_of_any_order_turn_like_rotation_matrices():
    nominal = table("yzx", latitude=0.3, gravity=9.8)
    x = np.zeros(p.count())
    angles = np.array([[0.3], [-1.2], [2.2]])
    pose = Pose(nominal, x, angles, np.zeros(1, dtype=np.int64))
    C_bs = Rotation.from_euler("YZX", angles[:, 0]).as_matrix()
    v = np.array([0.2, -0.5, 1.1])
    np.testing.assert_allclose(pose.into_sensor(-1, v)[:, 0], C_bs.T @ v, atol=1e-14)


def test_the_names_of_the_axes_must_be_perpendicular_only_to_their_neighbours():
    # Outer and inner axis parallel at zero angles, as on many three-axis tables.
    nominal = table("zxz", latitude=0.3, gravity=9.8)
    x = np.zeros(p.count())
    rates = np.array([[1.0], [0.0], [1.0]])
    pose = Pose(nominal, x, np.zeros((3, 1)), np.zeros(1, dtype=np.int64))
    moved = motion(pose, x, rates, np.zeros((3, 1)))
    np.testing.assert_allclose(moved.table_rate[:, 0], [0, 0, 2.0], atol=1e-15)


def test_units_of_results_are_those_of_data_sheets():
    factors = dict(zip(p.NAMES, p.unit_factors(), strict=True))
    assert factors["Kgx"] == 1e-6
    assert factors["bias_x"] == pytest.approx(DEG / 3600)
    assert factors["gsens_xy"] == pytest.approx(DEG / 3600 / 9.80665)
    assert factors["Ka2_x"] == pytest.approx(1e-6 * 9.80665 / 9.80665**2)
