"""Allan variance results into one table of noise coefficients."""

from collections.abc import Sequence

from rotcli.files.results.groups import Source
from rotcli.files.tables import Cell, Column, Table

COEFFICIENTS = (
    "quantization",
    "random_walk",
    "bias_instability",
    "rate_random_walk",
    "rate_ramp",
)


def allan_tables(sources: Sequence[Source]) -> list[Table]:
    """Return the coefficients of every axis and the minimum of its curve."""
    rows: list[tuple[Cell, ...]] = []
    ordered = sorted(sources, key=lambda s: (s.imu.casefold(), s.imu, s.path))
    for source in ordered:
        for axis in source.section("axes"):
            rows += _rows(source, axis)
    columns = (
        Column("IMU"),
        Column("axis"),
        Column("coefficient"),
        Column("value", ".4g"),
        Column("sigma", ".2g"),
        Column("unit"),
    )
    note = (
        "Bias instability is B of IEEE Std 952: its Allan floor is 0.664 B. A dash: the data "
        "cannot support the term."
    )
    return [Table("Noise coefficients from the Allan deviation", columns, rows, note)]


def _rows(source: Source, axis: str) -> list[tuple[Cell, ...]]:
    place = ("axes", axis)
    held = source.section(*place, "coefficients")
    rows: list[tuple[Cell, ...]] = []
    for name in [n for n in COEFFICIENTS if n in held]:
        where = (*place, "coefficients", name)
        rows.append(
            (
                source.imu,
                axis,
                name.replace("_", " "),
                source.number_or_none(*where, "value"),
                source.number_or_none(*where, "sigma"),
                str(source.section(*where).get("unit", "")) or "-",
            )
        )
    if source.section(*place, "minimum"):
        tau = source.number_or_none(*place, "minimum", "tau_s")
        lowest = source.number_or_none(*place, "minimum", "deviation")
        unit = str(source.section(*place).get("unit", ""))
        name = "lowest deviation" + (f", at {tau:.4g} s" if tau is not None else "")
        rows.append((source.imu, axis, name, lowest, None, unit))
    return rows
