"""Find where the innovations of a filter are locally too large: the log is disturbed there."""

from dataclasses import dataclass

import numpy as np

from rotcli.units import FloatArray

WINDOW = 5.0  # s
MIN_UPDATES = 10  # per window
_START = 10.0  # s: the filter converges, the innovations depend on the initial sigmas
# Normal quantile of 1e-9: in a day of windows of 5 s, one false alarm in 50,000 logs.
_QUANTILE = 6.0
# Innovations are not white where biases follow another model than a random walk.
_MARGIN = 1.5


@dataclass(frozen=True)
class Disturbance:
    """The window with the largest innovations: time (s) of its middle from the start of the run.

    ratio: mean NIS of the window over the median of all windows; limit: of that ratio.
    """

    time: float
    ratio: float
    limit: float


class InnovationWindows:
    """Means of NIS over windows of a run whose updates come chunk by chunk."""

    def __init__(self, tau: float) -> None:
        self._tau = tau
        self._size = max(MIN_UPDATES, round(WINDOW / tau))
        self._rest: FloatArray = np.zeros(0)
        self._means: list[FloatArray] = []

    def add(self, nis: FloatArray) -> None:
        """Add the NIS (n,) of the updates that follow."""
        nis = np.concatenate([self._rest, nis])
        count = len(nis) // self._size
        self._means.append(nis[: count * self._size].reshape(count, self._size).mean(axis=1))
        self._rest = nis[count * self._size :].copy()

    def largest(self) -> Disturbance | None:
        """Return the window of the largest innovations, if they are significantly too large."""
        means = np.concatenate(self._means) if self._means else np.zeros(0)
        first = int(np.ceil(_START / (self._size * self._tau)))
        if len(means) < first + 4:
            return None
        used = means[first:]
        ratio = used / np.median(used)
        # Quantile of chi-squared over its mean (Wilson and Hilferty, PNAS 17 (1931)).
        c = 2.0 / (9.0 * 3 * self._size)
        limit = _MARGIN * float((1.0 - c + _QUANTILE * np.sqrt(c)) ** 3)
        worst = int(np.argmax(ratio))
        if ratio[worst] <= limit:
            return None
        middle = (first + worst + 0.5) * self._size * self._tau
        return Disturbance(float(middle), float(ratio[worst]), limit)
