"""Exact motion of a table on a still base: what ideal sensors on it read.

Closed forms throughout: the table angle is a piecewise sum of a constant, a ramp and a sine, the
Earth turns at a constant rate, and gravity is normal gravity. Nothing here is integrated by the
navigation equations, so it can judge them.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rotcli.models import earth, rotation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Piece:
    """One piece of a rate schedule: `rate + slope t + sweep sin(2 pi t / period)`.

    duration: s; rate, sweep: rad/s; slope: rad/s^2; period: s. t counts from the piece's start.
    """

    duration: float
    rate: float = 0.0
    slope: float = 0.0
    sweep: float = 0.0
    period: float = 10.0

    @property
    def final_rate(self) -> float:
        """Rate at the end of the piece, rad/s."""
        phase = 2.0 * np.pi * self.duration / self.period
        return float(self.rate + self.slope * self.duration + self.sweep * np.sin(phase))

    def motion(self, t: Array) -> tuple[Array, Array, Array]:
        """Return angle from the piece's start (rad), rate and acceleration at times t (s)."""
        k = 2.0 * np.pi / self.period
        phase = k * t
        # 2 sin^2 in the place of 1 - cos keeps the digits of small angles.
        angle = (
            self.rate * t
            + 0.5 * self.slope * t**2
            + self.sweep / k * 2.0 * np.sin(0.5 * phase) ** 2
        )
        rate = self.rate + self.slope * t + self.sweep * np.sin(phase)
        return angle, rate, self.slope + self.sweep * k * np.cos(phase)


@dataclass(frozen=True)
class Schedule:
    """Pieces one after another; before the first and after the last the table keeps its rate."""

    pieces: tuple[Piece, ...]

    @property
    def duration(self) -> float:
        """Length of the whole schedule, s."""
        return sum(piece.duration for piece in self.pieces)

    def motion(self, time: Array) -> tuple[Array, Array, Array]:
        """Return table angle (rad, 0 at time 0), rate (rad/s) and acceleration at times (s)."""
        starts = np.cumsum([0.0] + [piece.duration for piece in self.pieces])
        index = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(self.pieces) - 1)
        angle, rate, acceleration = (np.empty_like(time) for _ in range(3))
        turned = 0.0
        for k, piece in enumerate(self.pieces):
            here = index == k
            piece_angle, rate[here], acceleration[here] = piece.motion(time[here] - starts[k])
            angle[here] = turned + piece_angle
            turned += float(piece.motion(np.array(piece.duration))[0])
        return angle, rate, acceleration


@dataclass(frozen=True, eq=False)
class Turntable:
    """A table on a still base.

    latitude (rad), height (m), gravity (m/s^2, None for normal gravity); C_nb (3, 3) the still
    base's attitude; axis (3,) the rotation axis u, a unit vector in b; lever_arm (3,) m, from
    the axis to the IMU, in s.
    """

    latitude: float
    height: float
    C_nb: Array
    axis: Array
    schedule: Schedule
    gravity: float | None = None
    lever_arm: Array = field(default_factory=lambda: np.zeros(3))

    def sense(self, time: Array) -> tuple[Array, Array]:
        """Return w_is_s and f_s (m, 3), rad/s and m/s^2, at the instants `time` (m,), s."""
        u = self.axis
        angle, rate, acceleration = self.schedule.motion(np.asarray(time, dtype=float))
        normal = float(earth.normal_gravity(self.latitude, self.height))
        g = normal if self.gravity is None else self.gravity
        w_ie_b = self.C_nb.T @ earth.earth_rate_n(self.latitude)
        up_b = self.C_nb.T @ np.array([0.0, 0.0, 1.0])
        w_ie_s = rotation.turn_about(u, -angle, np.broadcast_to(w_ie_b, (len(angle), 3)))
        f_s = rotation.turn_about(u, -angle, np.broadcast_to(g * up_b, (len(angle), 3)))
        w_is_s = w_ie_s + rate[:, None] * u
        r = self.lever_arm
        if np.any(r):
            w_dot = acceleration[:, None] * u - rate[:, None] * np.cross(u, w_ie_s)
            f_s = (
                f_s
                + np.cross(w_dot, r)
                + np.cross(w_is_s, np.cross(w_is_s, r))
                - np.cross(w_ie_s, np.cross(w_ie_s, r))
                - rotation.turn_about(
                    u, -angle, self._gravity_change(angle, g / normal) @ self.C_nb
                )
            )
        return w_is_s, f_s

    def average(self, time: Array, interval: float) -> tuple[Array, Array]:
        """Return the means of w_is_s and f_s (m, 3) over the intervals that end at `time`.

        Five-point Gauss-Legendre quadrature of `sense`: exact to rounding for any table motion.
        """
        nodes, weights = np.polynomial.legendre.leggauss(5)
        w, f = np.zeros((len(time), 3)), np.zeros((len(time), 3))
        for node, weight in zip(nodes, weights, strict=True):
            w_node, f_node = self.sense(time + 0.5 * (node - 1.0) * interval)
            w += 0.5 * weight * w_node
            f += 0.5 * weight * f_node
        return w, f

    def _gravity_change(self, angle: Array, scale: float) -> Array:
        """Return how gravity at the IMU differs from that on the axis, (m, 3) in n."""
        arm = np.broadcast_to(self.lever_arm, (len(angle), 3))
        arm_n = rotation.turn_about(self.axis, angle, arm) @ self.C_nb.T
        C_ne = earth.C_ne(self.latitude, 0.0)
        on_axis = earth.position_e(self.latitude, 0.0, self.height)
        normal, sin_latitude, height = earth.ellipsoid_normal((on_axis + arm_n @ C_ne).T)
        g = earth.normal_gravity_sin(sin_latitude, height)
        down_n = -(normal.T @ C_ne.T)
        here = float(earth.normal_gravity(self.latitude, self.height)) * np.array([0.0, 0.0, 1.0])
        change: Array = scale * (g[:, None] * down_n + here)
        return change
