"""Scale factor and installation errors in the conventions of other programs.

Kalibr, OpenVINS and PSINS fix the sensor frame by the accelerometers: the accelerometer matrix is
lower triangular, and the gyro matrix refers to the same frame (`I + M = L Q`, LQ decomposition).
Kalibr's scale-misalignment model then splits the gyro matrix into a lower triangular matrix and a
rotation, `I + N = M C` (Rehder et al., ICRA 2016).
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.export.figures import SensorFigures
from rotcli.units import FloatArray


@dataclass(frozen=True, eq=False)
class Intrinsics:
    """Matrices (3, 3) that map true values in the accelerometer frame to readings.

    gyro = gyro_lower @ gyro_rotation; accel is lower triangular; g_sensitivity in rad/s per m/s^2.
    accel_known: whether the accelerometer matrix was measured (else it is the identity).
    """

    gyro: FloatArray
    gyro_lower: FloatArray
    gyro_rotation: FloatArray
    accel: FloatArray
    g_sensitivity: FloatArray
    accel_known: bool


def lower_times_rotation(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (L, Q) with matrix = L Q, L lower triangular with positive diagonal, det Q = +1.

    Check: a lower triangular matrix with positive diagonal returns itself and the identity.
    """
    q, r = np.linalg.qr(matrix.T)
    sign = np.sign(np.diag(r))
    return (r.T * sign), (q * sign).T


def intrinsics(figures: SensorFigures) -> Intrinsics | None:
    """Return the intrinsics, or None unless all nine elements of N are known."""
    if not np.isfinite(figures.gyro_matrix).all():
        return None
    known = bool(np.isfinite(figures.accel_matrix).all())
    lower = np.isfinite(figures.accel_matrix[np.tril_indices(3)]).all()
    elements = np.where(np.isfinite(figures.accel_matrix), figures.accel_matrix, 0.0)
    accel, Q = lower_times_rotation(np.eye(3) + elements) if known or lower else (np.eye(3),) * 2
    gyro = (np.eye(3) + figures.gyro_matrix) @ Q.T
    gyro_lower, rotation = lower_times_rotation(gyro)
    sensitivity = np.where(np.isfinite(figures.g_sensitivity), figures.g_sensitivity, 0.0) @ Q.T
    return Intrinsics(gyro, gyro_lower, rotation, accel, sensitivity, known or bool(lower))
