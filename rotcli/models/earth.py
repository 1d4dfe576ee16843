"""The Earth: WGS 84 ellipsoid, rotation, normal gravity.

Source of the constants: NGA.STND.0036_1.0.0_WGS84 (2014), tables 3.1 to 3.6.
"""

import numpy as np

from rotcli.units import FloatArray

SEMI_MAJOR_AXIS = 6378137.0  # m
FLATTENING = 1.0 / 298.257223563
EARTH_RATE = 7.292115e-5  # rad/s
GRAVITATIONAL_PARAMETER = 3.986004418e14  # m^3/s^2
EQUATOR_GRAVITY = 9.7803253359  # m/s^2
POLE_GRAVITY = 9.8321849378  # m/s^2

SEMI_MINOR_AXIS = SEMI_MAJOR_AXIS * (1.0 - FLATTENING)
ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)
_SOMIGLIANA = SEMI_MINOR_AXIS * POLE_GRAVITY / (SEMI_MAJOR_AXIS * EQUATOR_GRAVITY) - 1.0
_CENTRIFUGAL = EARTH_RATE**2 * SEMI_MAJOR_AXIS**2 * SEMI_MINOR_AXIS / GRAVITATIONAL_PARAMETER


def earth_rate_n(latitude: float) -> FloatArray:
    """Return the Earth rate w_ie_n (3,), rad/s, in East-North-Up.

    >>> earth_rate_n(0.0) / EARTH_RATE  # on the equator it points north
    array([0., 1., 0.])
    """
    return EARTH_RATE * np.array([0.0, np.cos(latitude), np.sin(latitude)])


def radii(latitude: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Return the radii of curvature (m): R_M in the meridian, R_N in the prime vertical."""
    return radii_sin(np.sin(latitude))


def radii_sin(sin_latitude: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Return `radii` from the sine of the latitude."""
    w2 = 1.0 - ECCENTRICITY_SQUARED * np.square(sin_latitude)
    R_N = SEMI_MAJOR_AXIS / np.sqrt(w2)
    R_M = R_N * (1.0 - ECCENTRICITY_SQUARED) / w2
    return R_M, R_N


def normal_gravity(latitude: FloatArray | float, height: FloatArray | float) -> FloatArray:
    """Return normal gravity (m/s^2, positive down) by Somigliana's formula with height term.

    Height enters to second order (WGS 84 report, equation 4-3).

    >>> float(round(normal_gravity(0.0, 0.0), 7)), float(round(normal_gravity(np.pi / 2, 0.0), 7))
    (9.7803253, 9.8321849)
    """
    return normal_gravity_sin(np.sin(latitude), height)


def gravity_at(latitude: float, height: float, measured: float | None) -> float:
    """Return the gravity (m/s^2) of a site: the measured one, or normal gravity."""
    return float(normal_gravity(latitude, height)) if measured is None else measured


def normal_gravity_sin(sin_latitude: FloatArray | float, height: FloatArray | float) -> FloatArray:
    """Return `normal_gravity` from the sine of the latitude."""
    sin2 = np.square(sin_latitude)
    surface = (
        EQUATOR_GRAVITY * (1.0 + _SOMIGLIANA * sin2) / np.sqrt(1.0 - ECCENTRICITY_SQUARED * sin2)
    )
    slope = 1.0 + FLATTENING + _CENTRIFUGAL - 2.0 * FLATTENING * sin2
    result: FloatArray = surface * (
        1.0 - 2.0 / SEMI_MAJOR_AXIS * slope * height + 3.0 * (height / SEMI_MAJOR_AXIS) ** 2
    )
    return result


def C_ne(latitude: FloatArray | float, longitude: FloatArray | float) -> FloatArray:
    """Return the matrices (..., 3, 3) that take vectors from e to East-North-Up."""
    sl, cl = np.sin(latitude), np.cos(latitude)
    so, co = np.sin(longitude), np.cos(longitude)
    rows = [[-so, co, 0.0 * sl], [-sl * co, -sl * so, cl], [cl * co, cl * so, sl]]
    return np.moveaxis(np.array([np.broadcast_arrays(*row) for row in rows]), (0, 1), (-2, -1))


def q_en(latitude: FloatArray, longitude: FloatArray) -> FloatArray:
    """Return the quaternions (4, n), scalar first, from East-North-Up to e: about z, then x.

    The inverse rotation of `C_ne`.
    """
    half_z, half_x = 0.5 * longitude + np.pi / 4.0, np.pi / 4.0 - 0.5 * latitude
    cz, sz, cx, sx = np.cos(half_z), np.sin(half_z), np.cos(half_x), np.sin(half_x)
    return np.stack([cz * cx, cz * sx, sz * sx, sz * cx])


def position_e(
    latitude: FloatArray | float, longitude: FloatArray | float, height: FloatArray | float
) -> FloatArray:
    """Return the Earth-fixed position (..., 3), m, of geodetic coordinates (rad, rad, m)."""
    _, R_N = radii(latitude)
    p = (R_N + height) * np.cos(latitude)
    z = (R_N * (1.0 - ECCENTRICITY_SQUARED) + height) * np.sin(latitude)
    return np.stack(np.broadcast_arrays(p * np.cos(longitude), p * np.sin(longitude), z), axis=-1)


def ellipsoid_normal(r_e: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the ellipsoid's outward normal (3, n), the sine of latitude and the height (m).

    r_e: (3, n), m, Earth-fixed, components first. Bowring's formula without trigonometry; within
    20 km of the surface latitude is good to 1e-12 rad and height to the rounding of r_e.
    Sources: Bowring, Survey Review 23 (1976) 323 and 28 (1985) 202.
    """
    x, y, z = r_e
    p = np.sqrt(x * x + y * y)  # a quarter of the time of np.hypot
    # Parametric latitude u of the surface point, then the geodetic one.
    tan_u_p, tan_u_z = SEMI_MINOR_AXIS * p, SEMI_MAJOR_AXIS * z
    size = np.sqrt(tan_u_p * tan_u_p + tan_u_z * tan_u_z)
    sin_u, cos_u = tan_u_z / size, tan_u_p / size
    second = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED)
    north = z + second * SEMI_MINOR_AXIS * (sin_u * sin_u * sin_u)
    outward = p - ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS * (cos_u * cos_u * cos_u)
    size = np.sqrt(north * north + outward * outward)
    normal = np.empty_like(r_e)
    sin_l = np.divide(north, size, out=normal[2, ...])
    cos_l = outward / size
    height = (
        p * cos_l
        + z * sin_l
        - SEMI_MAJOR_AXIS * np.sqrt(1.0 - ECCENTRICITY_SQUARED * (sin_l * sin_l))
    )
    equatorial = cos_l / p
    np.multiply(equatorial, x, out=normal[0, ...])
    np.multiply(equatorial, y, out=normal[1, ...])
    return normal, sin_l, height
