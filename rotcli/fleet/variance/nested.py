"""Rows of one parameter sorted by unit and day, and sums in which effects are integrated out.

The model is `y = mu + U_unit + D_day + R_turn-on + eps`, with variances vU, vD, vR and known s^2
of eps. For each day `a = sum 1/v, b = sum y/v, q = sum y^2/v, l = sum ln v` with v = s^2 + vR
contain all that the likelihood needs. An effect of variance t shared by all rows of such a sum is
integrated out exactly by `collapse` (matrix determinant lemma and Woodbury identity), so the
likelihood of n rows costs O(n).
"""

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

IntArray = NDArray[np.int64]

COMPONENTS = ("unit", "day", "turn_on")
_MAX_FILL = 2.0  # places of a table of days per row; above it sums over neighbours are faster
_MAX_EXPONENT = 280.0  # decimal, of the product of a day's variances over their mean


@dataclass(frozen=True, eq=False)
class NestedRows:
    """Rows (n,) sorted by unit, day and time; y is centred, `centre` was subtracted.

    day_start: (d,) first row of each day; unit_start: (u,) first day of each unit; units: labels
    (u,) in the order of the sums; order: (n,) index of each sorted row in the input.
    """

    y: FloatArray
    s2: FloatArray
    centre: float
    day_start: IntArray
    unit_start: IntArray
    units: NDArray[np.generic]
    order: IntArray

    @property
    def days_per_unit(self) -> IntArray:
        """Number of days (u,) of each unit."""
        return np.diff(np.append(self.unit_start, len(self.day_start)))

    @property
    def rows_per_day(self) -> IntArray:
        """Number of rows (d,) of each day."""
        return np.diff(np.append(self.day_start, len(self.y)))

    @property
    def rows_per_unit(self) -> IntArray:
        """Number of rows (u,) of each unit."""
        first = np.append(self.day_start, len(self.y))
        return np.diff(np.append(first[self.unit_start], len(self.y)))

    @cached_property
    def by_day(self) -> "DayTable | None":
        """The rows with a column for each day, or None where that would be mostly empty."""
        return _day_table(self)

    def day_of_row(self) -> IntArray:
        """Return the index (n,) of the day of each row."""
        return np.repeat(np.arange(len(self.day_start)), self.rows_per_day)

    def unit_of_day(self) -> IntArray:
        """Return the index (d,) of the unit of each day."""
        return np.repeat(np.arange(len(self.unit_start)), self.days_per_unit)

    def without(self, flagged: NDArray[np.bool_]) -> "NestedRows":
        """Return the rows of the units (u,) that are not flagged."""
        unit = self.unit_of_day()[self.day_of_row()]
        keep = ~flagged[unit]
        day = self.day_of_row()[keep]
        return nest(self.y[keep] + self.centre, self.s2[keep] ** 0.5, unit[keep], day)


def nest(
    y: FloatArray,
    sigma: FloatArray,
    unit: NDArray[np.generic],
    day: NDArray[np.generic],
    time: FloatArray | None = None,
) -> NestedRows:
    """Sort rows (n,) by unit, day and time; y is centred against cancellation.

    Days are those within a unit: the same day label in two units is two days.
    """
    units, unit_index = np.unique(unit, return_inverse=True)
    _, day_index = np.unique(day, return_inverse=True)
    last = np.arange(len(y)) if time is None else time
    order = np.lexsort((last, day_index, unit_index))
    u, d = unit_index[order], day_index[order]
    new_unit = np.append(True, u[1:] != u[:-1])
    new_day = new_unit | np.append(True, d[1:] != d[:-1])
    day_start = np.flatnonzero(new_day)
    unit_start = np.flatnonzero(new_unit[day_start])
    centre = float(np.mean(y))
    return NestedRows(
        y=y[order] - centre,
        s2=sigma[order] ** 2,
        centre=centre,
        day_start=day_start.astype(np.int64),
        unit_start=unit_start.astype(np.int64),
        units=units,
        order=order.astype(np.int64),
    )


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums a, b, q, l over the rows of k groups, (k,) each, and their derivatives.

    slopes: of a, b, q, l with respect to vU, vD, vR, (3, k) each; of days without vU, on which
    they do not depend, (2, k). None when they were not requested.
    """

    a: FloatArray
    b: FloatArray
    q: FloatArray
    l: FloatArray  # noqa: E741 (the letter of the design)
    slopes: tuple[FloatArray, FloatArray, FloatArray, FloatArray] | None = None

    def add(self, start: IntArray) -> "Sums":
        """Return the sums over neighbouring groups that begin at `start`."""

        def reduce(values: FloatArray) -> FloatArray:
            return np.add.reduceat(values, start, axis=-1)

        slopes = self.slopes
        return Sums(
            reduce(self.a),
            reduce(self.b),
            reduce(self.q),
            reduce(self.l),
            None
            if slopes is None
            else (reduce(slopes[0]), reduce(slopes[1]), reduce(slopes[2]), reduce(slopes[3])),
        )


@dataclass(frozen=True, eq=False)
class DayTable:
    """Rows of d days in columns: y, s^2 (m, d), present (m, d) 1 or 0, count (d,).

    Sums over the first index are an eighth of the time of sums over neighbours. Absent rows have
    the mean s^2, so that they leave a product of variances over their mean as it is.
    """

    y: FloatArray
    s2: FloatArray
    present: FloatArray
    count: FloatArray
    mean_s2: float


def _day_table(rows: NestedRows) -> DayTable | None:
    """Return the rows with a column for each day, None where it does not serve."""
    count = rows.rows_per_day
    m, d = int(count.max()), len(count)
    decades = m * math.log10(float(rows.s2.max() / rows.s2.min()))
    if m * d > _MAX_FILL * len(rows.y) or decades > _MAX_EXPONENT:
        return None
    place = np.arange(len(rows.y)) - rows.day_start[rows.day_of_row()], rows.day_of_row()
    mean_s2 = float(np.mean(rows.s2))
    y, s2, present = np.zeros((m, d)), np.full((m, d), mean_s2), np.zeros((m, d))
    y[place], s2[place], present[place] = rows.y, rows.s2, 1.0
    return DayTable(y, s2, present, count.astype(float), mean_s2)


def day_sums(rows: NestedRows, turn_on: float, *, slopes: bool = False) -> Sums:
    """Return the sums of each day (d,) for the variance vR of a turn-on."""
    table = rows.by_day
    if table is None:
        w = 1.0 / (rows.s2 + turn_on)
        wy = w * rows.y
        sums = Sums(w, wy, wy * rows.y, -np.log(w)).add(rows.day_start)
        by_turn_on = Sums(-w * w, -w * wy, -wy * wy, w).add(rows.day_start) if slopes else None
    else:
        v, mean = table.s2 + turn_on, table.mean_s2 + turn_on
        w = table.present / v
        wy = w * table.y
        a = w.sum(axis=0)
        log = np.log((v * (1.0 / mean)).prod(axis=0)) + table.count * math.log(mean)
        sums = Sums(a, wy.sum(axis=0), (wy * table.y).sum(axis=0), log)
        by_turn_on = None
        if slopes:
            squares = (w * w).sum(axis=0), (w * wy).sum(axis=0), (wy * wy).sum(axis=0)
            by_turn_on = Sums(-squares[0], -squares[1], -squares[2], a)
    if by_turn_on is None:
        return sums

    def only_turn_on(values: FloatArray) -> FloatArray:
        return np.stack([np.zeros_like(values), values])

    d = by_turn_on
    slope = (only_turn_on(d.a), only_turn_on(d.b), only_turn_on(d.q), only_turn_on(d.l))
    return Sums(sums.a, sums.b, sums.q, sums.l, slope)


def collapse(sums: Sums, t: float) -> Sums:
    """Return the sums with an effect of variance t, one per group, integrated out.

    t is the component of the first row of the slopes. Check: t = 0 changes nothing.
    """
    a, b = sums.a, sums.b
    inverse = 1.0 / (1.0 + t * a)
    shrunk = b * inverse  # b / g
    slopes = None
    if sums.slopes is not None:
        da, db, dq, dl = sums.slopes
        square = inverse * inverse
        ratio = t * shrunk
        slopes = (
            da * square,
            db * inverse - (ratio * inverse) * da,
            dq - 2.0 * ratio * db + (ratio * ratio) * da,
            dl + (t * inverse) * da,
        )
        # By t itself: g grows by a.
        slopes[0][0] -= a * a * square
        slopes[1][0] -= a * shrunk * inverse
        slopes[2][0] -= shrunk * shrunk
        slopes[3][0] += a * inverse
    g = 1.0 + t * a
    return Sums(a * inverse, shrunk, sums.q - t * b * shrunk, sums.l + np.log(g), slopes)


def unit_sums(rows: NestedRows, day: float, turn_on: float, *, slopes: bool = False) -> Sums:
    """Return the sums of each unit (u,) with days and turn-ons integrated out."""
    sums = collapse(day_sums(rows, turn_on, slopes=slopes), day).add(rows.unit_start)
    if sums.slopes is None:
        return sums

    def with_unit(values: FloatArray) -> FloatArray:
        return np.concatenate([np.zeros((1, values.shape[1])), values])

    da, db, dq, dl = sums.slopes
    widened = (with_unit(da), with_unit(db), with_unit(dq), with_unit(dl))
    return Sums(sums.a, sums.b, sums.q, sums.l, widened)
