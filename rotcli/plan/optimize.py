"""Choose candidates that maximize the determinant of the information (D-optimal design).

Greedy by gain of log det per second, then exchanges: drop what loses least per second, add what
gains most, as long as the determinant grows. Source of the criterion: Atkinson, Donev and Tobias,
Optimum Experimental Designs, with SAS (2007), chapters 9 to 12.
"""

from collections.abc import Sequence

import numpy as np

from rotcli.plan.candidates import Candidate
from rotcli.units import FloatArray

MAX_EXCHANGES = 20  # the determinant stops growing after some 10
_BATCH = 12  # candidates whose gain is computed at once


def log_det(information: FloatArray) -> float:
    """Return log det of a symmetric positive definite matrix."""
    return float(np.linalg.slogdet(information)[1])


def _gains(total: FloatArray, stack: FloatArray, sign: float) -> FloatArray:
    """Return the change of log det when each matrix of a stack (c, p, p) is added or dropped."""
    return np.asarray(np.linalg.slogdet(total + sign * stack)[1] - np.linalg.slogdet(total)[1])


class Design:
    """A multiset of candidates within a time, and its information."""

    def __init__(self, candidates: Sequence[Candidate], prior: FloatArray, budget: float) -> None:
        """Begin with the prior (p, p) alone; budget: s."""
        self.stack = np.array([c.information for c in candidates])
        self.cost = np.array([c.cost for c in candidates])
        self.budget = budget
        self.total = prior.copy()
        self.chosen: list[int] = []
        self._bound = np.full(len(candidates), np.inf)

    @property
    def spent(self) -> float:
        """Time of all chosen candidates, s."""
        return float(self.cost[self.chosen].sum()) if self.chosen else 0.0

    def _best(self, room: float) -> int | None:
        """Return the fitting candidate with the largest gain per second.

        A gain never grows when others are added (log det is submodular): the gains of earlier
        steps are upper bounds, so only the most promising candidates are computed again.
        """
        fits = np.flatnonzero(self.cost <= room)
        if len(fits) == 0:
            return None
        fresh = np.zeros(len(self.cost), dtype=bool)
        while True:
            top = fits[np.argsort(-self._bound[fits], kind="stable")[:_BATCH]]
            if fresh[top[0]]:
                return int(top[0])
            stale = top[~fresh[top]]
            self._bound[stale] = _gains(self.total, self.stack[stale], 1.0) / self.cost[stale]
            fresh[stale] = True

    def _add(self, k: int) -> None:
        self.total = self.total + self.stack[k]
        self.chosen.append(k)

    def fill(self) -> None:
        """Add the best candidate per second until the time is used."""
        while (k := self._best(self.budget - self.spent)) is not None:
            self._add(k)

    def drop(self) -> int:
        """Remove the chosen candidate that loses least per second, and return it."""
        distinct = sorted(set(self.chosen))
        loss = -_gains(self.total, self.stack[distinct], -1.0) / self.cost[distinct]
        k = distinct[int(np.argmin(loss))]
        self.chosen.remove(k)
        self._bound[:] = np.inf
        self.total = self.total - self.stack[k]
        return k

    def exchange(self) -> None:
        """Drop and fill while the determinant grows."""
        for _ in range(MAX_EXCHANGES):
            before = log_det(self.total), self.total, list(self.chosen)
            self.drop()
            self.fill()
            if log_det(self.total) <= before[0] + 1e-6:
                self.total, self.chosen = before[1], before[2]
                return


def optimize(candidates: Sequence[Candidate], prior: FloatArray, budget: float) -> list[Candidate]:
    """Return the candidates (with repeats) of a D-optimal plan within `budget` seconds."""
    design = Design(candidates, prior, budget)
    design.fill()
    design.exchange()
    return [candidates[k] for k in design.chosen]
