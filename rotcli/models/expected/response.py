"""Responses of the navigation errors of a window to a sensor error of each block.

An increment of the error states is carried back to the window's start; sums over the blocks are
carried to the coarse times and become the reported errors.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models import earth
from rotcli.models.expected.motion import (
    ATTITUDE,
    VELOCITY,
    Blocks,
    Nominal,
    StillTable,
    Transition,
    nominal_motion,
    output_rows,
    transitions,
)
from rotcli.units import FloatArray


@dataclass(frozen=True, eq=False)
class ResponseFrame:
    """Motion, transitions and the responses of the states to a sensor error of each block.

    outputs: (M, 11, 9), from states carried back to the start to the outputs at t_m, then
    eps_E and eps_N for the second order; gyro, accel: (n, 9, 3), W_j of the module's sources.
    """

    table: StillTable
    blocks: Blocks
    nominal: Nominal
    transition: Transition
    outputs: FloatArray
    gyro: FloatArray
    accel: FloatArray

    def integrate(self, increments: FloatArray) -> FloatArray:
        """Return outputs (M, 11, ...) of per-block increments (n, 9, ...) of carried states."""
        M, r = self.blocks.coarse, self.blocks.fine
        steps = increments.reshape(M, r, 9, -1).sum(axis=1)
        result = self.outputs @ np.cumsum(steps, axis=0)
        return np.asarray(result.reshape(M, 11, *increments.shape[2:]))


def response_frame(table: StillTable, blocks: Blocks, column: FloatArray) -> ResponseFrame:
    """Return the frame of a run whose mode leaves in the axis column (3,)."""
    nominal = nominal_motion(table, blocks, column)
    transition = transitions(table, blocks, nominal)
    C = nominal.C_ns
    J = blocks.length / 6.0 * (C[:-1:2] + 4.0 * C[1::2] + C[2::2])  # Simpson, (n, 3, 3)
    D = output_rows(nominal.pitch[1:], nominal.azimuth[1:])
    to_eps = np.zeros((len(D), 2, 9))
    to_eps[:, 0, 6] = to_eps[:, 1, 7] = 1.0
    outputs = np.concatenate([D, to_eps], axis=1) @ transition.from_start[1:]
    gyro = transition.to_start[:, :, ATTITUDE] @ J
    accel = transition.to_start[:, :, VELOCITY] @ J
    if table.hold_height:
        accel[:, [2, 5]] = 0.0
    return ResponseFrame(table, blocks, nominal, transition, outputs, gyro, accel)


def nominal_mean(frame: ResponseFrame) -> FloatArray:
    """Return the mean outputs (M, 11) of an axis column that the mode leaves in.

    The nominal frame turns off the true one by Q: Earth rate and gravity are compensated along
    wrong axes, `eps' = (Q - I) w_ie`, `dv' = (Q - I)(0, 0, g)`; the attitude error of the nominal
    itself is added to the outputs.
    """
    table, h = frame.table, frame.blocks.length
    wrong = frame.nominal.Q - np.eye(3)
    to_start = frame.transition.to_start
    force = wrong @ np.array([0.0, 0.0, table.gravity])
    turn = wrong @ earth.earth_rate_n(table.latitude)
    if table.hold_height:
        force = force * [1.0, 1.0, 0.0]
    increments = to_start[:, :, VELOCITY] @ force[..., None]
    increments = increments + to_start[:, :, ATTITUDE] @ turn[..., None]
    mean = frame.integrate(h * increments)[..., 0]
    mean[:, 6:9] += frame.nominal.offset[1:]
    return mean
