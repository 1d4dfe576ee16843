"""The layout of a log's text: the format that the rig names, and the rig's entries over it."""

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rotcli.errors import LogError
from rotcli.files.dialect import Dialect
from rotcli.rig.formats import FORMATS, Format, Name, Ticks
from rotcli.units import STANDARD_GRAVITY, UNITS

if TYPE_CHECKING:
    from rotcli.logs.header import Header
    from rotcli.rig.rig import ImuSettings


@dataclass(frozen=True)
class Layout:
    """What a rig says of its IMU log's text. dialect: None for plain CSV and Parquet."""

    dialect: Dialect | None
    columns: dict[str, Name]
    units: dict[str, str]
    ticks: tuple[Ticks, ...] = ()


def layout_of(imu: "ImuSettings") -> Layout:
    """Return the layout of a rig's IMU log: that of its format, its own words on top."""
    named = FORMATS[imu.format] if imu.format else Format("", "", {})
    dialect = Dialect(
        imu.delimiter or named.delimiter,
        imu.comment or named.comment,
        named.skip if imu.skip is None else imu.skip,
        named.figures,
    )
    columns = {**named.columns, **imu.columns}
    counted = any(isinstance(name, int) for name in columns.values())
    ticks = () if "time" in imu.columns else named.ticks
    plain = dialect in (Dialect(), Dialect(",")) and not counted
    return Layout(None if plain else dialect, columns, {**named.units, **imu.units}, ticks)


def hint(head: str) -> str:
    """Return which format a file's first lines look like, as advice; empty for none."""
    found = [name for name, held in FORMATS.items() if held.sign and re.search(held.sign, head)]
    if not found:
        return ""
    return f'this looks like {FORMATS[found[0]].title}: say [imu] format = "{found[0]}" in the rig'


def ticks_of(layout: Layout, header: "Header") -> Ticks | None:
    """Return the count that tells a log's time: the first column of them that is filled."""
    for ticks in layout.ticks:
        column = header.find(ticks.column)
        if column is not None and column < len(header.first) and header.first[column]:
            return ticks
    return None


def packet_rate(header: "Header") -> float:
    """Return the packets per second, which Xsens' comments tell.

    Raises LogError where they do not.
    """
    for line in header.comments:
        found = re.search(r"(?:Update|Sample) Rate:\s*([0-9.]+)\s*Hz", line)
        if found and float(found[1]) > 0.0:
            return float(found[1])
    what = "no SampleTimeFine, and no line '// Update Rate: … Hz'; export with SampleTimeFine"
    raise LogError(header.path, what, column="PacketCounter")


@dataclass(frozen=True)
class Counts:
    """What turns PSINS integers into increments: start and interval s, scales (6,) rad, m/s."""

    start: float
    interval: float
    scales: tuple[float, ...]


def psins_counts(header: "Header") -> Counts:
    """Return the figures at the head of a PSINS log.

    Line 2 holds latitude, longitude, height, start (s), interval (ms) and gravity (m/s^2); line 3
    the gyros' scale factors (arcsec) and the accelerometers' (ug s). Raises LogError.
    """
    rows = [(row, values[:6]) for row, values in header.figures]
    for row, values in rows:
        if len(values) < 6:
            what = f"{len(values)} figures where 6 belong; is this a PSINS log?"
            raise LogError(header.path, what, row=row)
    (row, (_, _, _, start, interval, gravity)), (last, scales) = rows[1:]
    if not interval > 0.0:
        what = f"an interval of {interval:g} ms; correct the head of the log"
        raise LogError(header.path, what, row=row)
    if not all(scale > 0.0 for scale in scales):
        raise LogError(header.path, "a scale factor that is not above 0; correct it", row=last)
    g = gravity if gravity > 0.0 else STANDARD_GRAVITY
    arcsec = UNITS["angle"]["arcsec"]
    factors = [*(scale * arcsec for scale in scales[:3]), *(s * 1e-6 * g for s in scales[3:])]
    return Counts(start, interval * 1e-3, tuple(factors))
