"""Raw values of a table log to its angle: unwrapped, integrated, in rad."""

import numpy as np

from rotcli.logs.container.columns import Loaded
from rotcli.logs.container.header import Header
from rotcli.logs.describe.layout import Problem, Source, raise_all
from rotcli.logs.describe.table import TableLayout
from rotcli.logs.unwrap import Wrap, find_wrap, outside_records, unwrap
from rotcli.rig.rig import TableSettings
from rotcli.units import DEG, UNITS, FloatArray, show_time

_SPACING_RECORDS = 1_000_000  # records whose spacing is that of all
_TURN_TOLERANCE = 2e-3  # share by which a period may differ from a turn in another unit
_MAX_LISTED = 3  # rows that a message lists
# rad/s; tests of IMUs on tables use less than 170 deg/s, few rate tables reach 2000 deg/s.
_USUAL_RATE, _IMPOSSIBLE_RATE = 3.0, 35.0


def table_angle(
    header: Header,
    table: TableLayout,
    settings: TableSettings,
    loaded: Loaded,
    time: FloatArray,
    raw: FloatArray,
) -> tuple[FloatArray, FloatArray, list[str]]:
    """Return time (n,), s, and angle (n,), rad, from raw values (n,), and warnings.

    Records outside of the range of all others are omitted. Raises LogError where the values show
    another unit than the rig or the header.
    """
    source = table.layout.sources[table.quantity]
    if table.quantity == "rate":
        rate = (raw - source.offset) * source.scale
        angle = np.zeros(len(rate))
        np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time), out=angle[1:])
        return time, angle, _rate_notes(header, source, rate)
    column = header.names[source.column]
    wrap = _wrap(settings, time, raw, abs(source.scale))
    _check_counts(header, raw, table, wrap, column)
    _check_turn(header, raw, table, wrap, column)
    notes = _wrap_notes(header, table, loaded, time, raw, wrap, column)
    if wrap.outside:
        raw, time = np.delete(raw, wrap.outside), np.delete(time, wrap.outside)
    unwrap(raw, wrap.period)
    if source.offset:
        raw = raw - source.offset
    if source.origin != "assumed":
        return time, np.multiply(raw, source.scale, out=raw), notes
    angle, more = _without_unit(header, column, time, raw, raw * source.scale)
    return time, angle, [*notes, *more]


def _rate_notes(header: Header, source: Source, rate: FloatArray) -> list[str]:
    """Return the warning about fast rates (n,), rad/s, of a column without unit."""
    fast = float(np.quantile(np.abs(rate), 0.9)) if len(rate) else 0.0
    if source.origin != "assumed" or fast <= _USUAL_RATE:
        return []
    return [
        f"{header.path}: {header.names[source.column]} has no unit and reaches {fast:.4g} rad/s. "
        'rad/s is assumed; set [table] units = "rad/s" to confirm, or "deg/s"'
    ]


def _wrap(settings: TableSettings, time: FloatArray, raw: FloatArray, scale: float) -> Wrap:
    """Return how raw values (n,) at times (n,) start again: as the rig says, else as they show."""
    if settings.wrap is None:
        return find_wrap(time, raw, 2.0 * np.pi / scale)
    period = settings.wrap / scale
    return Wrap(period, outside_records(raw, period))


def _wrap_notes(
    header: Header,
    table: TableLayout,
    loaded: Loaded,
    time: FloatArray,
    raw: FloatArray,
    wrap: Wrap,
    column: str,
) -> list[str]:
    """Return the warnings about records outside of the range and about the range itself."""
    notes = []
    unit = table.unit
    if wrap.outside:
        k = wrap.outside[0]
        rows = ", ".join(str(loaded.row(i)) for i in wrap.outside[:_MAX_LISTED])
        more = len(wrap.outside) - _MAX_LISTED
        rows += f" and {more} more" if more > 0 else ""
        one = len(wrap.outside) == 1
        notes.append(
            f"{header.path}: {column} is {raw[k]:.6g} {unit} at {show_time(time[k])} s, outside of "
            f"the range of all other records (row{'' if one else 's'} {rows}). "
            f"{'It is' if one else 'They are'} omitted"
        )
    if wrap.beyond:
        k = wrap.beyond[0]
        count = len(wrap.beyond)
        notes.append(
            f"{header.path}: {column} starts again after a turn, but {count} "
            f"record{' is' if count == 1 else 's are'} outside of the turn of the others, first "
            f"{raw[k]:.6g} {unit} at {show_time(time[k])} s (row {loaded.row(k)}): the encoder may "
            "have slipped. The angle is unwrapped; check the encoder"
        )
    if wrap.found:
        degrees = wrap.period * abs(table.layout.sources[table.quantity].scale) / DEG
        notes.append(
            f"{header.path}: {column} starts again after {wrap.period:.7g} {unit}, not after "
            f"a turn. It is unwrapped so; set [table] wrap = {degrees:.7g}"
        )
    return notes


def _check_turn(
    header: Header, raw: FloatArray, table: TableLayout, wrap: Wrap, column: str
) -> None:
    """Raise LogError for values that start again after a turn in another unit: gon, not deg."""
    source = table.layout.sources[table.quantity]
    if not wrap.found or table.unit not in UNITS["angle"]:
        return
    for unit, size in UNITS["angle"].items():
        if unit != table.unit and abs(wrap.period * size / (2.0 * np.pi) - 1.0) < _TURN_TOLERANCE:
            degrees = wrap.period * abs(source.scale) / DEG
            finding = (
                f"{column} starts again after {wrap.period:.7g} ({raw.min():.6g} to "
                f"{raw.max():.6g}), a turn in {unit}, but its unit is {table.unit}"
            )
            advice = f"or, if it is a range of {table.unit}, [table] wrap = {degrees:.7g}"
            raise_all(header.path, [Problem(finding, {"table": {"units": unit}}, advice)])


def _without_unit(
    header: Header, column: str, time: FloatArray, raw: FloatArray, angle: FloatArray
) -> tuple[FloatArray, list[str]]:
    """Return the angle (n,), rad, of a column without unit: degrees where radians are absurd."""
    steps = np.abs(np.diff(angle[:_SPACING_RECORDS])) / np.diff(time[:_SPACING_RECORDS])
    fast = float(np.quantile(steps, 0.9)) if len(steps) else 0.0
    if fast <= _USUAL_RATE:
        return angle, []
    if np.array_equal(raw, np.rint(raw)):
        finding = (
            f"{column} has no unit and contains integers from {raw.min():.0f} to "
            f"{raw.max():.0f}: encoder counts or degrees"
        )
        advice = 'with the counts of a turn, or [table] units = "deg"'
        raise_all(header.path, [Problem(finding, {"table": {"counts_per_turn": 4096}}, advice)])
    if fast > _IMPOSSIBLE_RATE:
        return angle * DEG, [
            f"{header.path}: {column} has no unit and changes by {fast:.4g} per second. It is read "
            'as deg; set [table] units = "deg"'
        ]
    return angle, [
        f"{header.path}: {column} has no unit and changes by {fast:.4g} rad/s. rad is assumed; set "
        '[table] units = "rad" to confirm, or "deg"'
    ]


def _check_counts(
    header: Header, raw: FloatArray, table: TableLayout, wrap: Wrap, column: str
) -> None:
    """Raise LogError for integers without unit that wrap: encoder counts or degrees."""
    source = table.layout.sources[table.quantity]
    if source.origin != "assumed" or not wrap.found or source.scale != 1.0:
        return
    if not np.array_equal(raw, np.rint(raw)) or not float(wrap.period).is_integer():
        if abs(wrap.period - 360.0) < 1.0:
            _raise_unit(header, column, raw)
        return
    if wrap.period == 360.0:
        _raise_unit(header, column, raw)
    finding = (
        f"{column} contains integers from {raw.min():.0f} to {raw.max():.0f} that start again "
        f"after {wrap.period:.0f}: encoder counts"
    )
    raise_all(header.path, [Problem(finding, {"table": {"counts_per_turn": int(wrap.period)}})])


def _raise_unit(header: Header, column: str, raw: FloatArray) -> None:
    finding = (
        f"{column} has no unit and starts again after 360 ({raw.min():.6g} to {raw.max():.6g}): "
        "degrees"
    )
    raise_all(header.path, [Problem(finding, {"table": {"units": "deg"}})])
