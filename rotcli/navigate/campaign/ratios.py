"""Campaign of navigation results against their expected errors, and the mean corrected output.

Ratio: observed over expected RMS. The pooled test of the runs of one device and mode is Fisher's:
-2 sum ln p of n independent p values is chi-squared with 2n degrees of freedom; its chance of a
larger value is small where the runs are worse than expected, its complement where they are better.
Runs of one log in several modes are not independent: modes are pooled apart.
"""

import math
from collections.abc import Sequence

from rotcli.dataclass import dataclass
from rotcli.files.published import cited, set_up
from rotcli.files.published import published as published_values
from rotcli.files.results.groups import Source, device_label
from rotcli.files.tables import Cell, Column, Table, drop_empty_columns

HORIZONTAL = "horizontal_m"
_MIN_RUNS = 2  # pooling one run says nothing new
_SMALLEST_P = 1e-300
_STILL = 0.05  # deg/s; a slower table is still


@dataclass(frozen=True)
class RunRatio:
    """Observed over expected horizontal position RMS of one run.

    band: ratio that 999 of 1000 clean runs stay below; median: the one that half of them stay
    below; p_value: chance of a larger RMS, None where not judged. rate: deg/s.
    """

    imu: str
    axis: str
    mode: str
    rate: float
    ratio: float
    median: float
    band: float
    p_value: float | None


def run_ratios(sources: Sequence[Source]) -> list[RunRatio]:
    """Return the ratios of all runs that have an expected horizontal position."""
    found = []
    for source in sources:
        expected = source.number_or_none("expected", HORIZONTAL, "rms")
        if not expected:
            continue
        median = source.number_or_none("expected", HORIZONTAL, "median")
        band = source.number_or_none("expected", HORIZONTAL, "q999")
        found.append(
            RunRatio(
                imu=source.imu,
                axis=source.axis,
                mode=str(source.doc.get("mode")),
                rate=source.number("rate", "value"),
                ratio=source.number("rms", HORIZONTAL) / expected,
                median=(median or math.nan) / expected,
                band=(band or math.nan) / expected,
                p_value=source.number_or_none("expected", HORIZONTAL, "p_value"),
            )
        )
    return found


def pooled_p(p_values: Sequence[float]) -> float:
    """Return the chance that n independent p values are together as small as these (Fisher).

    >>> round(pooled_p([0.5, 0.5]), 4)
    0.5966
    """
    half = -sum(math.log(max(p, _SMALLEST_P)) for p in p_values)
    term = total = math.exp(-half)
    for k in range(1, len(p_values)):
        term *= half / k
        total += term
    return min(1.0, total)


def ratio_tables(sources: Sequence[Source]) -> list[Table]:
    """Return observed over expected per device and mode, and the pooled test of the runs."""
    ratios = run_ratios(sources)
    rows: list[tuple[Cell, ...]] = []
    for imu, axis, mode in sorted({(r.imu, r.axis, r.mode) for r in ratios}):
        runs = [r for r in ratios if (r.imu, r.axis, r.mode) == (imu, axis, mode)]
        if len(runs) < _MIN_RUNS:
            continue
        values = sorted(r.ratio for r in runs)
        judged = [r.p_value for r in runs if r.p_value is not None]
        square = sum(v * v for v in values) / len(values)
        rows.append(
            (
                device_label(imu, axis),
                mode,
                len(runs),
                math.sqrt(square),
                values[len(values) // 2],
                values[-1],
                sum(r.ratio > r.band for r in runs),
                sum(p < 0.05 for p in judged),
                pooled_p(judged) if judged else None,
            )
        )
    if not rows:
        return []
    columns = (
        Column("IMU"),
        Column("mode"),
        Column("runs", "d"),
        Column("RMS ratio", ".2f"),
        Column("median", ".2f"),
        Column("max", ".2f"),
        Column("above 99.9 % band", "d"),
        Column("p below 0.05", "d"),
        Column("pooled p", ".3g"),
    )
    note = (
        "Ratio: observed over expected RMS of the horizontal position of each run; of clean runs "
        "the root mean square is 1, the median 0.84. Pooled p (Fisher): chance that clean runs "
        "are together as far from zero; below 0.001 they are worse than expected, above 0.999 "
        "better."
    )
    return [Table("Observed over expected, horizontal position", columns, rows, note)]


def mean_output_tables(sources: Sequence[Source], *, published: bool = False) -> list[Table]:
    """Return the mean corrected gyro output over the navigation (R16 table 7), turning runs."""
    rows: list[tuple[Cell, ...]] = []
    bounds = set_up()
    for source in sorted(sources, key=_order):
        if abs(source.number("rate", "value")) < _STILL or source.doc.get("mode") != "full":
            continue
        values = mean_output(source)
        if values is None:
            continue
        sigma = source.number_or_none("mean_after", "x", "sigma")
        rate = source.number("rate", "value")
        label = device_label(source.imu, source.axis)
        limits: tuple[Cell, ...] = (None, None, None)
        if published and published_values(source.imu) is not None:
            inside = "yes" if within_published_bound(values, source.axis) else "no"
            limits = (bounds.across_dps, bounds.along_dps, inside)
        p_value = source.number_or_none("mean_p_value")
        rows.append((label, rate, *values, sigma, p_value, *limits))
    if not rows:
        return []
    columns = (
        Column("IMU"),
        Column("rate, deg/s", ".4g"),
        *(Column(f"{axis}, deg/s", ".4f") for axis in "xyz"),
        Column("sigma, deg/s", ".4f"),
        Column("p", ".2g"),
        Column("published across, deg/s", ".3f"),
        Column("published along, deg/s", ".3f"),
        Column("in bound"),
    )
    note = "Mean of the corrected gyros over the navigation less Earth rate and table rate."
    if any(row[-1] for row in rows):
        note += (
            " Published: the largest magnitudes across and along the rotation axis. The sigma is "
            "that of the noise; a bound of one sigma is exceeded by some of ten runs."
        )
    title = cited("Mean gyro output over the navigation", "R16 table 7", published)
    return [drop_empty_columns(title, columns, rows, note)]


def mean_output(source: Source) -> tuple[float, float, float] | None:
    """Return the mean corrected gyro output (x, y, z), deg/s, of a navigation, if known."""
    x, y, z = (source.number_or_none("mean_after", axis, "value") for axis in "xyz")
    return None if x is None or y is None or z is None else (x, y, z)


def within_published_bound(values: Sequence[float], axis: str) -> bool:
    """Return whether a mean output (x, y, z), deg/s, is within R16's bounds for an axis."""
    bounds = set_up()
    limits = (bounds.along_dps if name == axis else bounds.across_dps for name in "xyz")
    return all(abs(value) <= limit for value, limit in zip(values, limits, strict=True))


def _order(source: Source) -> tuple[str, str, float, str]:
    return source.imu.casefold(), source.axis, source.number("rate", "value"), source.path
