"""Rotations: skew matrices, rotation vectors, quaternions, direction cosines, Euler angles.

Quaternions are scalar-first, Hamilton, and combine like matrices: `q_ab` takes a vector from b to
a, `q_ac = multiply(q_ab, q_bc)`. Every function works on arrays with any leading shape.
Euler angles are those of an aircraft in East-North-Up: pitch about x (right), roll about y
(forward), azimuth clockwise from north.
"""

import numpy as np

from rotcli.units import DEG, FloatArray, wrap_pi

# Beyond this pitch a small attitude error makes ten times larger errors of roll and azimuth.
MAX_EULER_PITCH = 85.0 * DEG

UNIT_VECTORS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def skew(v: FloatArray) -> FloatArray:
    """Return the matrix of the cross product, (..., 3) to (..., 3, 3): `skew(a) @ b = a x b`.

    >>> skew(np.array([0.0, 0.0, 1.0])) @ np.array([1.0, 0.0, 0.0])
    array([0., 1., 0.])
    """
    v = np.asarray(v, dtype=float)
    m = np.zeros((*v.shape[:-1], 3, 3))
    m[..., 0, 1], m[..., 0, 2], m[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    m[..., 1, 0], m[..., 2, 0], m[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return m


def axis_rotation(axis: FloatArray, angle: FloatArray | float) -> FloatArray:
    """Return the right-handed rotation matrix C_bs(angle) about a unit axis (3,) (Rodrigues).

    angle: any shape, rad; the result has shape (..., 3, 3).

    >>> axis_rotation(np.array([0.0, 0.0, 1.0]), np.pi / 2).round(12) @ np.array([1.0, 0.0, 0.0])
    array([0., 1., 0.])
    """
    angle = np.asarray(angle, dtype=float)[..., None, None]
    s = skew(np.asarray(axis, dtype=float))
    result: FloatArray = np.eye(3) + np.sin(angle) * s + (1.0 - np.cos(angle)) * (s @ s)
    return result


def rotate_about(axis: FloatArray, angle: FloatArray, v: FloatArray) -> FloatArray:
    """Rotate vectors (..., 3) right-handed about a unit axis (3,) by angles (...), rad.

    Equal to `axis_rotation(axis, angle) @ v`, without the matrices.
    """
    axis = np.asarray(axis, dtype=float)
    c, s = np.cos(angle)[..., None], np.sin(angle)[..., None]
    result: FloatArray = c * v + s * np.cross(axis, v) + (1.0 - c) * (v @ axis)[..., None] * axis
    return result


def sum_rotated(axis: FloatArray, angle: FloatArray, v: FloatArray) -> FloatArray:
    """Return the sum (3,) of `rotate_about(axis, angle, v)` for n vectors, or for a fixed one.

    angle: (n,) rad; v: (n, 3) or (3,).

    >>> up, half_turn = np.array([0.0, 0.0, 1.0]), np.array([0.0, np.pi])
    >>> np.abs(sum_rotated(up, half_turn, np.array([3.0, 0.0, 4.0]))).round(12)
    array([0., 0., 8.])
    """
    c, s = np.cos(angle), np.sin(angle)
    if v.ndim == 1:
        along, across, total = c.sum() * v, s.sum() * v, len(angle) * v
    else:
        along, across, total = c @ v, s @ v, v.sum(axis=0)
    return np.asarray(along + np.cross(axis, across) + ((total - along) @ axis) * axis)


def attitude_matrix(
    pitch: FloatArray | float, roll: FloatArray | float, azimuth: FloatArray | float
) -> FloatArray:
    """Return C_nb (..., 3, 3) from pitch, roll, azimuth (rad).

    >>> attitude_matrix(0.0, 0.0, np.pi / 2).round(12) @ np.array([0.0, 1.0, 0.0])  # faces east
    array([1., 0., 0.])
    """
    sp, cp = np.sin(pitch), np.cos(pitch)
    sr, cr = np.sin(roll), np.cos(roll)
    sa, ca = np.sin(azimuth), np.cos(azimuth)
    rows = [
        [cr * ca + sr * sp * sa, cp * sa, sr * ca - cr * sp * sa],
        [-cr * sa + sr * sp * ca, cp * ca, -sr * sa - cr * sp * ca],
        [-sr * cp, sp, cr * cp],
    ]
    return np.moveaxis(np.array([np.broadcast_arrays(*row) for row in rows]), (0, 1), (-2, -1))


def euler_angles(C_nb: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return pitch, roll, azimuth (rad, each of the leading shape) of C_nb (..., 3, 3).

    The inverse of `attitude_matrix` for pitch within +-90 deg; azimuth lies in (-pi, pi].
    """
    pitch = np.arctan2(C_nb[..., 2, 1], np.hypot(C_nb[..., 2, 0], C_nb[..., 2, 2]))
    roll = np.arctan2(-C_nb[..., 2, 0], C_nb[..., 2, 2])
    azimuth = np.arctan2(C_nb[..., 0, 1], C_nb[..., 1, 1])
    return pitch, roll, azimuth


def euler_angles_of_quaternion(q_nb: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return pitch, roll, azimuth (rad) of quaternions (4, ...), as `euler_angles` of matrices."""
    w, x, y, z = q_nb
    up_x, up_y = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x)
    up_z = 1.0 - 2.0 * (x * x + y * y)
    pitch = np.arctan2(up_y, np.sqrt(up_x * up_x + up_z * up_z))
    roll = np.arctan2(-up_x, up_z)
    azimuth = np.arctan2(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z))
    return pitch, roll, azimuth


def attitude_errors(
    q_nb: FloatArray,
    angles: tuple[FloatArray, FloatArray, FloatArray],
    reference: tuple[float, float, float],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return errors of pitch, roll, azimuth (rad) of quaternions (4, n) against a fixed attitude.

    angles: pitch, roll, azimuth (n,) of q_nb; reference: those of the fixed attitude. Differences
    of the angles up to MAX_EULER_PITCH. Beyond, where azimuth and roll are not defined, the
    rotation vector (computed from true, in n) along the body's right, forward (horizontal) and
    down at its azimuth: the same for small errors of a level body.
    """
    pitch, _, azimuth = reference
    if abs(pitch) <= MAX_EULER_PITCH:
        dp, dr, dA = (a - b for a, b in zip(angles, reference, strict=True))
        return dp, wrap_pi(dr), wrap_pi(dA)
    q_ref = quaternion_from_matrix(attitude_matrix(*reference))
    q = multiply(q_nb, conjugate(np.repeat(q_ref[:, None], q_nb.shape[1], axis=1)))
    q = q * np.where(q[0] < 0.0, -1.0, 1.0)
    size = np.sqrt(q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    factor = np.where(size > 1e-12, 2.0 * np.arctan2(size, q[0]) / np.maximum(size, 1e-12), 2.0)
    e, n, u = factor * q[1:]
    s, c = np.sin(azimuth), np.cos(azimuth)
    return e * c - n * s, e * s + n * c, -u


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a x b of vectors (3, ...), components first."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def multiply(p: FloatArray, q: FloatArray) -> FloatArray:
    """Return the quaternion product p q, components first: (4, ...) and (4, ...) to (4, ...)."""
    p0, p1, p2, p3 = p
    q0, q1, q2, q3 = q
    return np.stack(
        [
            p0 * q0 - p1 * q1 - p2 * q2 - p3 * q3,
            p0 * q1 + p1 * q0 + p2 * q3 - p3 * q2,
            p0 * q2 - p1 * q3 + p2 * q0 + p3 * q1,
            p0 * q3 + p1 * q2 - p2 * q1 + p3 * q0,
        ]
    )


def multiply_by_turn(p: FloatArray, axis: FloatArray, half: FloatArray) -> FloatArray:
    """Return the quaternions (4, n) of p (4, n), then a turn about a unit axis (3,).

    half: (2, n), cosine and sine of half the angles. About x, y or z half of the products of
    `multiply` are zero, and left out.
    """
    cosine, sine = half
    along = np.flatnonzero(axis)
    if len(along) > 1:
        q = np.empty((4, len(cosine)))
        q[0] = cosine
        np.multiply(axis[:, None], sine, out=q[1:])
        return multiply(p, q)
    k = int(along[0])
    i, j = 1 + (k + 1) % 3, 1 + (k + 2) % 3
    sine, k = axis[k] * sine, 1 + k
    result = np.empty(p.shape)
    for row, (a, b, c) in ((0, (0, k, -sine)), (i, (i, j, sine)), (j, (j, i, -sine))):
        np.multiply(p[a], cosine, out=result[row])
        result[row] += p[b] * c
    np.multiply(p[0], sine, out=result[k])
    result[k] += p[k] * cosine
    return result


def conjugate(q: FloatArray) -> FloatArray:
    """Return the conjugate (the inverse rotation) of quaternions (4, ...)."""
    return np.stack([q[0], -q[1], -q[2], -q[3]])


def quaternion_from_vector(phi: FloatArray) -> FloatArray:
    """Return the quaternions (4, ...) of rotation vectors (3, ...), rad.

    >>> quaternion_from_vector(np.array([np.pi, 0.0, 0.0])).round(12)
    array([0., 1., 0., 0.])
    """
    half = 0.5 * np.sqrt(phi[0] ** 2 + phi[1] ** 2 + phi[2] ** 2)
    s = 0.5 * np.sinc(half / np.pi)  # sin(|phi|/2) / |phi|, 0.5 at zero
    return np.stack([np.cos(half), s * phi[0], s * phi[1], s * phi[2]])


def matrix_from_quaternion(q: FloatArray) -> FloatArray:
    """Return direction cosine matrices (..., 3, 3) of unit quaternions (4, ...)."""
    w, x, y, z = q
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def quaternion_from_matrix(C: FloatArray) -> FloatArray:
    """Return the unit quaternion (4,) of one direction cosine matrix (3, 3) (Shepperd 1978)."""
    t = np.trace(C)
    squares = np.array([t, C[0, 0], C[1, 1], C[2, 2]])
    largest = int(np.argmax(squares))
    if largest == 0:
        q = [1 + t, C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1]]
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q = [C[k, j] - C[j, k], 0.0, 0.0, 0.0]
        q[1 + i] = 1 + 2 * C[i, i] - t
        q[1 + j] = C[j, i] + C[i, j]
        q[1 + k] = C[k, i] + C[i, k]
    result = np.array(q)
    return np.asarray(result / np.linalg.norm(result), dtype=float)


def rotate(q: FloatArray, v: FloatArray) -> FloatArray:
    """Rotate vectors (3, ...) by unit quaternions (4, ...), components first: `v_a = q_ab v_b`."""
    w, x, y, z = q
    # t = 2 u x v; v + w t + u x t
    tx, ty, tz = (
        2.0 * (y * v[2] - z * v[1]),
        2.0 * (z * v[0] - x * v[2]),
        2.0 * (x * v[1] - y * v[0]),
    )
    return np.stack(
        [
            v[0] + w * tx + y * tz - z * ty,
            v[1] + w * ty + z * tx - x * tz,
            v[2] + w * tz + x * ty - y * tx,
        ]
    )


def cumulative_product(q: FloatArray) -> FloatArray:
    """Return the running products (4, n) of quaternions (4, n): `[q0, q0 q1, q0 q1 q2, ...]`.

    Works in blocks of 16, all blocks at once, then on the products of the blocks, so there is no
    loop over samples.
    """
    block = 16
    n = q.shape[1]
    if n <= block:
        result = q.copy()
        for k in range(1, n):
            result[:, k] = multiply(result[:, k - 1], q[:, k])
        return result
    padded = np.zeros((4, -(-n // block) * block))
    padded[0] = 1.0
    padded[:, :n] = q
    # Block index last, so that the work runs over contiguous memory.
    inside = np.ascontiguousarray(padded.reshape(4, -1, block).transpose(0, 2, 1))
    for k in range(1, block):
        inside[:, k] = multiply(inside[:, k - 1], inside[:, k])
    before = cumulative_product(inside[:, -1, :-1])
    inside[:, :, 1:] = multiply(before[:, None, :], inside[:, :, 1:])
    return inside.transpose(0, 2, 1).reshape(4, -1)[:, :n]
