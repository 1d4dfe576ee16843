"""The growth of navigation errors to first order in the sensor errors, to judge the nonlinear one.

It shares no code with the strapdown kernel: `psi' = -w_ie x psi + C_ns (d + N w_is_s)`,
`eps = psi - (-p_N/R_M, p_E/R_N, p_E tan L/R_N)`, `v' = eps x f - 2 w_ie x v + (0, 0, 2g/R p_U) +
C_ns b`, `p' = v` (psi: the attitude error against the frame of the computed position).
"""

import numpy as np
from scipy.linalg import expm

from rotcli.budget.estimate import ACCEL_BIAS, error_in_n, period
from rotcli.models import earth, rotation

NODES = 24


def linear_growth(source, bias, matrix, base, u, rate, duration, nodes=NODES):
    """Return attitude, velocity and position errors, each (3,) in n, after `duration` (s)."""
    driven = slice(3, 6) if source == ACCEL_BIAS else slice(0, 3)
    F = dynamics(base)
    x, weight = np.polynomial.legendre.leggauss(nodes)

    def gain(span):
        """Return the transition over `span` and what it adds; every turn starts alike."""
        ahead = expm(F * (0.5 * span * (1.0 - x))[:, None, None])
        errors = error_in_n(bias, matrix, base, u, rate, 0.5 * span * (x + 1.0))
        added = (ahead[:, :, driven] @ errors[:, :, None])[:, :, 0]
        return expm(F * span), 0.5 * span * weight @ added

    turn = period(rate) if rate else duration
    turns = int(duration / turn + 1e-9)
    state = np.zeros(9)
    for _ in range(turns):
        transition, added = gain(turn)
        state = transition @ state + added
    rest = duration - turns * turn
    if rest > 1e-9 * turn:
        transition, added = gain(rest)
        state = transition @ state + added
    psi, v, p = state.reshape(3, 3)
    return psi - turned_by_position(base) @ p, v, p


def turned_by_position(base):
    """Return the matrix (3, 3) from a displacement (m) in n to the rotation of n (rad)."""
    R_M, R_N = (float(radius) for radius in earth.radii(base.latitude))
    tan = float(np.tan(base.latitude))
    return np.array([[0.0, -1.0 / R_M, 0.0], [1.0 / R_N, 0.0, 0.0], [tan / R_N, 0.0, 0.0]])


def dynamics(base):
    """Return F (9, 9) of the states psi, v, p."""
    w_ie, force = rotation.skew(base.w_ie_n), -rotation.skew(np.array([0.0, 0.0, base.gravity]))
    F = np.zeros((9, 9))
    F[:3, :3] = -w_ie
    F[3:6, :3] = force
    F[3:6, 3:6] = -2.0 * w_ie
    F[3:6, 6:] = -force @ turned_by_position(base)
    F[5, 8] = 2.0 * base.gravity / earth.SEMI_MAJOR_AXIS
    F[6:, 3:6] = np.eye(3)
    return F
