"""A single-axis rotation INS with level damping: its damping network and linear error dynamics.

The vehicle is level (V_up = 0); its IMU rotates by theta about up, right-handed; at theta = 0 the
sensor axes point east, north, up. Errors are INS minus truth, `C_hat = (I - [phi x]) C`,
gyro = w + eps, accelerometer = f + nabla. The 16 states are `STATES`; the sensor errors eps and
nabla are constant in the sensor frame s.

Level damping: `V_d = V_ref + H(s) (V - V_ref)` drives transport rate and position, V is the
undamped integrator and V_ref the velocity of a Doppler log. The small derivatives of the Earth's
radii with latitude are left out of F.
Source: the level-damped SRINS calibration paper ("S"), its unreadable equations restated; the
nonlinear system behind it is `rotcli.srins.level_ins`.
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models import earth
from rotcli.models.states import StateLayout
from rotcli.units import FloatArray

LAYOUT = StateLayout(
    VELOCITY=("dV_E", "dV_N"),
    ATTITUDE=("phi_E", "phi_N", "phi_U"),
    POSITION=("d_latitude", "d_longitude"),
    GYRO_BIAS=("gyro_bias_x", "gyro_bias_y", "gyro_bias_z"),
    ACCEL_BIAS=("accel_bias_x", "accel_bias_y"),
    DAMPING=("u1", "u2", "u3", "u4"),
)
STATES = LAYOUT.names
VELOCITY, ATTITUDE, POSITION = LAYOUT.VELOCITY, LAYOUT.ATTITUDE, LAYOUT.POSITION
GYRO_BIAS, ACCEL_BIAS, DAMPING = LAYOUT.GYRO_BIAS, LAYOUT.ACCEL_BIAS, LAYOUT.DAMPING
GYRO_BIAS_Z = LAYOUT.index("gyro_bias_z")
SENSOR_ERRORS = (*STATES[GYRO_BIAS], *STATES[ACCEL_BIAS])
# The damping states of east and of north.
DAMPING_EAST = slice(DAMPING.start, DAMPING.start + 2)
DAMPING_NORTH = slice(DAMPING.start + 2, DAMPING.stop)
_SENSORS = LAYOUT.span("GYRO_BIAS", "ACCEL_BIAS")
_FORCED = LAYOUT.span("VELOCITY", "ATTITUDE")  # the states that sensor errors drive directly
_V_E, _V_N, _PHI_E, _PHI_N, _PHI_U, _LAT, _LON = range(VELOCITY.start, POSITION.stop)


@dataclass(frozen=True)
class Damping:
    """The network `H(s) = (s + w1)(s + w4) / ((s + w2)(s + w3))`, rad/s; enabled: K1, 1 or 0.

    As states: `u1' = -w2 u1 + (w1 - w2) e`, `u2' = -w3 u2 + (w4 - w3) (e + u1)` with
    e = V - V_ref, and `V_d = V + K1 (u1 + u2)`.
    """

    w1: float = 8.5e-4
    w2: float = 8.0e-3
    w3: float = 1.0e-2
    w4: float = 9.412e-2
    enabled: float = 1.0

    @property
    def state_matrix(self) -> FloatArray:
        """Matrix (2, 2) of u' = state_matrix u + input_vector e."""
        return np.array([[-self.w2, 0.0], [self.w4 - self.w3, -self.w3]])

    @property
    def input_vector(self) -> FloatArray:
        """Vector (2,) of u' = state_matrix u + input_vector e."""
        return np.array([self.w1 - self.w2, self.w4 - self.w3])

    def gain(self, s: complex) -> complex:
        """Return H(s).

        >>> round(Damping().gain(0.0), 6)
        1.000025
        """
        return (s + self.w1) * (s + self.w4) / ((s + self.w2) * (s + self.w3))


def damped_poles(damping: Damping, schuler_squared: float) -> NDArray[np.complex128]:
    """Return the poles (4,), rad/s, of the damped level loop; schuler_squared is g/R, 1/s^2.

    Roots of `s^2 (s + w2)(s + w3) + ws^2 (s + w1)(s + w4)`.
    """
    d = damping
    denominator = np.polymul([1.0, d.w2], [1.0, d.w3])
    numerator = np.polymul([1.0, d.w1], [1.0, d.w4])
    poles = np.roots(np.polyadd(np.append(denominator, [0.0, 0.0]), schuler_squared * numerator))
    return np.sort_complex(poles.astype(complex))


@dataclass(frozen=True)
class VehicleMotion:
    """Motion of the vehicle: latitude rad; velocity m/s, acceleration m/s^2, east and north."""

    latitude: float
    v_east: float = 0.0
    v_north: float = 0.0
    a_east: float = 0.0
    a_north: float = 0.0


def srins_error_dynamics(motion: VehicleMotion, damping: Damping, theta: float) -> FloatArray:
    """Return F (16, 16), x' = F x of `STATES` in SI units, at the IMU's angle theta (rad)."""
    F = _navigation_dynamics(motion, damping)
    F[_FORCED, _SENSORS] = _sensor_coupling(theta)
    return F


def srins_error_dynamics_n(motion: VehicleMotion, damping: Damping, rate: float) -> FloatArray:
    """Return F (16, 16) with the sensor errors in n; it is constant for a constant rate (rad/s).

    `[eps_E, eps_N]` and `[nabla_E, nabla_N]` then rotate with the IMU: eps_E' = -rate eps_N.
    """
    F = srins_error_dynamics(motion, damping, 0.0)
    for first in (GYRO_BIAS.start, ACCEL_BIAS.start):
        F[first, first + 1], F[first + 1, first] = -rate, rate
    return F


def sensor_errors_to_n(theta: FloatArray) -> FloatArray:
    """Return T (..., 16, 16): states with sensor errors in s to states with them in n."""
    c, s = np.cos(theta), np.sin(theta)
    T = np.zeros((*np.shape(theta), len(LAYOUT), len(LAYOUT)))
    T[...] = np.eye(len(LAYOUT))
    for first in (GYRO_BIAS.start, ACCEL_BIAS.start):
        T[..., first, first] = T[..., first + 1, first + 1] = c
        T[..., first, first + 1], T[..., first + 1, first] = -s, s
    return T


def _sensor_coupling(theta: float) -> FloatArray:
    """Return how eps_x..z, nabla_x,y (columns) drive dV and phi (rows), (5, 5)."""
    c, s = np.cos(theta), np.sin(theta)
    return np.array(
        [
            [0.0, 0.0, 0.0, c, -s],
            [0.0, 0.0, 0.0, s, c],
            [-c, s, 0.0, 0.0, 0.0],
            [-s, -c, 0.0, 0.0, 0.0],
            [0.0, 0.0, -1.0, 0.0, 0.0],
        ]
    )


def _navigation_dynamics(motion: VehicleMotion, damping: Damping) -> FloatArray:
    """Return F without the columns of the sensor errors (S, (7) restated)."""
    L, Vx, Vy = motion.latitude, motion.v_east, motion.v_north
    s, c, t = np.sin(L), np.cos(L), np.tan(L)
    W, K1 = earth.EARTH_RATE, damping.enabled
    R_M, R_N = (float(r) for r in earth.radii(L))
    w = 2.0 * W * s + Vx * t / R_N
    fx, fy = motion.a_east - w * Vy, motion.a_north + w * Vx
    g = float(earth.normal_gravity(L, 0.0))
    fz = g - (2.0 * W * c + Vx / R_N) * Vx - Vy**2 / R_M
    wx, wy, wz = -Vy / R_M, W * c + Vx / R_N, W * s + Vx * t / R_N
    curve = Vx / (c**2 * R_N)
    F = np.zeros((len(LAYOUT), len(LAYOUT)))
    F[_V_E, : _LAT + 1] = [Vy * t / R_N, w, 0.0, -fz, fy, (2.0 * W * c + curve) * Vy]
    south = -2.0 * (W * s + Vx * t / R_N)
    F[_V_N, : _LAT + 1] = [south, 0.0, fz, 0.0, -fx, -(2.0 * W * c + curve) * Vx]
    F[_PHI_E, _V_N], F[_PHI_E, [_PHI_N, _PHI_U]] = -1.0 / R_M, [wz, -wy]
    F[_PHI_N, _V_E], F[_PHI_N, [_PHI_E, _PHI_U, _LAT]] = 1.0 / R_N, [-wz, wx, -W * s]
    F[_PHI_U, _V_E], F[_PHI_U, [_PHI_E, _PHI_N, _LAT]] = t / R_N, [wy, -wx, W * c + curve]
    F[_LAT, _V_N] = 1.0 / R_M
    F[_LON, _V_E], F[_LON, _LAT] = 1.0 / (c * R_N), Vx * t / (c * R_N)
    # The damped velocity, not V, drives transport rate and position.
    F[_PHI_E, DAMPING_NORTH], F[_LAT, DAMPING_NORTH] = -K1 / R_M, K1 / R_M
    F[_PHI_N : _PHI_U + 1, DAMPING_EAST] = K1 * np.array([[1.0 / R_N], [t / R_N]])
    F[_LON, DAMPING_EAST] = K1 / (c * R_N)
    for network, velocity in ((DAMPING_EAST, _V_E), (DAMPING_NORTH, _V_N)):
        F[network, network] = damping.state_matrix
        F[network, velocity] = damping.input_vector
    return F


def reference_input(damping: Damping) -> FloatArray:
    """Return G (16, 2), the input matrix of an error of V_ref (east, north): x' = F x + G dV."""
    G = np.zeros((len(LAYOUT), 2))
    G[DAMPING_EAST, 0] = G[DAMPING_NORTH, 1] = -damping.input_vector
    return G


def measurement_matrix(*, damping_states: bool) -> FloatArray:
    """Return H (4 or 8, 16): `[dV_E, dV_N, d_latitude, d_longitude]`, then u1 to u4 if measured."""
    groups = [VELOCITY, POSITION, *([DAMPING] if damping_states else [])]
    one = np.eye(len(LAYOUT))
    return np.concatenate([one[group] for group in groups])


def stripped_observability_matrix(F: FloatArray, H: FloatArray) -> FloatArray:
    """Return the stripped observability matrix `[H; H F; ...; H F^15]`, SI units."""
    rows = [H]
    for _ in range(F.shape[0] - 1):
        rows.append(rows[-1] @ F)
    return np.concatenate(rows)


def transition_matrix(F: FloatArray, dt: float) -> FloatArray:
    """Return exp(F dt) of many F (..., m, m) at once, by scaled Taylor series.

    The series runs to the 12th power on F dt scaled below 1/4 in the largest row sum of the
    balanced matrix: a remainder below 1e-17.
    """
    scale = _balance(F.shape[-1])
    A = F * dt * scale[None, :] / scale[:, None]
    largest = float(np.max(np.sum(np.abs(A), axis=-1), initial=0.0))
    squarings = max(0, int(np.ceil(np.log2(max(largest, 1e-300) / 0.25))))
    A = A / 2.0**squarings
    unit = np.eye(F.shape[-1])
    E = unit + A / 12.0
    for k in range(11, 0, -1):
        E = unit + A @ E / k
    for _ in range(squarings):
        E = E @ E
    result: FloatArray = E * scale[:, None] / scale[None, :]
    return result


def _balance(states: int) -> FloatArray:
    """Return the usual sizes of the states as powers of two, so that F dt is well scaled."""
    sizes = np.ones(states)
    if states == len(LAYOUT):
        sizes[ATTITUDE] = sizes[POSITION] = 2.0**-12
        sizes[GYRO_BIAS] = 2.0**-20
        sizes[ACCEL_BIAS] = 2.0**-8
    return sizes
