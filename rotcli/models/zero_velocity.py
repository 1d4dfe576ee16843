"""The zero-velocity filter of a turntable log: sensor biases, tilts and azimuth.

The table stays in place, so the computed velocity is an error, and it is measured several times
a second. States: errors (computed minus true) of velocity and attitude in n, sensor biases in s
(true minus estimated, random walks with the turn-on bias in P0), and optionally the two
components of the lever arm across the axis, and the gyros' scale factor and installation errors
that the rotation excites (the column N u, constants).
Closed loop: every update's estimate is fed back at once, because a bias of 1800 deg/h would turn
an open loop out of its linear range within minutes.

Slaved azimuth: nothing measures the azimuth error. Left to drift it turns the computed frame, the
filter takes the turning for information, and the level and still cases seem observable; the
innovations do not show it. So the computed attitude is turned back to the table's azimuth after
each update, and the angle and the estimated azimuth errors are summed up apart (`psi`). F and the
gains then do not depend on the data: computed once, they can serve any number of runs.

Source of the model: O17, "Observability of a rotating MEMS INS", Sensors 2017, 17, 698.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rotcli.models import kalman
from rotcli.models.earth import earth_rate_n
from rotcli.models.errors_ins import coriolis, force_coupling
from rotcli.models.kalman import Gains
from rotcli.models.rotation import axis_rotation, skew
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR

Array = NDArray[np.float64]

STATES = (
    *("v_east", "v_north", "v_up", "tilt_east", "tilt_north", "azimuth"),
    *(f"accel_bias_{a}" for a in "xyz"),
    *(f"gyro_bias_{a}" for a in "xyz"),
)
V, EPS, BA, BG = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)


@dataclass(frozen=True)
class Noise:
    """Sensor noise: white, and first-order Gauss-Markov wander of the biases.

    angle_random_walk: rad/sqrt(s). velocity_random_walk: m/s/sqrt(s). gyro_wander (rad/s),
    accel_wander (m/s^2): sigma, with correlation times in s.
    """

    angle_random_walk: float = 3.0 * DEG_PER_ROOT_HOUR
    velocity_random_walk: float = 0.002
    gyro_wander: float = 24.0 * DEG_PER_HOUR
    gyro_time: float = 120.0
    accel_wander: float = 5e-4
    accel_time: float = 120.0


@dataclass(frozen=True)
class Initial:
    """Initial sigmas, SI: velocity, tilts, azimuth, sensor biases (turn-on), lever arm, scale.

    scale: of each element of the gyros' column N u, a fraction; 0 leaves those states out.
    """

    velocity: float = 1e-3
    tilt: float = 1.0 * DEG
    azimuth: float = 0.1 * DEG
    accel: float = 0.02
    gyro: float = 500.0 * DEG_PER_HOUR
    lever_arm: float = 0.1
    scale: float = 0.0


@dataclass(frozen=True, eq=False)
class Settings:
    """What the filter is told.

    latitude: rad. gravity: m/s^2. C_nb: (3, 3) attitude of the still body. axis: (3,) unit vector
    of the rotation in b. samples: IMU samples per update. velocity_sigma: m/s, of the
    zero-velocity measurement. lever_arm: (3,) m, axis to IMU, in s. averages: whether an IMU
    sample is the mean over the interval that ends at its time, not the value at it.
    """

    latitude: float
    gravity: float
    C_nb: Array
    axis: Array
    samples: int = 10
    velocity_sigma: float = 2e-3
    noise: Noise = field(default_factory=Noise)
    initial: Initial = field(default_factory=Initial)
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    estimate_lever_arm: bool = False
    slave_azimuth: bool = True
    smooth: bool = False
    averages: bool = False

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        lever = ("lever_arm_1", "lever_arm_2") if self.estimate_lever_arm else ()
        return (*STATES, *lever, *(f"gyro_column_{a}" for a in "xyz" if self.initial.scale))

    @property
    def lever_states(self) -> slice:
        """Where the lever arm stands among the states."""
        return slice(12, 14 if self.estimate_lever_arm else 12)

    @property
    def column_states(self) -> slice:
        """Where the gyros' column N u stands among the states."""
        return slice(self.lever_states.stop, len(self.states))

    @property
    def initial_sigma(self) -> Array:
        """Initial sigma of each state (m,)."""
        i = self.initial
        sigma = np.repeat([i.velocity, i.tilt, i.accel, i.gyro], 3)
        sigma[5] = i.azimuth
        lever = [i.lever_arm] * 2 if self.estimate_lever_arm else []
        return np.append(sigma, lever + ([i.scale] * 3 if i.scale else []))

    @property
    def across(self) -> Array:
        """Two unit vectors (3, 2) across the rotation axis: the sensor axes where they are."""
        least = np.argsort(np.abs(self.axis), kind="stable")[:2]
        first, second = np.eye(3)[np.sort(least)]
        first = first - (first @ self.axis) * self.axis
        first /= np.linalg.norm(first)
        second = second - (second @ self.axis) * self.axis - (second @ first) * first
        return np.stack([first, second / np.linalg.norm(second)], axis=1)


@dataclass(frozen=True, eq=False)
class Plan:
    """What the table's motion makes of n updates that follow one another, without the IMU's data.

    C_bs: (n + 1, 3, 3) of the table at the start and at each update. rate: (n,) rad/s, mean over
    each interval. H: (n + 1, 3, m), measurement incl. lever-arm states; arm: (n + 1, 3) m/s,
    velocity of the IMU in n by the given lever arm. Phi: (n, m, m) transitions about the given
    attitude. Q: (m, m) process noise of one update interval; R: (3, 3).
    """

    settings: Settings
    interval: float
    C_bs: Array
    rate: Array
    H: Array
    arm: Array
    Phi: Array
    Q: Array
    R: Array

    @property
    def tau(self) -> float:
        """Time from update to update, s."""
        return self.interval * self.settings.samples

    @property
    def P0(self) -> Array:
        """Covariance (m, m) at the start, where the log starts with these updates.

        The start's velocity is that of the assumed lever arm: dv = dv_0 - H_r dr.
        """
        s = self.settings
        T = np.eye(len(s.states))
        T[V, s.lever_states] = -self.H[0][:, s.lever_states]
        result: Array = T @ np.diag(s.initial_sigma**2) @ T.T
        return result

    def gains(self, P: Array) -> Gains:
        """Return the gains of the slaved filter from the covariance P (m, m) before them."""
        return kalman.gain_sequence(P, self.Phi, self.Q, self.H[1:], self.R)


def plan(theta: Array, interval: float, settings: Settings, within: slice | None = None) -> Plan:
    """Plan the updates of table angles theta (n,), rad, at the IMU's samples.

    within: the samples from the first update's start to the last update, where theta begins
    before or goes on after them; half an update's worth of samples beside them is looked at.
    """
    s, step = settings, settings.samples
    first, stop, _ = (within or slice(None)).indices(len(theta))
    count = (stop - first - 1) // step
    last = first + count * step
    if within is None:
        theta = theta[: last + 1]
    rate = _rate(theta, interval, slice(first, last + 1), step)
    theta = theta[first : last + 1]
    tau = step * interval
    C_ref = s.C_nb @ axis_rotation(s.axis, 0.5 * (theta[1:] + theta[:-1]))
    C_ref = C_ref.reshape(count, step, 3, 3)
    left = (step - 0.5 - np.arange(step)) * interval  # time from each middle to the block's end
    J1 = C_ref.sum(axis=1) * interval
    J2 = np.einsum("i,kiab->kab", left, C_ref) * interval
    m = len(s.states)
    Phi = np.broadcast_to(np.eye(m), (count, m, m)).copy()
    fill_transition(Phi, J1, J2, s, tau)
    if s.initial.scale:
        turned = np.diff(theta).reshape(count, step)
        Phi[:, EPS, s.column_states] = np.einsum("ki,kiab->kab", turned, C_ref)
        F_n = force_coupling(np.array([0.0, 0.0, s.gravity]))
        Phi[:, V, s.column_states] = F_n @ np.einsum("i,ki,kiab->kab", left, turned, C_ref)
    if s.slave_azimuth:
        Phi[:, 3:5, 5] = 0.0
    Q = np.zeros((m, m))
    noise = s.noise
    Q[V, V] = np.eye(3) * noise.velocity_random_walk**2 * tau
    Q[EPS, EPS] = np.eye(3) * noise.angle_random_walk**2 * tau
    Q[BA, BA] = np.eye(3) * 2.0 * noise.accel_wander**2 / noise.accel_time * tau
    Q[BG, BG] = np.eye(3) * 2.0 * noise.gyro_wander**2 / noise.gyro_time * tau
    C_bs = axis_rotation(s.axis, theta[::step])
    # Velocity of the IMU per metre of lever arm: C_ns [w_t x].
    swing = rate[:, None, None] * (s.C_nb @ C_bs @ skew(s.axis))
    H = np.broadcast_to(np.eye(3, m), (count + 1, 3, m)).copy()
    if s.estimate_lever_arm:
        H[:, :, s.lever_states] = swing @ s.across
    return Plan(
        settings=s,
        interval=interval,
        C_bs=C_bs,
        rate=np.diff(theta[::step]) / tau,
        H=H,
        arm=swing @ np.array(s.lever_arm),
        Phi=Phi,
        Q=Q,
        R=np.eye(3) * s.velocity_sigma**2,
    )


def fill_transition(Phi: Array, J1: Array, J2: Array, s: Settings, tau: float) -> None:
    """Write the transition blocks into Phi (..., m, m), where they are not those of identity."""
    F_n = force_coupling(np.array([0.0, 0.0, s.gravity]))
    Phi[..., V, V] = np.eye(3) + coriolis(s.latitude) * tau
    Phi[..., V, EPS] = F_n * tau
    Phi[..., V, BA] = J1
    Phi[..., V, BG] = F_n @ J2
    Phi[..., EPS, EPS] = np.eye(3) - skew(earth_rate_n(s.latitude)) * tau
    Phi[..., EPS, BG] = J1


def _rate(theta: Array, interval: float, span: slice, step: int) -> Array:
    """Return the table rate (rad/s) at each `step`-th sample of a span, smoothed over as many."""
    half = max(step // 2, 1)
    at = np.arange(span.start, span.stop, step)
    before, after = np.maximum(at - half, 0), np.minimum(at + half, len(theta) - 1)
    result: Array = (theta[after] - theta[before]) / ((after - before) * interval)
    return result
