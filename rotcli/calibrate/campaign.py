"""Calibration results of a campaign: parameters with their sigmas, noise, mean gyro output.

Calibration errors caused by noise and mean gyro output after calibration are tables 6 and 7 of
R16 (Sensors 2016, 16, 2017); its published values appear on request.
"""

from collections.abc import Mapping, Sequence

from rotcli.calibrate.document import definitions
from rotcli.files.published import Published, PublishedConditions, cited, set_up
from rotcli.files.published import published as published_values
from rotcli.files.results.groups import Group, Run, Source, device_label, grouped, mean
from rotcli.files.tables import Cell, Column, Estimate, Table, drop_empty_columns, has_value
from rotcli.files.tables.model import BY_SIGMA

IMU, RATE, RUNS = Column("IMU"), Column("rate, deg/s", ".4g"), Column("runs", "d")


def calibration_tables(sources: Sequence[Source], *, published: bool = False) -> list[Table]:
    """Return the tables of calibration results; published: with the values of R16 next to ours."""
    runs = calibration_runs(sources)
    groups = grouped(runs)
    noise = _noise(groups, published)
    return [*_parameters(runs), *noise, *_mean_after(runs, groups, published)]


def calibration_runs(sources: Sequence[Source]) -> list[Run]:
    """Return calibrations as runs.

    Values: each parameter, and `sigma NAME`; `predicted bias` (deg/h), `predicted scale` (ppm);
    `mean x` …, `across` and `along` (deg/s), the mean gyro output after correction across the
    axis, and along it less the rate.
    """
    return [_calibration_run(source) for source in sources]


def _calibration_run(source: Source) -> Run:
    rate = source.number("rate", "value")
    values: dict[str, float | None] = {}
    for name in source.section("parameters"):
        values[name] = source.number("parameters", name, "value")
        values[f"sigma {name}"] = source.number_or_none("parameters", name, "sigma")
    for name in ("bias", "scale"):
        values[f"predicted {name}"] = source.number_or_none("predicted_sigma", name, "value")
    after = {a: source.number_or_none("mean_after", a, "value") for a in "xyz"}
    values |= {f"mean {a}": value for a, value in after.items()}
    along = after.pop(source.axis, None)
    if along is not None:
        values["along"] = along - rate
        values["across"] = max(abs(value) for value in after.values() if value is not None)
    return Run(source.path, source.imu, source.axis, "", rate, values)


def parameter_names(run: Run) -> tuple[str, ...]:
    """Return the names of the parameters that a calibration estimated."""
    return tuple(name[6:] for name in run.values if name.startswith("sigma "))


def parameter_sets(runs: Sequence[Run]) -> dict[tuple[str, ...], list[Run]]:
    """Return the runs by the parameters they estimated; another axis gives other ones."""
    sets: dict[tuple[str, ...], list[Run]] = {}
    for group in grouped(runs):
        for run in group.runs:
            sets.setdefault(parameter_names(run), []).append(run)
    return sets


def _noise(groups: Sequence[Group], published: bool) -> list[Table]:
    """R16 table 6: our predicted and estimated sigmas next to the published ones."""
    rows: list[tuple[Cell, ...]] = []
    for group in groups:
        names = parameter_names(group.runs[0])
        biases = [f"sigma {name}" for name in names if name.startswith("bias_")]
        scale = f"sigma Kg{group.axis}"
        paper = _paper(group.imu, group.axis) if published else None
        rows.append(
            (
                group.label,
                group.rate,
                len(group.runs),
                group.mean("predicted bias"),
                mean([group.mean(name) for name in biases]),
                paper.bias_dph if paper else None,
                group.mean("predicted scale"),
                group.mean(scale),
                _at_rate(paper.scale_ppm, group.rate) if paper else None,
            )
        )
    if all(value is None for row in rows for value in row[3:]):
        return []
    columns = (
        IMU,
        RATE,
        RUNS,
        Column("bias predicted, deg/h", ".1f"),
        Column("bias estimated, deg/h", ".1f"),
        Column("bias published, deg/h", ".1f"),
        Column("scale predicted, ppm", ".1f"),
        Column("scale estimated, ppm", ".1f"),
        Column("scale published, ppm", ".1f"),
    )
    note = (
        f"1 sigma. {cited('Predicted: of white noise only', 'R16 eq. 35, 36', published)}. "
        "Estimated: of the least squares, which estimates bias (mean of the three gyros) and "
        "scale factor together; it contains bias instability."
    )
    title = cited("Calibration errors caused by noise", "R16 table 6", published)
    return [drop_empty_columns(title, columns, rows, note)]


def _paper(imu: str, axis: str) -> Published | None:
    return published_values(imu) if axis == set_up().axis else None


def _at_rate(values: Mapping[float, float], rate: float) -> float | None:
    near = [value for known, value in values.items() if abs(known - rate) <= 0.01 * known]
    return near[0] if near else None


def _mean_after(runs: Sequence[Run], groups: Sequence[Group], published: bool) -> list[Table]:
    """Return the mean gyro output of the turning segments after correction.

    R16 table 7 is that of the navigation; it is with the navigation results.
    """
    limits = set_up()
    rows: list[tuple[Cell, ...]] = []
    for group in groups:
        compared = published and _paper(group.imu, group.axis) is not None
        inside = sum(_inside(run, limits) for run in group.runs)
        rows.append(
            (
                group.label,
                group.rate,
                len(group.runs),
                *(group.mean(f"mean {a}") for a in "xyz"),
                group.mean("along"),
                f"{inside} of {len(group.runs)}" if compared else None,
            )
        )
    if all(value is None for row in rows for value in row[3:7]):
        return []
    columns = (
        IMU,
        RATE,
        RUNS,
        *(Column(f"{a}, deg/s", "z.5f") for a in "xyz"),
        Column("axis rate error, deg/s", "z.5f"),
        Column("in bound"),
    )
    note = (
        "Mean over the runs of a rate. Axis rate error: output along the axis less the table's "
        "rate; it contains the Earth rate."
    )
    if has_value(rows, -1):
        note += (
            f" In bound: runs within R16 table 7: across the axis {limits.across_dps:g} deg/s "
            f"from zero, along it {limits.along_dps:g} deg/s from the rate."
        )
    return [
        drop_empty_columns(
            "Mean gyro output after calibration, segments of the fit", columns, rows, note
        )
    ]


def _inside(run: Run, limits: PublishedConditions) -> bool:
    across, along = run.values.get("across"), run.values.get("along")
    if across is None or along is None:
        return False
    return across <= limits.across_dps and abs(along) <= limits.along_dps


def _parameters(runs: Sequence[Run]) -> list[Table]:
    """Return every calibration's parameters with sigmas; a table for each set of names."""
    tables = []
    for names, members in parameter_sets(runs).items():
        columns = [IMU, RATE]
        columns += [
            Column(f"{name}, {'deg/h' if name.startswith('bias_') else 'ppm'}", BY_SIGMA)
            for name in names
        ]
        rows: list[tuple[Cell, ...]] = [
            (
                device_label(run.imu, run.axis),
                run.rate,
                *(Estimate(run.values[name], run.values[f"sigma {name}"]) for name in names),
            )
            for run in members
        ]
        origins = [(run.path,) for run in members]
        note = definitions(names)
        tables.append(drop_empty_columns("Calibrated parameters", columns, rows, note, origins))
    return tables
