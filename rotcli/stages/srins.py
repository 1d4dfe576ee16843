"""Long-run calibration of a single-axis rotation INS: GNSS against the damped mechanization.

A 16-state filter (`rotcli.models.srins`) over a `LevelSolution`, open loop: its gains do not
depend on the readings, so many runs share one gain pass. A step of some seconds takes the mean of
the GNSS epochs within it, with the measurement matrix of that mean. The damping states are known
to the navigation computer; measured, they keep the reference's errors out of the estimates.
Source: the SRINS level-damping paper ("S").
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rotcli import units
from rotcli.models import earth, srins
from rotcli.models.level_ins import LevelSolution
from rotcli.models.srins import Damping, Motion

Array = NDArray[np.float64]

ARCSEC = units.UNITS["angle"]["arcsec"]
MICRO_G = units.UNITS["acceleration"]["ug"]
# The states whose dynamics are integrated; the other five are the sensors' constant errors.
_MOVING = [*range(7), *range(12, 16)]
# What F is told apart by: rad/s, m/s, m/s^2, rad. Finer differences change it below 1e-4.
_GRAIN = np.array([1e-3, 0.1, 0.1, 1e-3, 1e-3, 1e-4])
_KNOWN = 1e-6  # m/s, to which the measured damping states are taken as known
_TOLERATED = 0.1  # of the mean normalized square
_MANEUVER = 0.02  # m/s^2 over ten seconds, four times what a tilt of 100 arcsec feigns


@dataclass(frozen=True)
class FilterSettings:
    """The filter's knowledge, SI; the paper's sensors and the published initial sigmas.

    interval: s per filter step. gyro_white rad/sqrt(s), accel_white m/s/sqrt(s);
    reference_white m/s/sqrt(Hz), of V_ref; gnss_velocity m/s, gnss_position m, per epoch. The
    rest are initial sigmas: m/s, rad, rad, m, rad/s, m/s^2, m/s.
    """

    damping: Damping = field(default_factory=Damping)
    measured_damping: bool = True
    interval: float = 10.0
    gyro_white: float = 0.0005 * units.DEG_PER_ROOT_HOUR
    accel_white: float = MICRO_G
    reference_white: float = 0.1
    gnss_velocity: float = 0.01
    gnss_position: float = 10.0
    velocity: float = 0.5
    tilt: float = 60.0 * ARCSEC
    azimuth: float = 600.0 * ARCSEC
    position: float = 5000.0
    gyro_bias: float = 0.01 * units.DEG_PER_HOUR
    accel_bias: float = 50.0 * MICRO_G
    damping_state: float = 0.2

    def initial_sigma(self, latitude: float) -> Array:
        """Return the initial sigmas (16,) of the states."""
        R_M, R_N = earth.radii(latitude)
        position = [self.position / R_M, self.position / (R_N * np.cos(latitude))]
        return np.array(
            [self.velocity] * 2
            + [self.tilt] * 2
            + [self.azimuth, *position]
            + [self.gyro_bias] * 3
            + [self.accel_bias] * 2
            + [self.damping_state] * 4
        )

    def process_noise(self) -> Array:
        """Return the noise density (16, 16), states squared per second."""
        white = [self.accel_white] * 2 + [self.gyro_white] * 3 + [0.0] * 11
        G = srins.reference_drive(self.damping)
        return np.diag(np.square(white)) + self.reference_white**2 * G @ G.T

    def measurement_noise(self, latitude: float) -> Array:
        """Return the variances (4 or 8,) of one GNSS epoch and of the measured damping states."""
        R_M, R_N = earth.radii(latitude)
        p = self.gnss_position
        sigma = [self.gnss_velocity] * 2 + [p / R_M, p / (R_N * np.cos(latitude))]
        return np.square(sigma + [_KNOWN] * 4 * self.measured_damping)


@dataclass(frozen=True, eq=False)
class Steps:
    """The filter's linear model: Phi and Q (m, 16, 16), H (m, p, 16), R (m, p) of each step.

    used: (m, p) bool, False where there was nothing to measure.
    """

    Phi: Array
    H: Array
    R: Array
    Q: Array
    used: NDArray[np.bool_]


def filter_steps(
    theta: Array,
    velocity: Array,
    latitude: Array,
    block: float,
    settings: FilterSettings,
    epochs: NDArray[np.int64],
) -> Steps:
    """Return the model of each filter step from what happens in its blocks.

    theta: (n + 1,) rad, velocity: (2, n + 1), latitude: (n + 1,) at the edges of n blocks of
    `block` s, n a multiple of the blocks in a step. epochs: (n,) GNSS epochs at each block's end.
    Within a block F is constant once the sensor errors are seen in n.
    """
    per = round(settings.interval / block)
    steps = len(epochs) // per
    middle = 0.5 * (velocity[:, 1:] + velocity[:, :-1])
    keys = np.stack(
        [
            np.diff(theta) / block,
            *middle,
            *(np.diff(velocity, axis=1) / block),
            0.5 * (latitude[1:] + latitude[:-1]),
        ]
    )
    grains = np.round(keys[:, : steps * per].T / _GRAIN).astype(np.int64)
    kinds, index = np.unique(grains, axis=0, return_inverse=True)
    F = np.array(
        [
            srins.error_dynamics_n(Motion(L, ve, vn, ae, an), settings.damping, rate)
            for rate, ve, vn, ae, an, L in kinds * _GRAIN
        ]
    )
    forward, backward = srins.transition(F, block), srins.transition(F, -block)
    index = index.reshape(steps, per)
    start = theta[: steps * per].reshape(steps, per)
    n_epochs = epochs[: steps * per].reshape(steps, per)

    moving = np.ix_(range(steps), _MOVING, _MOVING)
    sensors = np.ix_(range(steps), _MOVING, range(7, 12))
    Phi = np.broadcast_to(np.eye(16), (steps, 16, 16))
    Q = np.zeros((steps, 16, 16))
    half = 0.5 * block * settings.process_noise()
    inverses = []
    for j in range(per):
        turned = forward[index[:, j]] @ srins.turn_to_n(start[:, j])
        block_Phi = np.tile(np.eye(16), (steps, 1, 1))
        block_Phi[moving], block_Phi[sensors] = turned[moving], turned[sensors]
        Phi = block_Phi @ Phi
        Q = block_Phi @ (Q + half) @ block_Phi.swapaxes(1, 2) + half
        inverse = np.tile(np.eye(16), (steps, 1, 1))
        inverse[moving] = backward[index[:, j]][moving]
        inverse[sensors] = -inverse[moving] @ turned[sensors]
        inverses.append(inverse)

    total = n_epochs.sum(axis=1)
    share = n_epochs / np.maximum(total, 1)[:, None]
    H_epoch = np.tile(srins.measurement_matrix(damping_states=False), (steps, 1, 1))
    H = share[:, -1, None, None] * H_epoch
    for j in range(per - 1, 0, -1):
        H_epoch = H_epoch @ inverses[j]
        H += share[:, j - 1, None, None] * H_epoch
    variances = settings.measurement_noise(float(latitude.mean()))
    R = np.tile(variances, (steps, 1))
    R[:, :4] /= np.maximum(total, 1)[:, None]
    used = np.ones(R.shape, dtype=bool)
    used[:, :4] = (total > 0)[:, None]
    if settings.measured_damping:
        states = srins.measurement_matrix(damping_states=True)[4:]
        H = np.concatenate([H, np.tile(states, (steps, 1, 1))], axis=1)
    return Steps(Phi, H, R, Q, used)


@dataclass(frozen=True, eq=False)
class GainPass:
    """Gains K (m, 16, p), innovation covariances S (m, p, p), sigma (m, 16) after each step."""

    K: Array
    S: Array
    sigma: Array
    covariance: Array


def gain_pass(steps: Steps, P0: Array) -> GainPass:
    """Run the covariance (16, 16) through the steps; no readings needed."""
    m, p, _ = steps.H.shape
    K, S, sigma = np.empty((m, 16, p)), np.empty((m, p, p)), np.empty((m, 16))
    P = P0
    for k in range(m):
        P = steps.Phi[k] @ P @ steps.Phi[k].T + steps.Q[k]
        H, R = steps.H[k], np.diag(steps.R[k])
        S[k] = H @ P @ H.T + R
        K[k] = np.linalg.solve(S[k], H @ P).T
        A = np.eye(16) - K[k] @ H
        P = A @ P @ A.T + K[k] @ R @ K[k].T
        P = 0.5 * (P + P.T)
        sigma[k] = np.sqrt(np.diag(P))
    return GainPass(K, S, sigma, P)


def run_filter(steps: Steps, gains: GainPass, z: Array) -> tuple[Array, Array]:
    """Return the estimates (m, 16, ...) and innovations (m, p, ...) of measurements (m, p, ...)."""
    estimates = np.empty((len(z), 16, *z.shape[2:]))
    innovations = np.empty_like(z)
    x = np.zeros((16, *z.shape[2:]))
    for k in range(len(z)):
        x = steps.Phi[k] @ x
        innovations[k] = z[k] - steps.H[k] @ x
        x = x + gains.K[k] @ innovations[k]
        estimates[k] = x
    return estimates, innovations


def step_measurements(
    solution: LevelSolution, differences: Array, epochs: NDArray[np.int64], per: int, *, damping: bool
) -> Array:
    """Return z (m, 4 or 8, ...): the mean of INS - GNSS in each step, then u at its end.

    differences: (4, n, ...) summed over the epochs at each block's end; per: blocks in a step.
    """
    steps = len(epochs) // per
    held = differences[:, : steps * per].reshape(4, steps, per, *differences.shape[2:])
    count = np.maximum(epochs[: steps * per].reshape(steps, per).sum(axis=1), 1)
    z = held.sum(axis=2) / count.reshape(1, steps, *[1] * (held.ndim - 3))
    if damping:
        z = np.concatenate([z, solution.u[:, per : steps * per + 1 : per]])
    return np.moveaxis(z, 1, 0)


@dataclass(frozen=True, eq=False)
class Consistency:
    """Innovations against what the filter expects of them.

    ratio: mean normalized square over its expectation, 1 for a filter that tells the truth;
    bounds: of the 95 % band of that mean; count: of the scalar measurements.
    """

    ratio: float
    bounds: tuple[float, float]
    count: int

    @property
    def sound(self) -> bool:
        """Whether the ratio is within the band, or within a tenth of 1: sensors are not ideal."""
        low, high = self.bounds
        return min(low, 1.0 - _TOLERATED) <= self.ratio <= max(high, 1.0 + _TOLERATED)


@dataclass(frozen=True, eq=False)
class SrinsCalibration:
    """What the filter found.

    time: (m,) s since its start; estimates, sigma (m, 16), SI; observability: (16,)
    1 - sigma(T)/sigma(0), the unit-free degree; gnss, reference: consistency of the GNSS
    innovations and of the measured damping states (None where not measured).
    """

    time: Array
    estimates: Array
    sigma: Array
    observability: Array
    gnss: Consistency
    reference: Consistency | None
    warnings: tuple[str, ...]

    def convergence(self, state: int, levels: Array) -> list[float | None]:
        """Return when sigma of a state falls below each level for good (s), None for never."""
        times: list[float | None] = []
        for level in levels:
            above = np.flatnonzero(self.sigma[:, state] >= level)
            first = 0 if not above.size else int(above[-1]) + 1
            times.append(float(self.time[first]) if first < len(self.time) else None)
        return times


def calibrate(
    solution: LevelSolution,
    differences: Array,
    epochs: NDArray[np.int64],
    block: float,
    settings: FilterSettings,
    *,
    start: float = 0.0,
) -> SrinsCalibration:
    """Estimate drifts and biases over a solution; its first moment is the filter's start.

    differences: (4, n) INS - GNSS `[dV_E, dV_N, d_latitude, d_longitude]` summed over the epochs
    (n,) at the ends of the n blocks of `block` s. start: s on the log's clock, for messages.
    """
    per = round(settings.interval / block)
    steps = filter_steps(
        solution.theta, solution.velocity, solution.latitude, block, settings, epochs
    )
    z = step_measurements(solution, differences, epochs, per, damping=settings.measured_damping)
    sigma0 = settings.initial_sigma(float(solution.latitude[0]))
    gains = gain_pass(steps, np.diag(sigma0**2))
    estimates, innovations = run_filter(steps, gains, z)
    gnss = _consistency(innovations, gains.S, steps.used, slice(0, 4))
    reference = None
    if settings.measured_damping:
        reference = _consistency(innovations, gains.S, steps.used, slice(4, 8))
    warnings = [
        *_maneuvers(solution.velocity, block, start),
        *_gaps(epochs, block, start),
        *_inconsistencies(gnss, reference),
    ]
    return SrinsCalibration(
        time=settings.interval * np.arange(1, len(z) + 1, dtype=float),
        estimates=estimates,
        sigma=gains.sigma,
        observability=1.0 - gains.sigma[-1] / sigma0,
        gnss=gnss,
        reference=reference,
        warnings=tuple(warnings),
    )


def _consistency(
    innovations: Array, S: Array, used: NDArray[np.bool_], rows: slice
) -> Consistency:
    """Judge the innovations of some rows (m, p) by the mean of their normalized squares."""
    kept = used[:, rows].all(axis=1)
    v, S = innovations[kept, rows], S[kept, rows, rows]
    squares = np.einsum("ki,ki->k", v, np.linalg.solve(S, v[..., None])[..., 0])
    count = v.size
    if not count:
        return Consistency(1.0, (0.0, np.inf), 0)
    low, high = mean_bounds(1, count)
    return Consistency(float(squares.sum() / count), (low, high), count)


def _inconsistencies(gnss: Consistency, reference: Consistency | None) -> list[str]:
    told = []
    if not gnss.sound:
        told.append(
            f"the filter is not consistent: its GNSS innovations are {gnss.ratio:.2f} of what it "
            f"expects in the mean square (95 % band {gnss.bounds[0]:.3f} to {gnss.bounds[1]:.3f}); "
            "check the noise figures of the rig and of the GNSS"
        )
    if reference is not None and reference.ratio > 1.5:
        told.append(
            f"the speed reference strays: the damping states scatter {reference.ratio:.1f} times "
            "as expected in the mean square; check its noise, or it did not follow a maneuver"
        )
    return told


def _maneuvers(velocity: Array, block: float, start: float) -> list[str]:
    """Tell of stretches in which ten seconds' mean acceleration is too large for a cruise."""
    lag = max(1, round(10.0 / block))
    if velocity.shape[1] <= lag:
        return []
    gain = np.hypot(*(velocity[:, lag:] - velocity[:, :-lag])) / (lag * block)
    fast = np.flatnonzero(gain > _MANEUVER)
    if not fast.size:
        return []
    apart = np.flatnonzero(np.diff(fast) > 60.0 / block)
    first = fast[np.concatenate([[0], apart + 1])]
    places = ", ".join(f"{start + block * k:.0f} s" for k in first[:3])
    more = f" and {first.size - 3} more" if first.size > 3 else ""
    return [
        f"maneuver during the run, from {places}{more}: up to {gain.max():.2g} m/s^2; the drift "
        "estimates overshoot where the speed reference does not follow"
    ]


def _gaps(epochs: NDArray[np.int64], block: float, start: float) -> list[str]:
    """Tell of stretches without GNSS that are longer than three times the usual spacing."""
    there = np.flatnonzero(epochs)
    if not there.size:
        return ["no GNSS epoch in the filter's run: nothing was measured"]
    edges = np.concatenate([[-1], there, [len(epochs)]])
    spacing = np.diff(edges)
    usual = float(np.median(np.diff(there))) if there.size > 1 else 1.0
    gaps = np.flatnonzero(spacing > max(3.0 * usual, 10.0 / block))
    if not gaps.size:
        return []
    places = ", ".join(
        f"{start + block * (edges[k] + 1):.0f} s ({block * (spacing[k] - 1):.0f} s)"
        for k in gaps[:3]
    )
    more = f" and {gaps.size - 3} more" if gaps.size > 3 else ""
    return [f"GNSS reference missing from {places}{more}"]


def expected_bias(latitude: float, scale: float, installation: float) -> float:
    """Return the error (rad/s) of the drift along the axis that other errors leave behind.

    scale: factor error of the axis' gyro; installation: rad, of its input axis. It reads
    `scale W sin L` too much of the Earth's rate along the axis and `installation W cos L` across.
    """
    W = earth.EARTH_RATE
    return float(W * (abs(scale * np.sin(latitude)) + abs(installation * np.cos(latitude))))


def mean_bounds(degrees: int, count: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the two-sided bounds of the mean of `count` chi-squared values of `degrees`."""
    from scipy.special import gammaincinv

    tail = 0.5 * (1.0 - confidence)
    low, high = (2.0 * gammaincinv(0.5 * degrees * count, p) for p in (tail, 1.0 - tail))
    return float(low / count), float(high / count)
