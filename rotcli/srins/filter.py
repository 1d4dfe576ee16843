"""The 16-state filter of a single-axis rotation INS against GNSS: its linear model and passes.

Open loop, about a mechanization's solution: the gains do not depend on the readings, so many runs
share one gain pass. A step of some seconds measures the mean of the GNSS epochs within it, with
the measurement matrix of that mean. The navigation computer knows the damping states exactly:
used as measurements they exclude the errors of the speed reference from the estimates.
Source: the SRINS level-damping paper ("S"), restated in `rotcli.srins.model`.
"""

from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from rotcli import units
from rotcli.dataclass import dataclass
from rotcli.models import earth
from rotcli.models.kalman import update
from rotcli.srins import model as srins
from rotcli.srins.model import Damping, VehicleMotion
from rotcli.units import FloatArray

ARCSEC = units.UNITS["angle"]["arcsec"]
MICRO_G = units.UNITS["acceleration"]["ug"]
_STATES = len(srins.LAYOUT)
# The sensors' constant errors; the dynamics of the other states are integrated.
_SENSORS = range(srins.GYRO_BIAS.start, srins.ACCEL_BIAS.stop)
_DYNAMIC = [k for k in range(_STATES) if k not in _SENSORS]
# Resolution of the motion for which one F is used: rate rad/s, velocity m/s, acceleration m/s^2,
# latitude rad. Smaller differences change F by less than 1e-4 of itself.
_F_RESOLUTION = np.array([1e-3, 0.1, 0.1, 1e-3, 1e-3, 1e-4])
_CHUNK_STEPS = 500  # steps whose blocks are in memory at the same time: 4 MB
_DAMPING_STATE_SIGMA = 1e-6  # m/s, of the measured damping states: the computer knows them exactly


@dataclass(frozen=True)
class FilterSettings:
    """Settings of the filter, SI; by default the paper's sensors and published initial sigmas.

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

    def initial_sigma(self, latitude: float) -> FloatArray:
        """Return the initial sigmas (16,) of the states."""
        R_M, R_N = earth.radii(latitude)
        position = [self.position / R_M, self.position / (R_N * np.cos(latitude))]
        sigma = np.empty(_STATES)
        sigma[srins.VELOCITY], sigma[srins.POSITION] = self.velocity, position
        sigma[srins.ATTITUDE] = self.tilt, self.tilt, self.azimuth
        sigma[srins.GYRO_BIAS], sigma[srins.ACCEL_BIAS] = self.gyro_bias, self.accel_bias
        sigma[srins.DAMPING] = self.damping_state
        return sigma

    def process_noise(self) -> FloatArray:
        """Return the noise density (16, 16), states squared per second."""
        white = np.zeros(_STATES)
        white[srins.VELOCITY], white[srins.ATTITUDE] = self.accel_white, self.gyro_white
        G = srins.reference_input(self.damping)
        return np.diag(np.square(white)) + self.reference_white**2 * G @ G.T

    def measurement_noise(self, latitude: float) -> FloatArray:
        """Return the variances (4 or 8,) of one GNSS epoch and of the measured damping states."""
        R_M, R_N = earth.radii(latitude)
        p = self.gnss_position
        sigma = [self.gnss_velocity] * 2 + [p / R_M, p / (R_N * np.cos(latitude))]
        return np.square(sigma + [_DAMPING_STATE_SIGMA] * 4 * self.measured_damping)


@dataclass(frozen=True, eq=False)
class FilterModel:
    """The filter's linear model: Phi and Q (m, 16, 16), H (m, p, 16), R (m, p) of each step.

    used: (m, p) bool, False where there is no measurement.
    """

    Phi: FloatArray
    H: FloatArray
    R: FloatArray
    Q: FloatArray
    used: NDArray[np.bool_]


def build_filter_model(
    theta: FloatArray,
    velocity: FloatArray,
    latitude: FloatArray,
    block: float,
    settings: FilterSettings,
    epochs: NDArray[np.int64],
) -> FilterModel:
    """Return the model of each filter step from the motion in its blocks.

    theta: (n + 1,) rad, velocity: (2, n + 1), latitude: (n + 1,) at the edges of n blocks of
    `block` s, n a multiple of the blocks in a step. epochs: (n,) GNSS epochs at each block's end.
    Within a block F is constant if the sensor errors are those in n.
    """
    per_step = round(settings.interval / block)
    steps = len(epochs) // per_step
    middle = 0.5 * (velocity[:, 1:] + velocity[:, :-1])
    keys = np.stack(
        [
            np.diff(theta) / block,
            *middle,
            *(np.diff(velocity, axis=1) / block),
            0.5 * (latitude[1:] + latitude[:-1]),
        ]
    )
    cells = np.round(keys[:, : steps * per_step].T / _F_RESOLUTION).astype(np.int64)
    kinds, index = np.unique(cells, axis=0, return_inverse=True)
    F = np.array(
        [
            srins.srins_error_dynamics_n(VehicleMotion(L, ve, vn, ae, an), settings.damping, rate)
            for rate, ve, vn, ae, an, L in kinds * _F_RESOLUTION
        ]
    )
    index = index.reshape(steps, per_step)
    start = theta[: steps * per_step].reshape(steps, per_step)
    n_epochs = epochs[: steps * per_step].reshape(steps, per_step)
    total = n_epochs.sum(axis=1)
    share = n_epochs / np.maximum(total, 1)[:, None]
    exponentials = srins.transition_matrix(F, block), srins.transition_matrix(F, -block)
    noise = block * settings.process_noise()
    # Steps of one motion, such as those of a cruise whose rotation repeats, are composed once.
    motions = np.column_stack([index, start, share])
    _, first, again = np.unique(motions, axis=0, return_index=True, return_inverse=True)
    parts = [
        _compose_blocks(exponentials, index[part], start[part], share[part], noise)
        for part in (first[k : k + _CHUNK_STEPS] for k in range(0, len(first), _CHUNK_STEPS))
    ]
    again = again.reshape(-1)
    Phi, Q, H = (np.concatenate(group)[again] for group in zip(*parts, strict=True))
    variances = settings.measurement_noise(float(latitude.mean()))
    R = np.tile(variances, (steps, 1))
    R[:, :4] /= np.maximum(total, 1)[:, None]
    used = np.ones(R.shape, dtype=bool)
    used[:, :4] = (total > 0)[:, None]
    if settings.measured_damping:
        states = srins.measurement_matrix(damping_states=True)[4:]
        H = np.concatenate([H, np.tile(states, (steps, 1, 1))], axis=1)
    return FilterModel(Phi, H, R, Q, used)


def _compose_blocks(
    exponentials: tuple[FloatArray, FloatArray],
    index: NDArray[np.int64],
    theta: FloatArray,
    share: FloatArray,
    noise: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return Phi, Q (m, 16, 16) and H (m, 4, 16) of steps from their blocks.

    exponentials: of each kind of block, forward and backward in time, sensor errors in n. index:
    (m, blocks) kind; theta: angle at the start; share: of the epochs at the end, alike.
    """
    forward, backward = exponentials
    m, per_step = index.shape
    dynamic = np.ix_(range(m), _DYNAMIC, _DYNAMIC)
    sensors = np.ix_(range(m), _DYNAMIC, _SENSORS)
    one = np.tile(np.eye(_STATES), (m, 1, 1))
    Phi, Q, inverses = one.copy(), np.zeros_like(one), []
    for j in range(per_step):
        # Back to s, where the sensor errors do not change, at both ends of the block.
        F_s = forward[index[:, j]] @ srins.sensor_errors_to_n(theta[:, j])
        block_Phi, inverse = one.copy(), one.copy()
        block_Phi[dynamic], block_Phi[sensors] = F_s[dynamic], F_s[sensors]
        inverse[dynamic] = backward[index[:, j]][dynamic]
        inverse[sensors] = -inverse[dynamic] @ F_s[sensors]
        Phi = block_Phi @ Phi
        Q = block_Phi @ (Q + 0.5 * noise) @ block_Phi.swapaxes(1, 2) + 0.5 * noise
        inverses.append(inverse)
    H_epoch = np.tile(srins.measurement_matrix(damping_states=False), (m, 1, 1))
    H = share[:, -1, None, None] * H_epoch
    for j in range(per_step - 1, 0, -1):
        H_epoch = H_epoch @ inverses[j]
        H += share[:, j - 1, None, None] * H_epoch
    return Phi, Q, H


@dataclass(frozen=True, eq=False)
class GainSequence:
    """Gains K (m, 16, p), innovation covariances S (m, p, p), sigma (m, 16) after each step."""

    K: FloatArray
    S: FloatArray
    sigma: FloatArray
    covariance: FloatArray


def gain_sequence(model: FilterModel, P0: FloatArray) -> GainSequence:
    """Run the covariance recursion from P0 (16, 16) over the steps; it needs no readings."""
    m, p, states = model.H.shape
    K, S, sigma = np.empty((m, states, p)), np.empty((m, p, p)), np.empty((m, states))
    P = P0
    for k in range(m):
        P = model.Phi[k] @ P @ model.Phi[k].T + model.Q[k]
        K[k], S[k], P = update(P, model.H[k], np.diag(model.R[k]))
        P = 0.5 * (P + P.T)
        sigma[k] = np.sqrt(np.diag(P))
    return GainSequence(K, S, sigma, P)


def run_filter(
    model: FilterModel, gains: GainSequence, z: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the estimates (m, 16, ...) and innovations (m, p, ...) of measurements (m, p, ...)."""
    estimates = np.empty((len(z), _STATES, *z.shape[2:]))
    innovations = np.empty_like(z)
    x = np.zeros((_STATES, *z.shape[2:]))
    for k in range(len(z)):
        x = model.Phi[k] @ x
        innovations[k] = z[k] - model.H[k] @ x
        x = x + gains.K[k] @ innovations[k]
        estimates[k] = x
    return estimates, innovations
