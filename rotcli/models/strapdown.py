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
from numpy.typing import NDArray

from rotcli.models import earth, rotation

Array = NDArray[np.float64]

_WINDOW = 3000  # samples in one fixed-point window: 30 s at 100 Hz settle in three sweeps
_SETTLED = 1e-7  # m
_BEHIND, _AHEAD = 8, 8  # samples that instants, cubic integrals and windows look back and ahead
_GRAVITY_KNOWN = 1e6  # m; an unaided height that has run farther feels the gravity there


@dataclass(frozen=True, eq=False)
class Start:
    """Where the sensor is at the first sample: rad, rad, m, m/s in n, attitude C_ns (3, 3).

    offset_n: (3,) m, how far the sensor stands from that point (a lever arm), in n.
    """

    latitude: float
    longitude: float
    height: float
    v_n: Array
    C_ns: Array
    offset_n: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Position (n,) rad, rad, m; velocity v_n (n, 3) m/s; attitude q_ns (4, n)."""

    latitude: Array
    longitude: Array
    height: Array
    v_n: Array
    q_ns: Array


def integrate(
    w_is_s: Array,
    f_s: Array,
    interval: float,
    start: Start,
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

    Parameters as for `integrate`. The parts' trajectories, one after the other, are that of the
    whole log to the rounding of floats.
    """

    def __init__(
        self,
        interval: float,
        start: Start,
        *,
        averages: bool = False,
        gravity: float | None = None,
        hold_height: bool = False,
    ) -> None:
        self._interval, self._start, self._averages = interval, start, averages
        self._hold_height = hold_height
        self._surroundings = _Surroundings(start, gravity)
        # The state holds at sample `_done`; `_lead` samples of those kept come before it.
        self._done, self._lead = 0, 0
        self._w, self._f = np.empty((3, 0)), np.empty((3, 0))
        self._f_i_before = np.empty((3, 0))
        self._q_is = rotation.quaternion_from_matrix(start.C_ns)
        self._d_i = start.offset_n
        self._v_i = start.v_n + np.cross(self._surroundings.w_ie, start.offset_n)

    def advance(self, w_is_s: Array, f_s: Array, *, last: bool = False) -> Trajectory:
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
            w, f = instants(w), instants(f)
        else:
            angle = _interval_integrals(w, self._interval)
        # Up to two samples past the next state feed the last window.
        end = there if last else count + 3
        if not last and not count:
            end = 0
        kept = slice(lead, lead + end)
        if not end:
            self._keep(raw_w, raw_f, 0)
            return _nowhere()
        turns = _rotation_vectors(w, angle, self._interval)
        q_is = _attitude(turns[:, lead : lead + end - 1], self._q_is)
        f_i = rotation.rotate(q_is, f[:, kept])
        trajectory = self._translate(q_is, f_i, count, last=last)
        if not last:
            self._f_i_before = f_i[:, count - 2 : count].copy()
            self._q_is = q_is[:, count].copy()
            self._keep(raw_w, raw_f, count)
        return trajectory

    def _keep(self, w: Array, f: Array, count: int) -> None:
        """Keep what the next part needs, when `count` samples are done."""
        first = max(self._lead + count - _BEHIND, 0)
        self._lead += count - first
        self._done += count
        self._w, self._f = w[:, first:].copy(), f[:, first:].copy()

    def _translate(self, q_is: Array, f_i: Array, count: int, *, last: bool) -> Trajectory:
        """Integrate velocity and position in i, window by window; return `count` rows in n.

        q_is (4, m), f_i (3, m) from the state's sample on; the state moves to sample `count`.
        """
        surroundings, interval, start = self._surroundings, self._interval, self._start
        behind = self._f_i_before.shape[1]
        there = f_i.shape[1]  # samples to look at, those from `behind` before on
        f_i = np.concatenate([self._f_i_before, f_i], axis=1) if behind else f_i
        n = there if last else count + 1
        w_ie = surroundings.w_ie
        unit = w_ie / np.linalg.norm(w_ie)
        step = earth.EARTH_RATE * interval
        sample: Array = np.arange(self._done - behind, self._done + there, dtype=float)
        turned = step * sample

        d_i, v_i = np.empty((3, n)), np.empty((3, n))
        d_i[:, 0], v_i[:, 0] = self._d_i, self._v_i
        for first in range(0, max(n - 1, 1), _WINDOW):
            # One sample of overlap carries the state, two more on each side feed the quadrature.
            end = min(first + _WINDOW + 1, n)
            lead, trail = min(first + behind, 2), min(there - end, 2)
            window = slice(behind + first - lead, behind + end + trail)
            steps: Array = np.arange(-lead, end + trail - first) * interval
            v0, d0 = v_i[:, first].copy(), d_i[:, first].copy()
            v, d = np.repeat(v0[:, None], len(steps), axis=1), d0[:, None] + v0[:, None] * steps
            angle, force = turned[window], f_i[:, window]
            for _ in range(20):
                d_n0 = _turn(unit, -angle, d)
                acceleration = surroundings.gravitation(d_n0)
                if self._hold_height:
                    v_n0 = _turn(unit, -angle, v) - _cross(w_ie, d_n0)
                    f_n0 = _turn(unit, -angle, force)
                    acceleration += surroundings.vertical_restraint(d_n0, v_n0, f_n0 + acceleration)
                a = force + _turn(unit, angle, acceleration)
                v_new = _running(a, v0, interval, lead)
                d_new = _running(v_new, d0, interval, lead)
                moved = float(np.max(np.abs(d_new - d)))
                v, d = v_new, d_new
                if moved < _SETTLED:
                    break
            kept = slice(lead, lead + end - first)
            v_i[:, first:end], d_i[:, first:end] = v[:, kept], d[:, kept]

        self._d_i, self._v_i = d_i[:, n - 1].copy(), v_i[:, n - 1].copy()
        rows = slice(0, count)
        turned, d_i, v_i = turned[behind : behind + count], d_i[:, rows], v_i[:, rows]
        d_n0 = _turn(unit, -turned, d_i)
        v_n0 = _turn(unit, -turned, v_i) - _cross(w_ie, d_n0)
        q_n0i = rotation.quaternion_from_vector(-unit[:, None] * turned)
        latitude, longitude, height = surroundings.geodetic(d_n0)
        q_n_n0 = rotation.multiply(
            rotation.conjugate(_q_en(latitude, longitude)),
            _q_en(np.array([start.latitude]), np.zeros(1)),
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


def instants(average: Array) -> Array:
    """Return values at the sample times (k, n) from means over the intervals that end there.

    The value between two intervals from the three on either side, exact for polynomials of
    degree 5 (Colella and Woodward, J. Comput. Phys. 54 (1984) 174, at next order).
    """
    n = average.shape[1]
    points = min(6, n)
    result = np.empty_like(average)
    if points == 6:
        a = average
        result[:, 2:-3] = (
            37.0 * (a[:, 2:-3] + a[:, 3:-2])
            - 8.0 * (a[:, 1:-4] + a[:, 4:-1])
            + (a[:, :-5] + a[:, 5:])
        ) / 60.0
    # At the ends the same polynomial through the nearest intervals, off centre.
    edge = np.arange(points)
    powers = np.arange(1, points + 1)
    # Column j: mean of x^j over the interval that ends at x = edge.
    means = ((edge[:, None]) ** powers - (edge[:, None] - 1.0) ** powers) / powers
    values = edge[:, None].astype(float) ** (powers - 1)
    weights = values @ np.linalg.inv(means)
    head = min(2, n)
    result[:, :head] = average[:, :points] @ weights[:head].T
    tail = min(3, n)
    result[:, n - tail :] = average[:, n - points :] @ weights[points - tail :].T
    return result


def _interval_integrals(y: Array, interval: float) -> Array:
    """Return the integrals (k, n-1) of y (k, n) from each sample to the next.

    A quintic through the six nearest samples, fewer where there are fewer. The weights inside are
    those of Adams's central formula: (11, -93, 802, 802, -93, 11) / 1440.
    """
    n = y.shape[1]
    points = min(6, n)
    result = np.empty((y.shape[0], n - 1))
    if points == 6:
        result[:, 2:-2] = (
            802.0 * (y[:, 2:-3] + y[:, 3:-2])
            - 93.0 * (y[:, 1:-4] + y[:, 4:-1])
            + 11.0 * (y[:, :-5] + y[:, 5:])
        )
        result[:, 2:-2] *= interval / 1440.0
    # At the ends the same polynomial through the nearest samples, off centre.
    at = np.arange(points, dtype=float)
    powers = np.arange(points)
    moments = (at[1:, None] ** (powers + 1) - at[:-1, None] ** (powers + 1)) / (powers + 1)
    weights = interval * moments @ np.linalg.inv(at[:, None] ** powers)
    edge = min(2, n - 1)
    result[:, :edge] = y[:, :points] @ weights[:edge].T
    result[:, n - 1 - edge :] = y[:, n - points :] @ weights[points - 1 - edge :].T
    return result


def _rotation_vectors(w: Array, angle: Array, interval: float) -> Array:
    """Return the rotations (3, n-1) between samples, of rates w (3, n) and their integrals.

    The rotation vector of a step is the angle increment and what does not commute: with the rate
    as a + b s + c s^2 + d s^3, s from -1/2 to 1/2 over the step, the Magnus series up to the
    sixth order of the interval. Left out, far below rounding: b x c, b x (a x b).
    Source: Blanes, Casas, Oteo, Ros, Phys. Rep. 470 (2009) 151, equation (253), for C' = C (w x);
    the term in d from the double integral of the commutator, its equation (48).
    """
    a = 0.5 * (w[:, :-1] + w[:, 1:])
    b = w[:, 1:] - w[:, :-1]
    c, d = np.zeros_like(a), np.zeros_like(a)
    if w.shape[1] >= 4:
        outer_sum, outer_step = w[:, :-3] + w[:, 3:], w[:, 3:] - w[:, :-3]
        c[:, 1:-1] = 0.25 * outer_sum - 0.5 * a[:, 1:-1]
        d[:, 1:-1] = (outer_step - 3.0 * b[:, 1:-1]) / 6.0
        a[:, 1:-1] -= 0.25 * c[:, 1:-1]
        b[:, 1:-1] -= 0.25 * d[:, 1:-1]
    for rate in (a, b, c, d):
        rate *= interval
    inner = c / 360.0 - _cross(a, b) / 720.0
    return angle + _cross(a, b / 12.0 + d / 80.0 + _cross(a, inner))


def _attitude(turns: Array, first: Array) -> Array:
    """Return q_is (4, n), the first (4,), turned by the rotation vectors (3, n-1)."""
    steps = np.empty((4, turns.shape[1] + 1))
    steps[:, 0] = first
    steps[:, 1:] = rotation.quaternion_from_vector(turns)
    q_is = rotation.cumulative_product(steps)
    q_is /= np.sqrt(np.einsum("kn,kn->n", q_is, q_is))
    return q_is


def _running(y: Array, start: Array, interval: float, lead: int) -> Array:
    """Return the running integral of y (3, m) that has the value `start` at sample `lead`."""
    total = np.zeros_like(y)
    np.cumsum(_interval_integrals(y, interval), axis=1, out=total[:, 1:])
    total += (start - total[:, lead])[:, None]
    return total


def _turn(unit: Array, angle: Array, v: Array) -> Array:
    """Turn v (3, m) right-handed about the unit vector (3,) by the angles (m,), rad."""
    # Small angles throughout (15 deg an hour): 1 - cos without cancellation.
    s, c1 = np.sin(angle), 2.0 * np.sin(0.5 * angle) ** 2
    a, b, c = unit
    x, y, z = v
    cross = np.stack([b * z - c * y, c * x - a * z, a * y - b * x])
    along = c1 * (a * x + b * y + c * z)
    turned: Array = v + s * cross - c1 * v + unit[:, None] * along
    return turned


def _cross(a: Array, b: Array) -> Array:
    """Return a x b, components first."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def _q_en(latitude: Array, longitude: Array) -> Array:
    """Return the quaternions (4, n) from East-North-Up to e: about z, then about x."""
    half_z, half_x = 0.5 * longitude + np.pi / 4.0, np.pi / 4.0 - 0.5 * latitude
    cz, sz, cx, sx = np.cos(half_z), np.sin(half_z), np.cos(half_x), np.sin(half_x)
    return np.stack([cz * cx, cz * sx, sz * sx, sz * cx])


class _Surroundings:
    """Gravity and geography about the starting point, as functions of the displacement in n0."""

    def __init__(self, start: Start, gravity: float | None) -> None:
        self.w_ie = earth.earth_rate_n(start.latitude)
        normal = float(earth.normal_gravity(start.latitude, start.height))
        self._scale = 1.0 if gravity is None else gravity / normal
        self._r0_e = earth.position_e(start.latitude, 0.0, start.height)
        self._C_en0 = earth.C_ne(start.latitude, 0.0).T

    def _normal_e(self, d_n0: Array) -> tuple[Array, Array, Array]:
        """Return the ellipsoid's outward normal in e (3, m), sin of latitude and height."""
        r = self._r0_e[:, None] + self._C_en0 @ d_n0
        return earth.ellipsoid_normal(r)

    def geodetic(self, d_n0: Array) -> tuple[Array, Array, Array]:
        """Return latitude, longitude from the start's meridian (rad) and height (m)."""
        normal, _, height = self._normal_e(d_n0)
        latitude = np.arctan2(normal[2], np.hypot(normal[0], normal[1]))
        return latitude, np.arctan2(normal[1], normal[0]), height

    def gravitation(self, d_n0: Array) -> Array:
        """Return gravity plus what the start's own centripetal motion leaves, (3, m), in n0.

        d'' in i is f + g(r) + w x (w x d): gravitation less the acceleration of the start.
        """
        normal, sin_latitude, height = self._normal_e(d_n0)
        height = np.clip(height, -_GRAVITY_KNOWN, _GRAVITY_KNOWN)
        g = self._scale * earth.normal_gravity_sin(sin_latitude, height)
        down = self._C_en0.T @ normal
        w = self.w_ie
        centripetal = np.outer(w, w @ d_n0) - (w @ w) * d_n0
        return centripetal - g * down

    def vertical_restraint(self, d_n0: Array, v_n0: Array, a_n0: Array) -> Array:
        """Return the acceleration (3, m) along the vertical that keeps the height constant.

        a_n0: acceleration in i, seen in n0, without the restraint.
        """
        normal, sin_latitude, height = self._normal_e(d_n0)
        up = self._C_en0.T @ normal
        w = self.w_ie
        relative = a_n0 - 2.0 * _cross(w, v_n0) - (np.outer(w, w @ d_n0) - (w @ w) * d_n0)
        R_M, R_N = earth.radii(np.arcsin(sin_latitude))
        v_up = np.einsum("kn,kn->n", v_n0, up)
        east = np.cross(self._C_en0[2], up.T).T
        east /= np.linalg.norm(east, axis=0)
        v_east = np.einsum("kn,kn->n", v_n0, east)
        v_horizontal2 = np.einsum("kn,kn->n", v_n0, v_n0) - v_up**2
        curvature = v_east**2 / (R_N + height) + (v_horizontal2 - v_east**2) / (R_M + height)
        restraint: Array = -up * (np.einsum("kn,kn->n", relative, up) + curvature)
        return restraint
