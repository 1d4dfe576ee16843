"""Navigation results of a campaign: RMS errors for each device, mode and rate, and their means.

They are the tables of R16 (Sensors 2016, 16, 2017): conventional RMS (tables 4, 5), RMS for each
rate and mode (figures 8, 9, 11, 12). Each table appears when the results support it, without the
columns that have no value; published values appear on request.
"""

from collections.abc import Sequence

from rotcli.errors import ResultError
from rotcli.files.captions import is_still_rate
from rotcli.files.published import cited, set_up
from rotcli.files.published import published as published_values
from rotcli.files.results.groups import (
    MODES,
    UNCALIBRATED,
    Group,
    Run,
    Source,
    device_label,
    grouped,
    mean,
    ratio,
)
from rotcli.files.tables import Cell, Column, Table, drop_empty_columns, has_value
from rotcli.lazy import lazily
from rotcli.navigate import document
from rotcli.navigate.campaign.errors import error_tables, level_tables
from rotcli.navigate.campaign.ratios import mean_output_tables, ratio_tables

with lazily():
    from rotcli.navigate.campaign import published as published_means


FIGURES = (*document.KEYS, "horizontal_m", "horizontal_mps")
_UNITS = {"m": "m", "mps": "m/s", "deg": "deg"}
_DURATION_SHARE = 0.05  # RMS of windows that differ by more are not compared
_EXPECTED_NOTE = (
    "Expected: root mean square over many runs of these noise figures; the mean of their RMS is "
    "0.8 of it (one axis) or 0.88 (horizontal). "
)
_GAIN = "Gain: conventional / this, of the horizontal position. "
IMU, RATE, RUNS = Column("IMU"), Column("rate, deg/s", ".4g"), Column("runs", "d")


def navigation_runs(sources: Sequence[Source]) -> list[Run]:
    """Return navigation results as runs; raises ResultError where figures are missing."""
    return [_navigation_run(source) for source in sources]


def _navigation_run(source: Source) -> Run:
    mode = source.doc.get("mode")
    if mode not in MODES:
        raise ResultError(f"{source.path}: mode: {mode!r} is none of {', '.join(MODES)}")
    rate = source.number("rate", "value")
    if mode == "conventional" and not is_still_rate(rate):
        mode = UNCALIBRATED
    return Run(
        path=source.path,
        imu=source.imu,
        # Standing still has no axis: one conventional level for every axis of an IMU.
        axis="z" if mode == "conventional" else source.axis,
        mode=mode,
        rate=rate,
        values={
            **{name: source.number("rms", name) for name in FIGURES},
            **{_expected(name): source.number_or_none("expected", name, "rms") for name in FIGURES},
        },
        duration=source.number("duration_s"),
    )


def _expected(name: str) -> str:
    """Return the key of the expected RMS of a figure."""
    return f"expected_{name}"


def conventional_runs(runs: Sequence[Run], imu: str) -> list[Run]:
    """Return the conventional runs of an IMU."""
    return [run for run in runs if run.imu == imu and run.mode == "conventional"]


def groups_of_device(groups: Sequence[Group], imu: str, axis: str, mode: str) -> list[Group]:
    """Return the groups of one unit and mode, one for each rate, in the order of the rates."""
    return [g for g in groups if (g.imu, g.axis, g.mode) == (imu, axis, mode)]


def navigation_tables(sources: Sequence[Source], *, published: bool = False) -> list[Table]:
    """Return the tables of navigation results; published: with the values of R16 next to ours."""
    runs = navigation_runs(sources)
    if len(sources) == 1:
        return [*_conventional(runs, published), *document.tables([sources[0].doc])]
    groups = grouped(runs)
    tables = [*_means(runs, groups, published), *_conventional(runs, published)]
    tables += [_rates(runs, groups, published), *error_tables(groups, published=published)]
    tables += [*level_tables(groups), *_azimuth_growth(groups), *ratio_tables(sources)]
    tables += mean_output_tables(sources, published=published)
    return [*tables, *(_published_means(groups) if published else ())]


def _published_means(groups: Sequence[Group]) -> list[Table]:
    """Return the published means next to their expectation, for IMUs navigated at R16's rates."""
    rates: dict[str, set[float]] = {}
    for group in groups:
        if group.mode != "conventional" and group.axis == set_up().axis:
            rates.setdefault(group.imu, set()).add(round(abs(group.rate)))
    imus = [
        imu
        for imu, members in rates.items()
        if len(members) >= set_up().rates and published_values(imu)
    ]
    if not imus:
        return []
    return published_means.published_tables(imus)


def comparable_windows(runs: Sequence[Run]) -> bool:
    """Return whether all windows are about as long as each other."""
    durations = [run.duration for run in runs]
    return max(durations) - min(durations) <= _DURATION_SHARE * max(durations)


def _comparable(runs: Sequence[Run]) -> bool:
    """Return whether the windows are as long as the published ones."""
    wanted = set_up().duration_s
    return all(abs(run.duration - wanted) <= _DURATION_SHARE * wanted for run in runs)


def published_rms(imu: str, axis: str, mode: str, name: str) -> float | None:
    """Return the published RMS of an IMU and mode, or None."""
    paper = published_values(imu) if axis == set_up().axis else None
    return paper.rms.get(mode, {}).get(name) if paper else None


def _durations(runs: Sequence[Run], published: bool) -> str:
    """Return a sentence on the length of the windows."""
    least, most = min(r.duration for r in runs), max(r.duration for r in runs)
    if comparable_windows(runs):
        text = f"Navigation time {most:.0f} s."
    else:
        text = f"Navigation times of {least:.0f} to {most:.0f} s are mixed: RMS grows with time."
    if published and not _comparable(runs) and any(published_values(r.imu) for r in runs):
        wanted = set_up().duration_s
        text += f" Published values are for {wanted:.0f} s; no ratio where the time is another."
    return text


def _conventional(runs: Sequence[Run], published: bool) -> list[Table]:
    """R16 tables 4 and 5: conventional RMS, mean over the runs, and the published run."""
    groups: dict[str, list[Run]] = {}
    for group in grouped([run for run in runs if run.mode == "conventional"]):
        groups.setdefault(group.imu, []).extend(group.runs)
    rows: list[tuple[Cell, ...]] = []
    for imu, members in groups.items():
        for name in FIGURES:
            values = [value for run in members if (value := run.values[name]) is not None]
            ours = mean(values)
            paper = published_rms(imu, set_up().axis, "conventional", name) if published else None
            several = len(values) > 1
            rows.append(
                (
                    imu,
                    figure_name(name),
                    len(values),
                    ours,
                    mean([run.values[_expected(name)] for run in members]),
                    min(values) if several else None,
                    max(values) if several else None,
                    paper,
                    ratio(ours, paper) if _comparable(members) else None,
                )
            )
    if not rows:
        return []
    columns = (
        IMU,
        Column("error"),
        RUNS,
        Column("RMS", ".2f"),
        Column("expected", ".2f"),
        Column("min", ".2f"),
        Column("max", ".2f"),
        Column("published", ".2f"),
        Column("ratio", ".2f"),
    )
    papers = [(imu, published_values(imu)) for imu in groups] if published else []
    sources = [f"{imu} {paper.source}" for imu, paper in papers if paper]
    note = (
        "RMS: mean, min and max of the runs. "
        + (_EXPECTED_NOTE if has_value(rows, 4) else "")
        + (f"Published: one run of one unit ({', '.join(sources)}). " if sources else "")
        + _durations([run for members in groups.values() for run in members], published)
    )
    title = cited("Conventional navigation, RMS errors", "R16 tables 4, 5", published)
    return [drop_empty_columns(title, columns, rows, note)]


def figure_name(key: str) -> str:
    """Return the name and unit of an error as a table shows it.

    >>> figure_name("v_north_mps"), figure_name("horizontal_mps"), figure_name("horizontal_m")
    ('v north, m/s', 'horizontal velocity, m/s', 'horizontal position, m')
    """
    name, unit = key.rsplit("_", 1)
    kind = {"m": " position", "mps": " velocity"}[unit] if name == "horizontal" else ""
    return f"{name.replace('_', ' ')}{kind}, {_UNITS[unit]}"


def _rates(runs: Sequence[Run], groups: Sequence[Group], published: bool) -> Table:
    """R16 figures 8, 9, 11, 12: RMS of each mode and rate."""
    rows: list[tuple[Cell, ...]] = []
    for group in groups:
        still = mean([run.values["horizontal_m"] for run in conventional_runs(runs, group.imu)])
        ours = group.mean("horizontal_m")
        rows.append(
            (
                group.label,
                group.mode,
                group.rate if group.mode != "conventional" else 0.0,
                len(group.runs),
                ours,
                group.mean(_expected("horizontal_m")),
                group.mean("horizontal_mps"),
                group.mean("azimuth_deg"),
                ratio(still, ours) if group.mode != "conventional" else None,
            )
        )
    columns = (
        IMU,
        Column("mode"),
        RATE,
        RUNS,
        Column("horizontal position, m", ".1f"),
        Column("expected, m", ".1f"),
        Column("horizontal velocity, m/s", ".2f"),
        Column("azimuth, deg", ".3f"),
        Column("gain", ".2f"),
    )
    note = "Mean over the runs of a rate. " + (_EXPECTED_NOTE if has_value(rows, 5) else "")
    note += _GAIN if has_value(rows, -1) else ""
    source = "R16 figures 8, 9, 11, 12"
    title = cited("RMS errors for each mode and rate", source, published)
    return drop_empty_columns(title, columns, rows, note + _durations(runs, published))


def _means(runs: Sequence[Run], groups: Sequence[Group], published: bool) -> list[Table]:
    """Return the campaign means of horizontal position and velocity next to the published ones."""
    units = dict.fromkeys((g.imu, g.axis, g.mode) for g in groups)
    rows: list[tuple[Cell, ...]] = []
    for imu, axis, mode in units:
        by_rate = groups_of_device(groups, imu, axis, mode)
        members = [run for group in by_rate for run in group.runs]
        cells: list[Cell] = []
        for name in ("horizontal_m", "horizontal_mps"):
            ours = mean([group.mean(name) for group in by_rate])
            paper = published_rms(imu, axis, mode, name) if published else None
            due = mean([group.mean(_expected(name)) for group in by_rate])
            cells += [ours, due, paper, ratio(ours, paper) if _comparable(members) else None]
        still = mean([run.values["horizontal_m"] for run in conventional_runs(runs, imu)])
        rates = None if mode == "conventional" else len(by_rate)
        better = None if mode == "conventional" else ratio(still, mean_position(by_rate))
        rows.append((device_label(imu, axis), mode, rates, len(members), *cells, better))
    if len(rows) < 2 and len(groups) < 2:
        return []
    columns = (
        IMU,
        Column("mode"),
        Column("rates", "d"),
        RUNS,
        Column("position, m", ".1f"),
        Column("expected, m", ".1f"),
        Column("published, m", ".1f"),
        Column("ratio", ".2f"),
        Column("velocity, m/s", ".2f"),
        Column("expected, m/s", ".2f"),
        Column("published, m/s", ".1f"),
        Column("ratio of velocities", ".2f"),
        Column("gain", ".2f"),
    )
    note = "Mean over the rates, each the mean of its runs. "
    note += _EXPECTED_NOTE if has_value(rows, 5) else ""
    note += (_GAIN if has_value(rows, -1) else "") + _durations(runs, published)
    if has_value(rows, 6):
        count = set_up().rates
        note += (
            f" Published: mean of {count} rates; conventional is one run, the root sum of squares "
            "of its two horizontal components. Ratio: ours / published."
        )
    title = cited("Horizontal RMS errors, campaign means", "R16 section 4.2", published)
    return [drop_empty_columns(title, columns, rows, note)]


def mean_position(groups: Sequence[Group]) -> float | None:
    """Return the mean over rates of the horizontal position RMS, m."""
    return mean([group.mean("horizontal_m") for group in groups])


def _azimuth_growth(groups: Sequence[Group]) -> list[Table]:
    """Return how the azimuth error depends on the rate: it grows where scale is not corrected."""
    rows: list[tuple[Cell, ...]] = []
    for imu, axis, mode in dict.fromkeys((g.imu, g.axis, g.mode) for g in groups):
        members = groups_of_device(groups, imu, axis, mode)
        if mode == "conventional" or len(members) < 3:
            continue
        rates = [abs(group.rate) for group in members]
        errors = [group.mean("azimuth_deg") or 0.0 for group in members]
        slope, correlation = _line(rates, errors)
        rows.append((device_label(imu, axis), mode, len(members), slope, correlation))
    if not rows:
        return []
    columns = (
        IMU,
        Column("mode"),
        Column("rates", "d"),
        Column("slope, deg per deg/s", ".4f"),
        Column("correlation", ".3f"),
    )
    note = (
        "Least-squares line through the azimuth RMS against the magnitude of the rate: a scale "
        "factor error left in makes it grow in proportion."
    )
    return [drop_empty_columns("Azimuth RMS against the table rate", columns, rows, note)]


def _line(x: Sequence[float], y: Sequence[float]) -> tuple[float, float | None]:
    """Return slope and correlation of the line through points.

    >>> _line([1.0, 2.0, 3.0], [2.0, 4.0, 6.0])
    (2.0, 1.0)
    """
    x0, y0 = sum(x) / len(x), sum(y) / len(y)
    xx = sum((a - x0) ** 2 for a in x)
    yy = sum((b - y0) ** 2 for b in y)
    xy = sum((a - x0) * (b - y0) for a, b in zip(x, y, strict=True))
    return (xy / xx if xx else 0.0), (xy / (xx * yy) ** 0.5 if xx and yy else None)
