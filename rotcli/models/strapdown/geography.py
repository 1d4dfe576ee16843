"""Latitude, longitude, height, velocity and attitude in local axes n (East-North-Up).

From i to n there are three rotations: about the polar axis, by the Earth's rotation and the
longitude; the exchange of the axes (polar, out, east) to (east, polar, out); about east, by the
latitude. The first and the last are complex factors.

One point in the middle of each cell is converted exactly. The other points of the cell follow from
it by series if no cell extends further than _MAX_REACH; otherwise the exact formulas are used.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models import earth
from rotcli.models.strapdown.attitude import Pair, multiply_pairs
from rotcli.models.strapdown.cells import Arena, ComplexArray, Vectors, scatter
from rotcli.models.strapdown.local_gravity import LocalGravity
from rotcli.units import FloatArray

# rad, in longitude and at the Earth's centre. The terms that the series omit are below 4e-7 m of
# height, 1e-8 m of horizontal position and 1e-12 rad of attitude.
_MAX_REACH = 3e-4
_EXCHANGE = 0.5 + 0.5j  # both numbers of the quaternion that exchanges the axes


def attitude_in_i(latitude: float, q_ns: Pair) -> Pair:
    """Return q_is from q_ns at the starting meridian, where i is e."""
    factor = _EXCHANGE * complex(np.exp(0.5j * latitude))
    return multiply_pairs((factor.conjugate(), -factor), q_ns)


def vector_in_e(latitude: float, v_n: FloatArray) -> FloatArray:
    """Return the components (3,) in e of a vector (3,) in n at the starting meridian."""
    east, north, up = v_n
    s, c = np.sin(latitude), np.cos(latitude)
    return np.array([c * up - s * north, east, c * north + s * up])


@dataclass(frozen=True, eq=False)
class _Points:
    """Reference points of the cells: displacements in e, m, their coordinates in rad and m, (n,).

    outward: m, distance from the Earth's axis.
    """

    in_plane: ComplexArray
    along: FloatArray
    latitude: FloatArray
    longitude: FloatArray
    height: FloatArray
    outward: FloatArray

    @classmethod
    def at(cls, in_plane: ComplexArray, along: FloatArray, gravity: LocalGravity) -> "_Points":
        """Return the points at displacements from the start."""
        d = np.stack([in_plane.real, in_plane.imag, along])
        latitude, longitude, height = gravity.geodetic(d)
        return cls(in_plane, along, latitude, longitude, height, gravity.axis_distance(d))


@dataclass(frozen=True, eq=False)
class _Offsets:
    """Latitude and longitude (rad) and height (m), (rows, n), from those of the reference points.

    large: whether the angles are too large for series.
    """

    latitude: FloatArray
    longitude: FloatArray
    height: FloatArray
    large: bool

    def half_rotation(self, angle: FloatArray, arena: Arena) -> ComplexArray:
        """Return exp(i angle / 2), (rows, n); `angle` is latitude or longitude."""
        result = arena.complex(*angle.shape)
        if self.large:
            np.exp(0.5j * angle, out=result)
            return result
        with arena.stage():
            square = np.multiply(angle, angle, out=arena.real(*angle.shape))
            square *= -0.125
            np.add(square, 1.0, out=result.real)
        np.multiply(angle, 0.5, out=result.imag)
        return result


def write_solution(
    d: Vectors,
    v: Vectors,
    q_is: ComplexArray,
    half_rotation: ComplexArray,
    gravity: LocalGravity,
    out: FloatArray,
    arena: Arena,
) -> None:
    """Write latitude, longitude from the start, height, v_n (3), q_ns (4) to out (10, samples).

    d, v: m and m/s, and q_is (2, rows, n), in i; v and q_is are overwritten.
    half_rotation: (rows, n), exp(-i w t / 2); its square is the complex factor from i to e.
    """
    rows, n = half_rotation.shape
    row = rows // 2
    middle = _Points.at(d.plane[row] * half_rotation[row] ** 2, d.polar[row], gravity)
    to_meridian = arena.complex(rows, n)
    np.multiply(half_rotation, np.exp(-0.5j * middle.longitude), out=to_meridian)
    offsets = _offsets(d, middle, to_meridian, gravity, arena)
    scatter(offsets.latitude, out[0], middle.latitude)
    scatter(offsets.longitude, out[1], middle.longitude)
    scatter(offsets.height, out[2], middle.height)

    polar_rotation = offsets.half_rotation(offsets.longitude, arena)
    np.conjugate(polar_rotation, out=polar_rotation)
    polar_rotation *= to_meridian
    east_rotation = offsets.half_rotation(offsets.latitude, arena)
    east_rotation *= _EXCHANGE * np.exp(0.5j * middle.latitude)
    with arena.stage():
        _write_velocity(d, v, polar_rotation, east_rotation, out[3:6], arena)
    _write_attitude(q_is, polar_rotation, east_rotation, out[6:], arena)


def _offsets(
    d: Vectors,
    middle: _Points,
    to_meridian: ComplexArray,
    gravity: LocalGravity,
    arena: Arena,
) -> _Offsets:
    """Return the coordinates of the displacements d in i from those in the middle.

    to_meridian: (rows, n), half of the rotation from i to the meridian of the point in the middle.
    """
    shape = to_meridian.shape
    # Out and east of the middle of the cell, as real and imaginary part.
    across, product = arena.complex(*shape), arena.complex(*shape)
    np.multiply(to_meridian, to_meridian, out=product)
    np.multiply(d.plane, product, out=across)
    across -= middle.in_plane * np.exp(-1j * middle.longitude)
    along = np.subtract(d.polar, middle.along, out=arena.real(*shape))
    # Longitude: arctan y of the slope y; the distance from the axis grows by east * y / 2.
    lon, lat, h, term = (arena.real(*shape) for _ in range(4))
    out, east = across.real, across.imag
    np.add(out, middle.outward, out=term)
    np.divide(east, term, out=lon)
    grown = np.multiply(east, lon, out=arena.real(*shape))
    grown *= 0.5
    grown += out
    np.multiply(lon, lon, out=term)
    term *= -1.0 / 3.0
    term += 1.0
    lon *= term
    # In the plane of the meridian: north and up of the middle.
    sin, cos = np.sin(middle.latitude), np.cos(middle.latitude)
    north, up = arena.real(*shape), h
    np.multiply(along, cos, out=north)
    north -= np.multiply(grown, sin, out=term)
    np.multiply(along, sin, out=up)
    up += np.multiply(grown, cos, out=term)
    # q = north / (R + up): latitude q - q^3/3 - R'/2R q^2, height up + north q / 2.
    R_M, _ = earth.radii(middle.latitude)
    w2 = 1.0 - earth.ECCENTRICITY_SQUARED * sin**2
    bend = 1.5 * earth.ECCENTRICITY_SQUARED * sin * cos / w2 * R_M / (R_M + middle.height)
    np.add(up, R_M + middle.height, out=term)
    np.divide(north, term, out=lat)
    if not max(np.abs(x[row]).max() for x in (lon, lat) for row in (0, -1)) < _MAX_REACH:
        return _exact_offsets(d, across, middle, gravity)
    north *= lat
    north *= 0.5
    up += north
    np.multiply(lat, -1.0 / 3.0, out=term)
    term -= bend
    term *= lat
    term += 1.0
    lat *= term
    return _Offsets(lat, lon, h, large=False)


def _exact_offsets(
    d: Vectors, across: ComplexArray, middle: _Points, gravity: LocalGravity
) -> _Offsets:
    """Return `_offsets` without series."""
    d_plane = across * np.exp(1j * middle.longitude) + middle.in_plane
    d_e = np.stack([d_plane.real, d_plane.imag, d.polar]).reshape(3, -1)
    lat, lon, h = (x.reshape(across.shape) for x in gravity.geodetic(d_e))
    return _Offsets(lat - middle.latitude, lon - middle.longitude, h - middle.height, large=True)


def _write_velocity(
    d: Vectors,
    v: Vectors,
    polar_rotation: ComplexArray,
    east_rotation: ComplexArray,
    out: FloatArray,
    arena: Arena,
) -> None:
    """Write the velocities against the Earth in n to out (3, samples)."""
    product = arena.complex(*polar_rotation.shape)
    across = v.plane
    np.multiply(d.plane, 1j * earth.EARTH_RATE, out=product)
    across -= product
    np.multiply(polar_rotation, polar_rotation, out=product)
    across *= product
    scatter(across.imag, out[0])
    # north + i up = exp(i latitude) (polar + i out), and the square of the rotation has i/2.
    np.negative(v.polar, out=across.imag)
    np.multiply(east_rotation, east_rotation, out=product)
    product *= 2.0
    across *= product
    scatter(across.real, out[1])
    scatter(across.imag, out[2])


def _write_attitude(
    q: ComplexArray,
    polar_rotation: ComplexArray,
    east_rotation: ComplexArray,
    out: FloatArray,
    arena: Arena,
) -> None:
    """Write the quaternions q_ns to out (4, samples); q is q_is (2, rows, n)."""
    q *= polar_rotation
    conjugate = np.conjugate(q, out=arena.complex(*q.shape))
    # The exchange of axes: (c, d) to (c - d*, d + c*) times a constant.
    q[0] -= conjugate[1]
    q[1] += conjugate[0]
    q *= east_rotation
    for k in (0, 1):
        scatter(q[k].real, out[2 * k])
        scatter(q[k].imag, out[2 * k + 1])
