"""Strapdown mechanization of a whole log at once.

Attitude in the inertial frame needs neither position nor velocity: it is the running product of
the rotations of single samples. Specific force turned into the inertial frame is smooth even
when the sensor spins, so its integral is a quadrature. Only gravity depends on position; a few
fixed-point sweeps over windows much shorter than the Schuler period (84 min) settle that.

Frames: n0 is East-North-Up at the starting point, turning with the Earth; i is n0 frozen at the
start; `d` is the displacement from the starting point, so that differences of large numbers
never arise. Arrays are (n, 3) at the doors of this module and components first (3, n) inside.
"""

from dataclasses import dataclass, field

import numpy as np

from rotcli.models import earth, quadrature, rotation
from rotcli.models.local_gravity import LocalGravity
from rotcli.units import FloatArray

_WINDOW = 3000  # samples in one fixed-point window: 30 s at 100 Hz settle in three sweeps
_SETTLED = 1e-7  # m
_BEHIND, _AHEAD = 8, 8  # samples that instants, cubic integrals and windows look back and ahead


@dataclass(frozen=True, eq=False)
class InitialState:
    """Where the sensor is at the first sample: rad, rad, m, m/s in n, attitude C_ns (3, 3).

    offset_n: (3,) m, how far the sensor stands from that point (a lever arm), in n.
    """

    latitude: float
    longitude: float
    height: float
    v_n: FloatArray
    C_ns: FloatArray
    offset_n: FloatArray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Position (n,) rad, rad, m; velocity v_n (n, 3) m/s; attitude q_ns (4, n)."""

    latitude: FloatArray
    longitude: FloatArray
    height: FloatArray
    v_n: FloatArray
    q_ns: FloatArray


def mechanize_log(
    w_is_s: FloatArray,
    f_s: FloatArray,
    interval: float,
    start: InitialState,
    *,
    averages: bool = False,
    gravity: float | None = None,
    hold_height: bool = False,
) -> Trajectory:
    """Navigate from angular rate and specific force sampled every `interval` (s).

    w_is_s, f_s: (n, 3), rad/s and m/s^2, at the instants 0, 1, ... n-1; with `averages` the mean
    over the interval that ends there. The start holds at sample 0, and so does row 0 of the
    result. gravity: m/s^2 at the start, in place of normal gravity (which then only shapes its
    change with position). hold_height: the vertical channel is held at the starting height.

    A still sensor stays where it is: w = C_sn w_ie, f = C_sn (0, 0, g).
    """
    whole = Mechanization(
        interval, start, averages=averages, gravity=gravity, hold_height=hold_height
    )
    return whole.advance(w_is_s, f_s, last=True)


class Mechanization:
    """Navigation of a log that comes part by part; what is carried over makes it one.

    Parameters as for `mechanize_log`. The parts' trajectories, one after the other, are that of the
    whole log to the rounding of floats.
    """

    def __init__(
        self,
        interval: float,
        start: InitialState,
        *,
        averages: bool = False,
        gravity: float | None = None,
        hold_height: bool = False,
    ) -> None:
        self._interval, self._start, self._averages = interval, start, averages
        self._hold_height = hold_height
        self._gravity = LocalGravity(start.latitude, start.height, gravity)
        # The state holds at sample `_done`; `_lead` samples of those kept come before it.
        self._done, self._lead = 0, 0
        self._w, self._f = np.empty((3, 0)), np.empty((3, 0))
        self._f_i_before = np.empty((3, 0))
        self._q_is = rotation.quaternion_from_matrix(start.C_ns)
        self._d_i = start.offset_n
        self._v_i = start.v_n + np.cross(self._gravity.w_ie, start.offset_n)

    def advance(self, w_is_s: FloatArray, f_s: FloatArray, *, last: bool = False) -> Trajectory:
        """Take the samples (n, 3) that follow; return the trajectory up to what they settle.

        Some samples are kept back, as the quadrature looks ahead, unless these are the last.
        """
        w, f = np.asarray(w_is_s).T, np.asarray(f_s).T
        if self._w.shape[1]:
            w = np.concatenate([self._w, w], axis=1)
            f = np.concatenate([self._f, f], axis=1)
        lead, there = self._lead, w.shape[1] - self._lead
        count = there if last else max(there - 1 - _AHEAD, 0) // _WINDOW * _WINDOW
        raw_w, raw_f = w, f
        if self._averages:
            angle = w[:, 1:] * self._interval
            w, f = quadrature.instants(w), quadrature.instants(f)
        else:
            angle = quadrature.interval_integrals(w, self._interval)
        # Up to two samples past the next state feed the last window.
        end = there if last else count + 3
        if not last and not count:
            end = 0
        kept = slice(lead, lead + end)
        if not end:
            self._keep(raw_w, raw_f, 0)
            return _nowhere()
        turns = quadrature.rotation_vectors(w, angle, self._interval)
        q_is = _attitude(turns[:, lead : lead + end - 1], self._q_is)
        f_i = rotation.rotate(q_is, f[:, kept])
        trajectory = self._translate(q_is, f_i, count, last=last)
        if not last:
            self._f_i_before = f_i[:, count - 2 : count].copy()
            self._q_is = q_is[:, count].copy()
            self._keep(raw_w, raw_f, count)
        return trajectory

    def _keep(self, w: FloatArray, f: FloatArray, count: int) -> None:
        """Keep what the next part needs, when `count` samples are done."""
        first = max(self._lead + count - _BEHIND, 0)
        self._lead += count - first
        self._done += count
        self._w, self._f = w[:, first:].copy(), f[:, first:].copy()

    def _translate(
        self, q_is: FloatArray, f_i: FloatArray, count: int, *, last: bool
    ) -> Trajectory:
        """Integrate velocity and position in i, window by window; return `count` rows in n.

        q_is (4, m), f_i (3, m) from the state's sample on; the state moves to sample `count`.
        """
        local, interval, start = self._gravity, self._interval, self._start
        behind = self._f_i_before.shape[1]
        there = f_i.shape[1]  # samples to look at, those from `behind` before on
        f_i = np.concatenate([self._f_i_before, f_i], axis=1) if behind else f_i
        n = there if last else count + 1
        w_ie = local.w_ie
        unit = w_ie / np.linalg.norm(w_ie)
        step = earth.EARTH_RATE * interval
        sample: FloatArray = np.arange(self._done - behind, self._done + there, dtype=float)
        turned = step * sample

        d_i, v_i = np.empty((3, n)), np.empty((3, n))
        d_i[:, 0], v_i[:, 0] = self._d_i, self._v_i
        for first in range(0, max(n - 1, 1), _WINDOW):
            # One sample of overlap carries the state, two more on each side feed the quadrature.
            end = min(first + _WINDOW + 1, n)
            lead, trail = min(first + behind, 2), min(there - end, 2)
            window = slice(behind + first - lead, behind + end + trail)
            steps: FloatArray = np.arange(-lead, end + trail - first) * interval
            v0, d0 = v_i[:, first].copy(), d_i[:, first].copy()
            v, d = np.repeat(v0[:, None], len(steps), axis=1), d0[:, None] + v0[:, None] * steps
            angle, force = turned[window], f_i[:, window]
            for _ in range(20):
                d_n0 = _rotate_small(unit, -angle, d)
                acceleration = local.gravitation(d_n0)
                if self._hold_height:
                    v_n0 = _rotate_small(unit, -angle, v) - rotation.cross(w_ie, d_n0)
                    f_n0 = _rotate_small(unit, -angle, force)
                    acceleration += local.height_hold_acceleration(d_n0, v_n0, f_n0 + acceleration)
                a = force + _rotate_small(unit, angle, acceleration)
                v_new = quadrature.running_integral(a, v0, interval, lead)
                d_new = quadrature.running_integral(v_new, d0, interval, lead)
                moved = float(np.max(np.abs(d_new - d)))
                v, d = v_new, d_new
                if moved < _SETTLED:
                    break
            kept = slice(lead, lead + end - first)
            v_i[:, first:end], d_i[:, first:end] = v[:, kept], d[:, kept]

        self._d_i, self._v_i = d_i[:, n - 1].copy(), v_i[:, n - 1].copy()
        rows = slice(0, count)
        turned, d_i, v_i = turned[behind : behind + count], d_i[:, rows], v_i[:, rows]
        d_n0 = _rotate_small(unit, -turned, d_i)
        v_n0 = _rotate_small(unit, -turned, v_i) - rotation.cross(w_ie, d_n0)
        q_n0i = rotation.quaternion_from_vector(-unit[:, None] * turned)
        latitude, longitude, height = local.geodetic(d_n0)
        q_n_n0 = rotation.multiply(
            rotation.conjugate(earth.q_en(latitude, longitude)),
            earth.q_en(np.array([start.latitude]), np.zeros(1)),
        )
        return Trajectory(
            latitude=latitude,
            longitude=start.longitude + longitude,
            height=height,
            v_n=rotation.rotate(q_n_n0, v_n0).T,
            q_ns=rotation.multiply(q_n_n0, rotation.multiply(q_n0i, q_is[:, rows])),
        )


def _nowhere() -> Trajectory:
    none = np.empty(0)
    return Trajectory(none, none, none, np.empty((0, 3)), np.empty((4, 0)))


def _attitude(turns: FloatArray, first: FloatArray) -> FloatArray:
    """Return q_is (4, n), the first (4,), turned by the rotation vectors (3, n-1)."""
    steps = np.empty((4, turns.shape[1] + 1))
    steps[:, 0] = first
    steps[:, 1:] = rotation.quaternion_from_vector(turns)
    q_is = rotation.cumulative_product(steps)
    q_is /= np.sqrt(np.einsum("kn,kn->n", q_is, q_is))
    return q_is


def _rotate_small(unit: FloatArray, angle: FloatArray, v: FloatArray) -> FloatArray:
    """Turn v (3, m) right-handed about the unit vector (3,) by the angles (m,), rad."""
    # Small angles throughout (15 deg an hour): 1 - cos without cancellation.
    s, c1 = np.sin(angle), 2.0 * np.sin(0.5 * angle) ** 2
    a, b, c = unit
    x, y, z = v
    cross = np.stack([b * z - c * y, c * x - a * z, a * y - b * x])
    along = c1 * (a * x + b * y + c * z)
    turned: FloatArray = v + s * cross - c1 * v + unit[:, None] * along
    return turned
