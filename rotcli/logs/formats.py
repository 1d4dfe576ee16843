"""The text formats of vendors and other programs that `[imu] format` names, in one table.

A rig describes one of its own with the same words: `columns` (by name, or counted from 1),
`units`, `delimiter`, `comment`, `skip`, `sampling`, `mount`; what it says goes before the table.
A log in rotcli's own columns is read as it is, whatever format the rig names: so a converted
log goes with the rig of the log it came from.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from rotcli.errors import LogError
from rotcli.logs.dialect import Dialect
from rotcli.units import STANDARD_GRAVITY, UNITS

if TYPE_CHECKING:
    from rotcli.logs.header import Header
    from rotcli.logs.rig import ImuSettings

AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
Name = str | int  # of a column: its name, or its place counted from 1


@dataclass(frozen=True)
class Format:
    """A format: where it is described, and what a rig would say of it.

    sign: what the first lines of such a file match, to tell a user who named no format.
    ticks: columns that count instead of telling the time, the first that is filled is taken.
    """

    title: str
    source: str
    columns: Mapping[str, Name]
    units: Mapping[str, str] = field(default_factory=dict)
    delimiter: str | None = None
    comment: str = ""
    skip: int = 0
    figures: int = 0
    sampling: str | None = None
    mount: tuple[tuple[float, float, float], ...] | None = None
    sign: str | None = None
    ticks: tuple["Ticks", ...] = ()


@dataclass(frozen=True)
class Ticks:
    """A column that counts time: where it wraps; counts per s, None for one count a sample."""

    column: str
    wrap: int
    rate: float | None = None


def _named(*names: Name) -> dict[str, Name]:
    return dict(zip(("time", *AXES), names, strict=True))


FORMATS: dict[str, Format] = {
    "xsens": Format(
        title="Xsens MT Manager ASCII export",
        # Counters: "MT Low Level Communication Protocol", MT0101P: SampleTimeFine in ticks of
        # 10 kHz, 32 bits; PacketCounter 16 bits. Units: MTi User Manual, MT0605P.
        source="Xsens MT0101P, MT0605P",
        columns=_named("SampleTimeFine", *(f"{s}_{a}" for s in ("Gyr", "Acc") for a in "XYZ")),
        units={"gyro": "rad/s", "accel": "m/s^2"},
        comment="//",
        sign=r"(?m)\A//|^PacketCounter\b",
        ticks=(Ticks("SampleTimeFine", 1 << 32, 1e4), Ticks("PacketCounter", 1 << 16)),
    ),
    "euroc": Format(
        title="EuRoC MAV dataset, imu0/data.csv",
        # Burri et al., "The EuRoC micro aerial vehicle datasets", IJRR 2016: the header line
        # carries the units, the stamps are ns of Unix time.
        source="Burri et al., IJRR 2016",
        columns=_named("timestamp", *(f"{s}_RS_S_{a}" for s in ("w", "a") for a in "xyz")),
    ),
    "kf-gins": Format(
        title="KF-GINS increments text",
        # github.com/i2Nav-WHU/KF-GINS, README, 2.2 "Data format" and 2.1 "Frame definition": the
        # IMU's axes point forward, right, down.
        source="github.com/i2Nav-WHU/KF-GINS, README 2.1, 2.2",
        columns=_named(1, 2, 3, 4, 5, 6, 7),
        units={"time": "s", "gyro": "rad", "accel": "m/s"},
        delimiter=" ",
        sampling="increment",
        mount=((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    ),
    "psins": Format(
        title="PSINS .imu text",
        # Yan Gongmin, PSINS toolbox, imufile.m: three lines of figures, then integer increments.
        # The seventh column, if any, is written in us, though its header comment says ms.
        source="PSINS toolbox, imufile.m",
        columns=dict(zip(AXES, range(1, 7), strict=True)),
        units={"gyro": "rad", "accel": "m/s"},
        delimiter=" ",
        comment="%",
        figures=3,
        sampling="increment",
        sign=r"\A%.*PSINS",
    ),
}


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


def implied(imu: Mapping[str, Any]) -> dict[str, Any]:
    """Return [imu] keys with what their format settles: what a sample means, and the mount."""
    named = FORMATS.get(str(imu.get("format")))
    settled = {} if named is None else {"sampling": named.sampling, "mount": named.mount}
    return {**{key: value for key, value in settled.items() if value is not None}, **imu}


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
