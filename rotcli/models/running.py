"""Root mean square, greatest and last of errors that come part by part."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class RunningErrors:
    """The figures of errors (n, k) so far.

    >>> seen = RunningErrors()
    >>> seen.add(np.array([[3.0], [-4.0]]))
    >>> seen.add(np.array([[0.0], [0.0]]))
    >>> seen.rms, seen.greatest, seen.final
    (array([2.5]), array([4.]), array([0.]))
    """

    def __init__(self) -> None:
        self._count = 0
        self._squares: Array = np.zeros(1)
        self.greatest: Array = np.zeros(1)
        self.final: Array = np.zeros(1)

    def add(self, errors: Array) -> None:
        """Take the errors (n, k) of the part that follows."""
        self._count += len(errors)
        self._squares = self._squares + np.sum(errors**2, axis=0)
        self.greatest = np.maximum(self.greatest, np.max(np.abs(errors), axis=0))
        self.final = np.array(errors[-1])

    @property
    def rms(self) -> Array:
        """Root mean square of each error, (k,)."""
        return np.asarray(np.sqrt(self._squares / self._count))
