"""The ZUPT filter of a turntable log: its settings, its states and the model of its updates.

The table stays in place, so the computed velocity is an error, and it is measured several times
a second (zero-velocity update, ZUPT). States: errors (computed minus true) of velocity and
attitude in n, sensor biases in s (true minus estimated, random walks with the turn-on bias in
P0), and optionally the two components of the lever arm perpendicular to the axis, and the axis
column of the gyros: scale factor and installation errors that the rotation excites (constants).
Closed loop: every update's estimate is fed back at once, because a bias of 1800 deg/h would take
an open loop out of its linear range within minutes.

Slaved azimuth: nothing measures the azimuth error. If it drifts it rotates the computed frame, the
filter treats this rotation as information, and the level and still cases seem observable; the
innovations do not show it. So the computed attitude is rotated back to the table's azimuth after
each update, and the angle and the estimated azimuth errors are summed separately (`azimuth_sum`
in `rotcli.observe.zupt.filter`). F and the gains then do not depend on the data: computed once,
they serve any number of runs.

Source of the model: O17, "Improving Observability of an Inertial System by Rotary Motions
of an IMU", Sensors 2017, 17, 698.
"""

from dataclasses import field
from functools import cached_property

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.earth import earth_rate_n
from rotcli.models.kalman import FilterGains
from rotcli.models.rotation import axis_rotation, skew
from rotcli.models.states import StateLayout
from rotcli.observe.errors_ins import coriolis, force_coupling
from rotcli.observe.zupt.kalman_blocks import SparseModel, blocked_gains
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR, FloatArray

GROUPS: dict[str, tuple[str, ...]] = {
    "VELOCITY": ("v_east", "v_north", "v_up"),
    "TILT": ("tilt_east", "tilt_north"),
    "AZIMUTH": ("azimuth",),
    "ACCEL_BIAS": tuple(f"accel_bias_{a}" for a in "xyz"),
    "GYRO_BIAS": tuple(f"gyro_bias_{a}" for a in "xyz"),
}


def state_layout(*, lever_arm: bool, axis_column: bool) -> StateLayout:
    """Return the states of the filter, with or without lever arm and axis column.

    >>> state_layout(lever_arm=True, axis_column=True).AXIS_COLUMN
    slice(14, 17, None)
    """
    return StateLayout(
        **GROUPS,
        LEVER_ARM=("lever_arm_1", "lever_arm_2") if lever_arm else (),
        AXIS_COLUMN=tuple(f"gyro_column_{a}" for a in "xyz") if axis_column else (),
    )


# Of the second difference of mean rates: the error of the smoothed rate at a kink of the rate.
_KINK_SHARE = 0.5
_BASE = StateLayout(**GROUPS)  # the states that are always present
VELOCITY, TILT, ATTITUDE = _BASE.VELOCITY, _BASE.TILT, _BASE.span("TILT", "AZIMUTH")
AZIMUTH = _BASE.index("azimuth")
ACCEL_BIAS, GYRO_BIAS = _BASE.ACCEL_BIAS, _BASE.GYRO_BIAS
# Velocity and attitude are mechanized; the estimates from the biases on are subtracted.
MECHANIZED = _BASE.span("VELOCITY", "AZIMUTH")
ESTIMATED = slice(MECHANIZED.stop, None)


@dataclass(frozen=True)
class Noise:
    """Sensor noise: white, and biases as first-order Gauss-Markov processes.

    angle_random_walk: rad/sqrt(s). velocity_random_walk: m/s/sqrt(s). gyro_markov_sigma (rad/s),
    accel_markov_sigma (m/s^2): sigma of the in-run biases, with correlation times in s.
    """

    angle_random_walk: float = 3.0 * DEG_PER_ROOT_HOUR
    velocity_random_walk: float = 0.002
    gyro_markov_sigma: float = 24.0 * DEG_PER_HOUR
    gyro_correlation_time: float = 120.0
    accel_markov_sigma: float = 5e-4
    accel_correlation_time: float = 120.0


@dataclass(frozen=True)
class InitialSigma:
    """Initial sigmas, SI: velocity, tilts, azimuth, sensor biases (turn-on), lever arm, scale.

    scale: of each element of the axis column, a fraction; 0 omits those states.
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
    """Settings of the filter.

    latitude: rad. gravity: m/s^2. C_nb: (3, 3) nominal attitude of the still body. axis: (3,) unit
    vector of the rotation in b. samples: IMU samples per update. velocity_sigma: m/s, of the
    zero-velocity measurement. lever_arm: (3,) m, axis to IMU, in s. samples_are_means: whether an
    IMU sample is the mean over the interval that ends at its time, not the value at it.
    """

    latitude: float
    gravity: float
    C_nb: FloatArray
    axis: FloatArray
    samples: int = 10
    velocity_sigma: float = 2e-3
    noise: Noise = field(default_factory=Noise)
    initial: InitialSigma = field(default_factory=InitialSigma)
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    estimate_lever_arm: bool = False
    slave_azimuth: bool = True
    smooth: bool = False
    samples_are_means: bool = False

    @cached_property
    def layout(self) -> StateLayout:
        """Names and slices of the states."""
        return state_layout(lever_arm=self.estimate_lever_arm, axis_column=bool(self.initial.scale))

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.layout.names

    @property
    def initial_sigma(self) -> FloatArray:
        """Initial sigma of each state (m,)."""
        i, layout = self.initial, self.layout
        sigma = np.empty(len(layout))
        sigma[VELOCITY], sigma[TILT], sigma[AZIMUTH] = i.velocity, i.tilt, i.azimuth
        sigma[ACCEL_BIAS], sigma[GYRO_BIAS] = i.accel, i.gyro
        sigma[layout.LEVER_ARM], sigma[layout.AXIS_COLUMN] = i.lever_arm, i.scale
        return sigma

    @property
    def lever_axes(self) -> FloatArray:
        """Two unit vectors (3, 2) perpendicular to the rotation axis; sensor axes if possible."""
        smallest = np.argsort(np.abs(self.axis), kind="stable")[:2]
        first, second = np.eye(3)[np.sort(smallest)]
        first = first - (first @ self.axis) * self.axis
        first /= np.linalg.norm(first)
        second = second - (second @ self.axis) * self.axis - (second @ first) * first
        return np.stack([first, second / np.linalg.norm(second)], axis=1)


@dataclass(frozen=True, eq=False)
class UpdateModel:
    """The model of n consecutive updates: the part that depends on the table's motion alone.

    C_bs: (n + 1, 3, 3) of the table at the start and at each update. rate: (n,) rad/s, mean over
    each interval. lever_arm_velocity: (n + 1, 3) m/s, velocity of the IMU in n by the lever arm of
    the settings. lever_H0: (3, 0 or 2), measurement of the lever-arm states at the start.
    linear: transitions about the nominal attitude, noise and measurements of the updates.
    """

    settings: Settings
    interval: float
    C_bs: FloatArray
    rate: FloatArray
    lever_arm_velocity: FloatArray
    lever_H0: FloatArray
    linear: SparseModel

    @property
    def tau(self) -> float:
        """Time from update to update, s."""
        return self.interval * self.settings.samples

    @property
    def P0(self) -> FloatArray:
        """Covariance (m, m) at the start, where the log starts with these updates.

        The start's velocity is that of the assumed lever arm: dv = dv_0 - H_r dr.
        """
        s = self.settings
        lever_arm = s.layout.LEVER_ARM
        T = np.eye(len(s.states))
        T[VELOCITY, lever_arm] = -self.lever_H0
        result: FloatArray = T @ np.diag(s.initial_sigma**2) @ T.T
        return result

    def gains(self, P: FloatArray, *, covariances: bool = False) -> FilterGains:
        """Return the gains of the slaved filter from the prior covariance P (m, m).

        covariances: with those of each update, as `smooth_updates` needs them.
        """
        return blocked_gains(P, self.linear, covariances=covariances)


def build_update_model(
    theta: FloatArray, interval: float, settings: Settings, window: slice | None = None
) -> UpdateModel:
    """Return the model of the updates of table angles theta (n,), rad, at the IMU's samples.

    window: the samples from the first update's start to the last update, where theta begins
    earlier or ends later; the rates use up to half an update of samples outside of it.
    """
    s, step = settings, settings.samples
    first, stop, _ = (window or slice(None)).indices(len(theta))
    count = (stop - first - 1) // step
    last = first + count * step
    if window is None:
        theta = theta[: last + 1]
    rate = _smoothed_rate(theta, interval, slice(first, last + 1), step)
    lever_arm_variance = _lever_arm_variance(theta, interval, slice(first, last + 1), s)
    theta = theta[first : last + 1]
    tau = step * interval
    C_bs = axis_rotation(s.axis, theta[::step])
    # Velocity of the IMU per metre of lever arm: C_ns [w_t x].
    velocity_per_lever_arm = rate[:, None, None] * (s.C_nb @ C_bs @ skew(s.axis))
    lever_H = velocity_per_lever_arm @ s.lever_axes[:, : 2 if s.estimate_lever_arm else 0]
    return UpdateModel(
        settings=s,
        interval=interval,
        C_bs=C_bs,
        rate=np.diff(theta[::step]) / tau,
        lever_arm_velocity=velocity_per_lever_arm @ np.array(s.lever_arm),
        lever_H0=lever_H[0],
        linear=SparseModel(
            rows=_transitions(theta, interval, s),
            Q=_process_noise(s, tau),
            R=np.eye(3) * s.velocity_sigma**2,
            H_rest=lever_H[1:] if s.estimate_lever_arm else None,
            columns=s.layout.LEVER_ARM,
            more_variance=lever_arm_variance,
        ),
    )


def _lever_arm_variance(
    theta: FloatArray, interval: float, span: slice, s: Settings
) -> FloatArray | None:
    """Return the variance (n,), (m/s)^2, of the lever arm's velocity at the updates of a span.

    The smoothed rate is wrong where the table accelerates abruptly, by up to half of the second
    difference of mean rates over an update (at a kink; a sixth where the rate is smooth). The
    noise of a coarse encoder is of the same size. None without a lever arm.
    """
    arm = float(np.linalg.norm(np.cross(s.axis, s.lever_arm)))
    if s.estimate_lever_arm:
        arm = float(np.hypot(arm, s.initial.lever_arm))
    half = max(s.samples // 2, 1)
    last = len(theta) - 1 - 2 * half
    if not arm or last < 2 * half:
        return None
    at = np.clip(np.arange(span.start + s.samples, span.stop, s.samples), 2 * half, last)
    outer, inner = (theta[at + k * half] - theta[at - k * half] for k in (2, 1))
    second = (outer - 2.0 * inner) / (2.0 * half * interval)
    result: FloatArray = (_KINK_SHARE * arm * second) ** 2
    return result


def _transitions(theta: FloatArray, interval: float, s: Settings) -> FloatArray:
    """Return the rows of velocity and attitude of Phi (n, 6, m), about the nominal attitude.

    theta: (n samples + 1,) rad. With S = [u x] the rotation over an update is
    `C_nb (1 + sin S + (1 - cos) S^2)`, linear in 1, sin and 1 - cos of the angles half-way between
    the samples; so its integrals need only sums of these numbers, each with its weight.
    """
    step, m = s.samples, len(s.states)
    half_way = (0.5 * (theta[1:] + theta[:-1])).reshape(-1, step)
    sine, cosine = np.sin(half_way), np.cos(half_way)
    S = skew(s.axis)
    basis = np.stack([s.C_nb, s.C_nb @ S, s.C_nb @ S @ S]).reshape(3, 9)
    time_to_end = (step - 0.5 - np.arange(step)) * interval  # from half-way to the update
    weights = np.stack([np.ones(step), time_to_end], axis=1)

    def integrals(w: FloatArray) -> list[FloatArray]:
        """Return the sums of w C and of time_to_end w C, (n, 3, 3); w: (n, step) or (1, step)."""
        sums = np.stack([(w * f) @ weights for f in (1.0, sine, 1.0 - cosine)], axis=-1)
        return [(sums[:, k] @ basis).reshape(-1, 3, 3) for k in (0, 1)]

    count = len(half_way)
    rows = np.broadcast_to(np.eye(MECHANIZED.stop, m), (count, MECHANIZED.stop, m)).copy()
    rotation_integral, rotation_double_integral = integrals(np.full((count, step), interval))
    fill_transition(rows, rotation_integral, rotation_double_integral, s, step * interval)
    if s.initial.scale:
        column = s.layout.AXIS_COLUMN
        F_n = force_coupling(np.array([0.0, 0.0, s.gravity]))
        rows[:, ATTITUDE, column], integral = integrals(np.diff(theta).reshape(count, step))
        rows[:, VELOCITY, column] = F_n @ integral
    if s.slave_azimuth:
        rows[:, TILT, AZIMUTH] = 0.0
    return rows


def _process_noise(s: Settings, tau: float) -> FloatArray:
    """Return Q (m, m) of one update interval tau, s."""
    noise, Q = s.noise, np.zeros((len(s.states), len(s.states)))
    Q[VELOCITY, VELOCITY] = np.eye(3) * noise.velocity_random_walk**2 * tau
    Q[ATTITUDE, ATTITUDE] = np.eye(3) * noise.angle_random_walk**2 * tau
    for group, sigma, time in (
        (ACCEL_BIAS, noise.accel_markov_sigma, noise.accel_correlation_time),
        (GYRO_BIAS, noise.gyro_markov_sigma, noise.gyro_correlation_time),
    ):
        Q[group, group] = np.eye(3) * 2.0 * sigma**2 / time * tau
    return Q


def fill_transition(
    Phi: FloatArray,
    rotation_integral: FloatArray,
    rotation_double_integral: FloatArray,
    s: Settings,
    tau: float,
) -> None:
    """Write the transition blocks into Phi (..., 6 or m, m), where they are not of identity."""
    F_n = force_coupling(np.array([0.0, 0.0, s.gravity]))
    Phi[..., VELOCITY, VELOCITY] = np.eye(3) + coriolis(s.latitude) * tau
    Phi[..., VELOCITY, ATTITUDE] = F_n * tau
    Phi[..., VELOCITY, ACCEL_BIAS] = rotation_integral
    Phi[..., VELOCITY, GYRO_BIAS] = F_n @ rotation_double_integral
    Phi[..., ATTITUDE, ATTITUDE] = np.eye(3) - skew(earth_rate_n(s.latitude)) * tau
    Phi[..., ATTITUDE, GYRO_BIAS] = rotation_integral


def _smoothed_rate(theta: FloatArray, interval: float, span: slice, step: int) -> FloatArray:
    """Return the table rate (rad/s) at each `step`-th sample of a span, smoothed over as many."""
    half = max(step // 2, 1)
    at = np.arange(span.start, span.stop, step)
    before, after = np.maximum(at - half, 0), np.minimum(at + half, len(theta) - 1)
    result: FloatArray = (theta[after] - theta[before]) / ((after - before) * interval)
    return result
