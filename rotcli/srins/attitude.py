"""True attitude errors of a mechanized voyage whose vehicle is level, from its true heading."""

import numpy as np

from rotcli.logs.record import TableLog
from rotcli.models import rotation
from rotcli.srins.navigate import SrinsRun
from rotcli.units import FloatArray


def attitude_errors(run: SrinsRun, table: TableLog, azimuth: float) -> FloatArray:
    """Return phi (3, n + 1), rad, east, north, up, at the edges of the blocks.

    `C_hat = (I - [phi x]) C` with the true C_ns: level, rotated about up by the table angle less
    the vehicle's azimuth (rad, clockwise from north).
    """
    half = 0.5 * (np.interp(run.time, table.time, table.angle) - azimuth)
    zero = np.zeros_like(half)
    q_sn = np.stack([np.cos(half), zero, zero, -np.sin(half)])
    q = rotation.multiply(run.solution.q_ns, q_sn)
    small = -2.0 * q[1:] * np.where(q[0] < 0.0, -1.0, 1.0)  # rotation vectors of 1e-2 rad at most
    return np.asarray(small)
