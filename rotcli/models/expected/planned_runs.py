"""Expected RMS of R16's run before any test: per axis, mode and rate, and against time."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.expected.errors import ExpectedErrors
from rotcli.models.expected.motion import StillTable, TooManyBlocksError
from rotcli.models.expected.plan import (
    Mode,
    PlannedSensors,
    planned_errors,
    turned_about,
)
from rotcli.models.expected.statistics import MAX_JUDGED_TILT, validity_limits
from rotcli.models.rotation import UNIT_VECTORS
from rotcli.units import DEG, FloatArray

STILL = "still"
_RATES = np.array([10.0, 50.0, 100.0]) * DEG  # rad/s, the range of R16's ten rates
_SAME_RATE = 1e-6  # relative


@dataclass(frozen=True, eq=False)
class ExpectedRun:
    """Expected errors of one planned run; errors None where reason says why.

    rate: rad/s; rms: (11,) m, m/s, rad, NaN where the linear propagation does not hold; largest:
    the source with the largest part of the horizontal position's mean square.
    """

    axis: str
    mode: Mode
    rate: float
    rms: FloatArray | None
    largest: str
    reason: str
    errors: ExpectedErrors | None


@dataclass(frozen=True, eq=False)
class PlannedExpectation:
    """Expected RMS of all planned runs, or why there is none; duration: s."""

    runs: tuple[ExpectedRun, ...] = ()
    duration: float = 0.0
    reason: str = ""

    def without(self, mode: Mode, reason: str) -> "PlannedExpectation":
        """Return the same without the figures of a mode; reason: why they are not known."""
        runs = (
            replace(run, rms=None, largest="", reason=reason, errors=None)
            if run.mode == mode
            else run
            for run in self.runs
        )
        return replace(self, runs=tuple(runs))


def planned_expectation(
    sensors: PlannedSensors,
    table: StillTable,
    *,
    axes: Sequence[str],
    rate: float,
    duration: float,
    attitude_sigma: FloatArray | None = None,
) -> PlannedExpectation:
    """Return the expected RMS of conventional, partial and full navigation.

    axes: of the body; rate: rad/s, of the planned run; 10, 50 and 100 deg/s come with it.
    """
    other = [one for one in _RATES if abs(one - abs(rate)) > _SAME_RATE * abs(rate)]
    rates = sorted([abs(rate), *other])
    runs = [_run(sensors, table, STILL, "conventional", 0.0, duration, attitude_sigma)]
    modes: tuple[Mode, ...] = ("partial", "full")
    for axis in axes:
        about = turned_about(table, np.array(UNIT_VECTORS[axis]))
        for mode in modes:
            for one in rates:
                runs.append(_run(sensors, about, axis, mode, one, duration, attitude_sigma))
    return PlannedExpectation(tuple(runs), duration)


def _run(
    sensors: PlannedSensors,
    table: StillTable,
    axis: str,
    mode: Mode,
    rate: float,
    duration: float,
    attitude_sigma: FloatArray | None,
) -> ExpectedRun:
    """Return one planned run."""
    try:
        errors = planned_errors(sensors, table, mode, rate, duration, attitude_sigma)
    except TooManyBlocksError as error:
        return ExpectedRun(axis, mode, rate, None, "", f"too long: {error}", None)
    limits = validity_limits(errors)
    rms = np.where([bool(limit) for limit in limits], np.nan, errors.rms)
    reason = next((limit for limit in limits if limit), "")
    if errors.tilt > MAX_JUDGED_TILT:
        reason = reason or f"the computed frame tilts by {errors.tilt / DEG:.0f} deg: approximate"
    horizontal = {name: float(part[0] + part[1]) for name, part in errors.parts.items()}
    return ExpectedRun(
        axis, mode, rate, rms, max(horizontal, key=horizontal.__getitem__), reason, errors
    )
