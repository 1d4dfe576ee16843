"""Derivatives of the six readings with respect to the parameters, in closed form.

psi is the rotation of the sensor frame caused by a parameter, C_ns -> C_ns (I + [psi x]); a fixed
vector v seen in s then changes by v x psi. The change of the lever's force with geometry and
clock is left out: below 1 % of these columns at 100 deg/s and 5 cm, and only the step of
Gauss-Newton depends on it.
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.models.rotation import cross
from rotcli.models.triad import parameters as p
from rotcli.models.triad.kinematics import Motion, Pose, Table, at_clock, exp_rotation, motion
from rotcli.models.triad.sensor import axis_force
from rotcli.units import FloatArray

IntArray = NDArray[np.int64]


def jacobian(
    table: Table,
    x: FloatArray,
    angles: FloatArray,
    rates: FloatArray,
    accelerations: FloatArray,
    mounting: IntArray | None = None,
) -> FloatArray:
    """Return the derivatives (6, p, n) of gyro and accelerometer readings, SI units."""
    n = angles.shape[1]
    at = np.zeros(n, dtype=np.int64) if mounting is None else mounting
    J = np.zeros((6, p.count(table.mounting_count), n))
    for first, tau in ((0, x[p.CLOCK_GYRO]), (3, x[p.CLOCK_ACCEL])):
        earlier, rate = at_clock(angles, rates, accelerations, float(tau))
        pose = Pose(table, x, earlier, at)
        moved = motion(pose, x, rate, accelerations)
        rotations = _geometry(pose, x, moved, rate)
        if first == 0:
            _gyro_rows(J[:3], x, moved, rotations, table.gravity)
        else:
            _accel_rows(J[3:], x, moved, rotations, table.gravity)
    return J


def _left(phi: FloatArray, change: FloatArray) -> FloatArray:
    """Return the rotation (3,) that a change of a small rotation vector adds on the left."""
    return np.asarray(change + 0.5 * np.cross(phi, change))


Rotations = dict[int, tuple[FloatArray, FloatArray | None]]


def _geometry(pose: Pose, x: FloatArray, moved: Motion, rates: FloatArray) -> Rotations:
    """Return psi (3, n) and the change of the table rate (3, n), None if none, by parameter."""
    table = pose.table
    azimuth = exp_rotation(np.array([0.0, 0.0, x[p.BASE_AZIMUTH]]))
    found: Rotations = {}
    tilt = np.array([x[p.BASE_EAST], x[p.BASE_NORTH], 0.0])
    for k, unit in enumerate(np.eye(3)):
        # Tilts act before the azimuth: their axes are turned with it (base_attitude).
        axis = azimuth @ _left(tilt, unit) if k < 2 else unit
        found[p.BASE_EAST + k] = (pose.into_sensor(-1, pose.C_nb.T @ axis), None)
    nominal = table.axes
    turned: dict[int, tuple[int, FloatArray]] = {}
    if table.axis_count > 1:
        turned[p.OUTER_MIDDLE] = (1, np.cross(nominal[1], nominal[0]))
    if table.axis_count > 2:
        zero = exp_rotation(nominal[1] * x[p.MIDDLE_ZERO])
        turned[p.MIDDLE_INNER] = (2, zero @ np.cross(nominal[2], nominal[1]))
        turned[p.MIDDLE_ZERO] = (2, nominal[1])
    for index, (k, rho) in turned.items():
        psi = pose.into_sensor(k, pose.back(k, rho[:, None])) - pose.into_sensor(k, rho)
        outer = sum((moved.axes[j] * rates[j] for j in range(k)), start=np.zeros_like(psi))
        change = pose.into_sensor(k, np.cross(rho, pose.axes[k])) * rates[k]
        found[index] = (psi, change + cross(outer, psi))
    for m in range(1, table.mounting_count):
        there = (pose.mounting == m).astype(float)
        first = p.FIXED_COUNT + 3 * (m - 1)
        for j, unit in enumerate(np.eye(3)):
            psi = (pose.C_ms[m].T @ _left(x[first : first + 3], unit))[:, None] * there
            found[first + j] = (psi, cross(moved.table_rate, psi))
    return found


def _gyro_rows(
    J: FloatArray, x: FloatArray, moved: Motion, rotations: Rotations, gravity: float
) -> None:
    """Fill the rows of the gyros (3, p, n)."""
    I_N, G = np.eye(3) + x[p.N].reshape(3, 3), x[p.G].reshape(3, 3)
    rate = moved.earth_rate + moved.table_rate
    v = I_N @ rate
    scale = 1.0 + x[p.GYRO_ASYMMETRY][:, None] * np.sign(v)
    force = moved.force + moved.lever_force(x[p.LEVERS].reshape(3, 3).mean(axis=0))
    for i in range(3):
        J[i, p.N.start + 3 * i : p.N.start + 3 * i + 3] = scale[i] * rate
        J[i, p.GYRO_BIAS.start + i] = 1.0
        J[i, p.G.start + 3 * i : p.G.start + 3 * i + 3] = force
        J[i, p.GYRO_ASYMMETRY.start + i] = np.abs(v[i])
    if np.any(G):
        by_lever = np.einsum("ij,jkn->ikn", G, moved.lever_matrix()) / 3.0
        for accelerometer in range(3):
            first = p.LEVERS.start + 3 * accelerometer
            J[:, first : first + 3] = by_lever
    J[:, p.GRAVITY] = G @ moved.force / gravity
    for index, (psi, change) in rotations.items():
        moved_rate = cross(moved.earth_rate, psi)
        if change is not None:
            moved_rate = moved_rate + change
        J[:, index] = scale * (I_N @ moved_rate) + G @ cross(moved.force, psi)
    later = cross(moved.table_rate, moved.earth_rate) - moved.acceleration
    J[:, p.CLOCK_GYRO] = scale * (I_N @ later) + G @ cross(moved.table_rate, moved.force)


def _accel_rows(
    J: FloatArray, x: FloatArray, moved: Motion, rotations: Rotations, gravity: float
) -> None:
    """Fill the rows of the accelerometers (3, p, n)."""
    I_M = np.eye(3) + x[p.M].reshape(3, 3)
    levers = x[p.LEVERS].reshape(3, 3)
    u = axis_force(x, moved)
    scale = 1.0 + 2.0 * x[p.K2][:, None] * u + x[p.ACCEL_ASYMMETRY][:, None] * np.sign(u)
    W = moved.lever_matrix()
    for i in range(3):
        force = moved.force + moved.lever_force(levers[i]) if np.any(levers[i]) else moved.force
        J[i, p.M.start + 3 * i : p.M.start + 3 * i + 3] = scale[i] * force
        J[i, p.ACCEL_BIAS.start + i] = 1.0
        J[i, p.K2.start + i] = u[i] ** 2
        J[i, p.ACCEL_ASYMMETRY.start + i] = np.abs(u[i])
        first = p.LEVERS.start + 3 * i
        J[i, first : first + 3] = scale[i] * np.einsum("j,jkn->kn", I_M[i], W)
    J[:, p.GRAVITY] = scale * (I_M @ moved.force) / gravity
    for index, (psi, _) in rotations.items():
        J[:, index] = scale * (I_M @ cross(moved.force, psi))
    J[:, p.CLOCK_ACCEL] = scale * (I_M @ cross(moved.table_rate, moved.force))
