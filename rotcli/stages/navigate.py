"""Rotary inertial navigation of a log on a still table, and its errors (R16 section 2.1).

The sensor frame is mechanized; the table angle is then taken out of the attitude, which equals
turning the readings into b first (R16 (1), (2)) and needs no differenced encoder.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.logs.record import ImuLog
from rotcli.models import earth, rotation, strapdown
from rotcli.models.sensors import TriadErrors, correct
from rotcli.units import wrap_pi

Array = NDArray[np.float64]

ERROR_NAMES = (
    "north",
    "east",
    "up",
    "v_north",
    "v_east",
    "v_up",
    "pitch",
    "roll",
    "azimuth",
)


@dataclass(frozen=True, eq=False)
class Place:
    """The still base that errors are taken against: rad, rad, m, m/s^2 or None, C_nb (3, 3)."""

    latitude: float
    longitude: float
    height: float
    gravity: float | None
    pitch: float
    roll: float
    azimuth: float

    @property
    def C_nb(self) -> Array:
        """Attitude of the body, (3, 3)."""
        return rotation.attitude_matrix(self.pitch, self.roll, self.azimuth)


@dataclass(frozen=True, eq=False)
class Navigation:
    """A navigated window: what was computed and how far it is from the still table.

    time (n,) s; latitude, longitude (n,) rad, height (n,) m of the point on the rotation axis;
    v_n (n, 3) m/s; pitch, roll, azimuth (n,) rad of the body; errors (n, 9) in the order of
    ERROR_NAMES: m, m/s, rad. rate: rad/s, mean table rate over the window.
    """

    mode: str
    rate: float
    time: Array
    latitude: Array
    longitude: Array
    height: Array
    v_n: Array
    pitch: Array
    roll: Array
    azimuth: Array
    errors: Array

    @property
    def rms(self) -> Array:
        """Root mean square of each error over the window, (9,)."""
        return np.asarray(np.sqrt(np.mean(self.errors**2, axis=0)))

    @property
    def final(self) -> Array:
        """Errors at the end of the window, (9,)."""
        return np.asarray(self.errors[-1])

    @property
    def greatest(self) -> Array:
        """Greatest magnitude of each error, (9,)."""
        return np.asarray(np.max(np.abs(self.errors), axis=0))


def level(f_s: Array, angle: Array | float, axis: Array) -> tuple[float, float]:
    """Return pitch and roll (rad) of the body from a still stretch's specific force (n, 3), s.

    >>> level(np.array([[0.0, 0.0, 9.8]]), 0.0, np.array([0.0, 0.0, 1.0]))
    (0.0, 0.0)
    """
    turned = rotation.turn_about(axis, np.broadcast_to(angle, len(f_s)), f_s)
    x, y, z = turned.mean(axis=0)
    return float(np.arctan2(y, np.hypot(x, z))), float(np.arctan2(-x, z) + 0.0)


def static_bias(gyro: Array, angle: Array, axis: Array, place: Place) -> Array:
    """Return the gyro biases (3,), rad/s: mean of a still stretch (n, 3) less Earth rate."""
    w_ie_b = place.C_nb.T @ earth.earth_rate_n(place.latitude)
    w_ie_s = rotation.turn_about(axis, -angle, np.broadcast_to(w_ie_b, gyro.shape))
    return np.asarray((gyro - w_ie_s).mean(axis=0))


def navigate(
    imu: ImuLog,
    angle: Array,
    window: tuple[float, float],
    place: Place,
    errors: TriadErrors,
    *,
    mode: str,
    axis: Array,
    lever_arm: Array,
    hold_height: bool = False,
) -> Navigation:
    """Navigate the window (start, end), s, of a log whose gyros have the given errors.

    angle: (n,) rad, table angle at every IMU time. axis: (3,), u in b. lever_arm: (3,) m, in s.
    The start is the still base's position and attitude, at rest but for the lever arm's motion.
    """
    inside = imu.between(*window)
    time, theta = imu.time[inside], angle[inside]
    if len(time) < 4:
        raise LogError(
            imu.path,
            f"the window {window[0]:g}-{window[1]:g} s holds {len(time)} samples, at least 4 are "
            f"needed; the log covers {imu.time[0]:g}-{imu.time[-1]:g} s",
        )
    C_ns = place.C_nb @ rotation.axis_rotation(axis, theta[0])
    start = strapdown.Start(
        latitude=place.latitude,
        longitude=place.longitude,
        height=place.height,
        v_n=C_ns @ np.cross(_first_rate(theta, imu.interval) * axis, lever_arm),
        C_ns=C_ns,
        offset_n=C_ns @ lever_arm,
    )
    way = strapdown.integrate(
        correct(errors, imu.gyro[inside]),
        imu.accel[inside],
        imu.interval,
        start,
        averages=imu.sampling == "average",
        gravity=place.gravity,
        hold_height=hold_height,
    )

    # From the IMU to the point on the axis: q_ns takes the lever arm and its velocity to n.
    arm_n = rotation.rotate(way.q_ns, np.repeat(lever_arm[:, None], len(time), axis=1)).T
    swing_s = np.gradient(theta, imu.interval)[:, None] * np.cross(axis, lever_arm)
    v_n = way.v_n - rotation.rotate(way.q_ns, swing_s.T).T
    R_M, R_N = earth.radii(place.latitude)
    metres_north = R_M + place.height
    metres_east = (R_N + place.height) * np.cos(place.latitude)
    latitude = way.latitude - arm_n[:, 1] / metres_north
    longitude = way.longitude - arm_n[:, 0] / metres_east
    height = way.height - arm_n[:, 2]

    q_sb = rotation.quaternion_from_vector(-axis[:, None] * theta)
    pitch, roll, azimuth = rotation.euler_angles_of_quaternion(rotation.multiply(way.q_ns, q_sb))
    return Navigation(
        mode=mode,
        rate=float((theta[-1] - theta[0]) / (time[-1] - time[0])),
        time=time,
        latitude=latitude,
        longitude=longitude,
        height=height,
        v_n=v_n,
        pitch=pitch,
        roll=roll,
        azimuth=azimuth,
        errors=np.column_stack(
            [
                (latitude - place.latitude) * metres_north,
                (longitude - place.longitude) * metres_east,
                height - place.height,
                v_n[:, [1, 0, 2]],
                wrap_pi(pitch - place.pitch),
                wrap_pi(roll - place.roll),
                wrap_pi(azimuth - place.azimuth),
            ]
        ),
    )


def _first_rate(theta: Array, interval: float) -> float:
    """Return the table rate (rad/s) at the first sample: a quintic through the first 0.4 s.

    It looks forward only, for a ramp may end where the window starts.
    """
    points = min(41, len(theta))
    t = np.arange(points) * interval
    fit = np.polynomial.Polynomial.fit(t, theta[:points] - theta[0], min(5, points - 1))
    return float(fit.deriv()(0.0))
