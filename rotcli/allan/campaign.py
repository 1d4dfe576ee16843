"""Allan variance results as tables: one row per axis, one column per noise coefficient."""

from collections.abc import Sequence

from rotcli.files.results.groups import Source
from rotcli.files.tables import Cell, Column, Estimate, Table, drop_empty_columns
from rotcli.files.tables.model import BY_SIGMA

COEFFICIENTS = {
    "quantization": "quantization",
    "random_walk": "random walk",
    "bias_instability": "bias instability",
    "rate_random_walk": "rate random walk",
    "rate_ramp": "rate ramp",
}
_SENSORS = {"gyro": "gyros", "accel": "accelerometers"}


def allan_tables(sources: Sequence[Source]) -> list[Table]:
    """Return the coefficients of the gyros and those of the accelerometers, and the curves' minima.

    Where a coefficient is not significant its 95 % upper limit is shown.
    """
    ordered = sorted(sources, key=lambda s: (s.imu.casefold(), s.imu, s.path))
    return [table for sensor in _SENSORS for table in _sensor_tables(ordered, sensor)]


def _sensor_tables(sources: Sequence[Source], sensor: str) -> list[Table]:
    axes = [
        (source, axis)
        for source in sources
        for axis in source.section("axes")
        if axis.startswith(f"{sensor}_")
    ]
    if not axes:
        return []
    columns = [Column("IMU"), Column("axis")]
    for name, words in COEFFICIENTS.items():
        columns.append(Column(_with_unit(words, _unit(axes, "coefficients", name)), BY_SIGMA))
    columns.append(Column(_with_unit("lowest deviation", _unit(axes)), ".4g"))
    columns.append(Column("at cluster time, s", ".4g"))
    rows: list[tuple[Cell, ...]] = []
    for source, axis in axes:
        cells = [_estimate(source, axis, name) for name in COEFFICIENTS]
        deviation = source.number_or_none("axes", axis, "minimum", "deviation")
        tau = source.number_or_none("axes", axis, "minimum", "tau_s")
        rows.append((source.imu, axis, *cells, deviation, None if deviation is None else tau))
    note = (
        "Value ± sigma; <: 95 % upper limit of a coefficient that is not significant. Bias "
        "instability is B of IEEE Std 952; its Allan floor is 0.664 B."
    )
    title = f"Noise of the {_SENSORS[sensor]} from the Allan deviation"
    return [drop_empty_columns(title, columns, rows, note, [(source.path,) for source, _ in axes])]


def _estimate(source: Source, axis: str, name: str) -> Estimate:
    place = ("axes", axis, "coefficients", name)
    value, sigma, upper = (
        source.number_or_none(*place, key) for key in ("value", "sigma", "upper")
    )
    return Estimate(value, sigma, upper)


def _unit(axes: Sequence[tuple[Source, str]], *keys: str) -> str:
    """Return the unit of a figure, the same for every axis of a sensor."""
    found = [str(source.section("axes", axis, *keys).get("unit") or "") for source, axis in axes]
    return next((unit for unit in found if unit), "")


def _with_unit(words: str, unit: str) -> str:
    return f"{words}, {unit}" if unit else words
