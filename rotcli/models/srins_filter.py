"""The 16-state filter of a single-axis rotation INS against GNSS: its linear model and passes.

Open loop, about a mechanization's solution: the gains do not depend on the readings, so many runs
share one gain pass. A step of some seconds measures the mean of the GNSS epochs within it, with
the measurement matrix of that mean. The damping states are known to the navigation computer;
measured, they keep the reference's errors out of the estimates.
Source: the SRINS level-damping paper ("S"), restated in `rotcli.models.srins`.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rotcli import units
from rotcli.models import earth, srins
from rotcli.models.kalman import update
from rotcli.models.srins import Damping, Motion

Array = NDArray[np.float64]

ARCSEC = units.UNITS["angle"]["arcsec"]
MICRO_G = units.UNITS["acceleration"]["ug"]
# The states whose dynamics are integrated; the other five are the sensors' constant errors.
_MOVING = [*range(7), *range(12, 16)]
# What F is told apart by: rad/s, m/s, m/s^2, rad. Finer differences change it below 1e-4.
_GRAIN = np.array([1e-3, 0.1, 0.1, 1e-3, 1e-3, 1e-4])
_AT_ONCE = 500  # steps whose blocks are held at once
_KNOWN = 1e-6  # m/s, to which the measured damping states are taken as known


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
    index = index.reshape(steps, per)
    start = theta[: steps * per].reshape(steps, per)
    n_epochs = epochs[: steps * per].reshape(steps, per)
    total = n_epochs.sum(axis=1)
    share = n_epochs / np.maximum(total, 1)[:, None]
    exponentials = srins.transition(F, block), srins.transition(F, -block)
    noise = block * settings.process_noise()
    parts = [
        _through_blocks(exponentials, index[part], start[part], share[part], noise)
        for part in (slice(k, k + _AT_ONCE) for k in range(0, steps, _AT_ONCE))
    ]
    Phi, Q, H = (np.concatenate(group) for group in zip(*parts, strict=True))
    variances = settings.measurement_noise(float(latitude.mean()))
    R = np.tile(variances, (steps, 1))
    R[:, :4] /= np.maximum(total, 1)[:, None]
    used = np.ones(R.shape, dtype=bool)
    used[:, :4] = (total > 0)[:, None]
    if settings.measured_damping:
        states = srins.measurement_matrix(damping_states=True)[4:]
        H = np.concatenate([H, np.tile(states, (steps, 1, 1))], axis=1)
    return Steps(Phi, H, R, Q, used)


def _through_blocks(
    exponentials: tuple[Array, Array],
    index: NDArray[np.int64],
    theta: Array,
    share: Array,
    noise: Array,
) -> tuple[Array, Array, Array]:
    """Return Phi, Q (m, 16, 16) and H (m, 4, 16) of steps from their blocks.

    exponentials: of each kind of block, forward and backward in time, sensor errors in n. index:
    (m, per) kind; theta: (m, per) angle at the start; share: (m, per) of the epochs at the end.
    """
    forward, backward = exponentials
    m, per = index.shape
    moving = np.ix_(range(m), _MOVING, _MOVING)
    sensors = np.ix_(range(m), _MOVING, range(7, 12))
    Phi, Q, inverses = np.tile(np.eye(16), (m, 1, 1)), np.zeros((m, 16, 16)), []
    for j in range(per):
        # Back to s, where the sensor errors do not change, at both ends of the block.
        turned = forward[index[:, j]] @ srins.turn_to_n(theta[:, j])
        block_Phi, inverse = (np.tile(np.eye(16), (m, 1, 1)) for _ in range(2))
        block_Phi[moving], block_Phi[sensors] = turned[moving], turned[sensors]
        inverse[moving] = backward[index[:, j]][moving]
        inverse[sensors] = -inverse[moving] @ turned[sensors]
        Phi = block_Phi @ Phi
        Q = block_Phi @ (Q + 0.5 * noise) @ block_Phi.swapaxes(1, 2) + 0.5 * noise
        inverses.append(inverse)
    H_epoch = np.tile(srins.measurement_matrix(damping_states=False), (m, 1, 1))
    H = share[:, -1, None, None] * H_epoch
    for j in range(per - 1, 0, -1):
        H_epoch = H_epoch @ inverses[j]
        H += share[:, j - 1, None, None] * H_epoch
    return Phi, Q, H


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
        K[k], S[k], P = update(P, steps.H[k], np.diag(steps.R[k]))
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
