"""Rotation cycles of a single-axis rotation INS: turns and stops about the vertical.

Source: the SRINS level-damping paper ("S"): one turn clockwise, a stop, one counter-clockwise, a
stop. Because all stops are at the same angle, the fraction dwell / (dwell + turn) of a
horizontal drift is unmodulated; stops at 0 and 180 deg modulate it completely.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.units import FloatArray


@dataclass(frozen=True)
class RotationScheme:
    """A rotation scheme. rate: rad/s; dwell: s at each stop.

    kind: `one-stop`, the paper's 360 deg clockwise, stop, back, stop; `two-stop`, half turns with
    stops at 0 and 180 deg, a full turn clockwise and one back; `still`.
    """

    rate: float = float(np.radians(6.0))
    dwell: float = 60.0
    kind: str = "one-stop"

    @property
    def phases(self) -> tuple[tuple[float, float], ...]:
        """The cycle as (rate rad/s about up, duration s)."""
        if self.kind == "still" or self.rate == 0.0:
            return ((0.0, 60.0),)
        parts = 1 if self.kind == "one-stop" else 2
        turn = 2.0 * np.pi / abs(self.rate) / parts
        cycle: list[tuple[float, float]] = []
        for sense in (-1.0, 1.0):  # clockwise seen from above comes first
            for _ in range(parts):
                cycle += [(sense * self.rate, turn), (0.0, self.dwell)]
        return tuple(phase for phase in cycle if phase[1] > 0.0)

    @property
    def period(self) -> float:
        """Length of the cycle, s."""
        return sum(duration for _, duration in self.phases)

    def angle(self, time: FloatArray) -> FloatArray:
        """Return the angle about up (rad), 0 at time 0, at times (s) from 0 on.

        >>> RotationScheme().angle(np.array([0.0, 15.0, 90.0, 135.0, 240.0])) / np.pi
        array([ 0. , -0.5, -2. , -1.5,  0. ])
        """
        rates, durations = np.array(self.phases).T
        knots = np.concatenate([[0.0], np.cumsum(durations)])
        angles = np.concatenate([[0.0], np.cumsum(rates * durations)])
        angles[-1] = 0.0  # the cycle closes
        result: FloatArray = np.interp(np.asarray(time) % knots[-1], knots, angles)
        return result
