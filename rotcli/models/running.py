"""Root mean square, maximum and last value of errors that arrive chunk by chunk."""

import numpy as np

from rotcli.units import FloatArray


class RunningStatistics:
    """Statistics of the errors (n, k) so far.

    >>> errors = RunningStatistics()
    >>> errors.add(np.array([[3.0], [-4.0]]))
    >>> errors.add(np.array([[0.0], [0.0]]))
    >>> errors.rms, errors.max, errors.final
    (array([2.5]), array([4.]), array([0.]))
    """

    def __init__(self) -> None:
        self._count = 0
        self._squares: FloatArray = np.zeros(1)
        self.max: FloatArray = np.zeros(1)
        self.final: FloatArray = np.zeros(1)

    def add(self, errors: FloatArray) -> None:
        """Add the errors (n, k) of the next chunk."""
        self._count += len(errors)
        self._squares = self._squares + np.einsum("nk,nk->k", errors, errors)
        self.max = np.maximum(self.max, np.maximum(errors.max(axis=0), -errors.min(axis=0)))
        self.final = np.array(errors[-1])

    @property
    def rms(self) -> FloatArray:
        """Root mean square of each error, (k,)."""
        return np.asarray(np.sqrt(self._squares / self._count))
