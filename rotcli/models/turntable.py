"""Exact readings of ideal sensors on a turntable with a fixed base.

Closed forms throughout: the table angle is a stepwise sum of a constant, a ramp and a sine, the
Earth turns at a constant rate, and gravity is normal gravity. The navigation
equations are not used here, so these readings can test them.
"""

from dataclasses import field

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models import earth, rotation
from rotcli.units import DEG, FloatArray

# rad/s: 1e-4 deg/s = 0.36 deg/h, a fortieth of the Earth rate and below the bias of every gyro
# that a table of this class tests. A table at this rate or below is still.
STILL_RATE = 1e-4 * DEG


@dataclass(frozen=True)
class ScheduleStep:
    """One step of a rate schedule: `rate + slope t + sweep sin(2 pi t / period)`.

    duration: s; rate, sweep: rad/s; slope: rad/s^2; period: s. t counts from the start of the step.
    """

    duration: float
    rate: float = 0.0
    slope: float = 0.0
    sweep: float = 0.0
    period: float = 10.0

    @property
    def final_rate(self) -> float:
        """Rate at the end of the step, rad/s."""
        phase = 2.0 * np.pi * self.duration / self.period
        return float(self.rate + self.slope * self.duration + self.sweep * np.sin(phase))

    def motion(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return angle from the start of the step (rad), rate and acceleration at times t (s)."""
        k = 2.0 * np.pi / self.period
        phase = k * t
        # 2 sin^2 instead of 1 - cos keeps the digits of small angles.
        angle = (
            self.rate * t
            + 0.5 * self.slope * t**2
            + self.sweep / k * 2.0 * np.sin(0.5 * phase) ** 2
        )
        rate = self.rate + self.slope * t + self.sweep * np.sin(phase)
        return angle, rate, self.slope + self.sweep * k * np.cos(phase)


@dataclass(frozen=True)
class Schedule:
    """Steps one after another; the first and the last extend beyond the schedule."""

    steps: tuple[ScheduleStep, ...]

    @property
    def duration(self) -> float:
        """Length of the schedule, s."""
        return sum(step.duration for step in self.steps)

    def motion(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return table angle (rad, 0 at time 0), rate (rad/s) and acceleration at times (s)."""
        starts = np.cumsum([0.0] + [step.duration for step in self.steps])
        index = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(self.steps) - 1)
        angle, rate, acceleration = (np.empty_like(time) for _ in range(3))
        step_start = 0.0
        for k, step in enumerate(self.steps):
            here = index == k
            step_angle, rate[here], acceleration[here] = step.motion(time[here] - starts[k])
            angle[here] = step_start + step_angle
            step_start += float(step.motion(np.array(step.duration))[0])
        return angle, rate, acceleration


@dataclass(frozen=True, eq=False)
class Turntable:
    """A table on a fixed base.

    latitude (rad), height (m), gravity (m/s^2, None for normal gravity); C_nb (3, 3) the attitude
    of the base; axis (3,) the rotation axis u, a unit vector in b; lever_arm (3,) m, from
    the axis to the IMU, in s.
    """

    latitude: float
    height: float
    C_nb: FloatArray
    axis: FloatArray
    schedule: Schedule
    gravity: float | None = None
    lever_arm: FloatArray = field(default_factory=lambda: np.zeros(3))

    def sense(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return w_is_s and f_s (m, 3), rad/s and m/s^2, at the instants `time` (m,), s."""
        u = self.axis
        angle, rate, acceleration = self.schedule.motion(np.asarray(time, dtype=float))
        normal = float(earth.normal_gravity(self.latitude, self.height))
        g = normal if self.gravity is None else self.gravity
        w_ie_b = self.C_nb.T @ earth.earth_rate_n(self.latitude)
        up_b = self.C_nb.T @ np.array([0.0, 0.0, 1.0])
        w_ie_s = rotation.rotate_about(u, -angle, np.broadcast_to(w_ie_b, (len(angle), 3)))
        f_s = rotation.rotate_about(u, -angle, np.broadcast_to(g * up_b, (len(angle), 3)))
        w_is_s = w_ie_s + rate[:, None] * u
        r = self.lever_arm
        if np.any(r):
            w_dot = acceleration[:, None] * u - rate[:, None] * np.cross(u, w_ie_s)
            f_s = (
                f_s
                + np.cross(w_dot, r)
                + np.cross(w_is_s, np.cross(w_is_s, r))
                - np.cross(w_ie_s, np.cross(w_ie_s, r))
                - rotation.rotate_about(
                    u, -angle, self._gravity_change(angle, g / normal) @ self.C_nb
                )
            )
        return w_is_s, f_s

    def average(self, time: FloatArray, interval: float) -> tuple[FloatArray, FloatArray]:
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

    def _gravity_change(self, angle: FloatArray, scale: float) -> FloatArray:
        """Return gravity at the IMU minus gravity on the axis, (m, 3) in n."""
        arm = np.broadcast_to(self.lever_arm, (len(angle), 3))
        arm_n = rotation.rotate_about(self.axis, angle, arm) @ self.C_nb.T
        C_ne = earth.C_ne(self.latitude, 0.0)
        on_axis = earth.position_e(self.latitude, 0.0, self.height)
        normal, sin_latitude, height = earth.ellipsoid_normal((on_axis + arm_n @ C_ne).T)
        g = earth.normal_gravity_sin(sin_latitude, height)
        down_n = -(normal.T @ C_ne.T)
        here = float(earth.normal_gravity(self.latitude, self.height)) * np.array([0.0, 0.0, 1.0])
        change: FloatArray = scale * (g[:, None] * down_n + here)
        return change
