"""The nine RMS errors of each mode and rate, and azimuth against level errors.

The tables repeat R16 figures 8, 9, 11 and 12 ("MEMS IMU Error Mitigation Using Rotation Modulation
Technique", Sensors 2016, 16, 2017), and the finding of its section 4.2 that the errors of roll and
pitch are nearly an order of magnitude below that of the azimuth.
"""

from collections.abc import Sequence

from rotcli.files.published import cited
from rotcli.files.results.groups import Group, device_label, mean, ratio
from rotcli.files.tables import Cell, Column, Table, drop_empty_columns

# Kind of error: its three components by JSON key, with the heading and format of each.
ERRORS: dict[str, tuple[tuple[str, str, str], ...]] = {
    "position": (
        ("latitude_m", "latitude, m", ".1f"),
        ("longitude_m", "longitude, m", ".1f"),
        ("height_m", "height, m", ".1f"),
    ),
    "velocity": (
        ("v_north_mps", "v north, m/s", ".2f"),
        ("v_east_mps", "v east, m/s", ".2f"),
        ("v_up_mps", "v up, m/s", ".2f"),
    ),
    "attitude": (
        ("pitch_deg", "pitch, deg", ".3f"),
        ("roll_deg", "roll, deg", ".3f"),
        ("azimuth_deg", "azimuth, deg", ".3f"),
    ),
}
_LEVEL = ("pitch_deg", "roll_deg")


def error_tables(groups: Sequence[Group], *, published: bool = False) -> list[Table]:
    """Return the nine errors, a row for each device, mode and rate."""
    columns = [column for kind in ERRORS.values() for column in kind]
    rows: list[tuple[Cell, ...]] = []
    for group in groups:
        rate = group.rate if group.mode != "conventional" else 0.0
        values = (group.mean(name) for name, _, _ in columns)
        rows.append((group.label, group.mode, rate, len(group.runs), *values))
    title = "RMS errors of position, velocity and attitude"
    return [
        Table(
            cited(title, "R16 figures 7 to 12", published),
            (
                Column("IMU"),
                Column("mode"),
                Column("rate, deg/s", ".4g"),
                Column("runs", "d"),
                *(Column(heading, spec) for _, heading, spec in columns),
            ),
            rows,
            "Mean over the runs of a rate.",
        )
    ]


def level_tables(groups: Sequence[Group]) -> list[Table]:
    """Return the azimuth error against those of roll and pitch, means over the rates."""
    rows: list[tuple[Cell, ...]] = []
    for imu, axis, mode in dict.fromkeys((g.imu, g.axis, g.mode) for g in groups):
        members = [g for g in groups if (g.imu, g.axis, g.mode) == (imu, axis, mode)]
        pitch, roll = (mean([g.mean(name) for g in members]) for name in _LEVEL)
        azimuth = mean([g.mean("azimuth_deg") for g in members])
        factor = ratio(azimuth, mean([pitch, roll]))
        attitude = (*_LEVEL, "azimuth_deg")
        due = [mean([g.mean(f"expected_{name}") for g in members]) for name in attitude]
        expected = ratio(due[-1], mean(due[:-1]))
        name = device_label(imu, axis)
        rows.append((name, mode, len(members), pitch, roll, azimuth, factor, expected))
    columns = (
        Column("IMU"),
        Column("mode"),
        Column("rates", "d"),
        *(Column(f"{name}, deg", ".3f") for name in ("pitch", "roll", "azimuth")),
        Column("azimuth / level", ".1f"),
        Column("expected", ".1f"),
    )
    note = (
        "Means over the rates. Azimuth / level: azimuth error over the mean of pitch and roll; "
        "expected: the same of the expected RMS. A ratio of one run scatters by a factor of "
        "3. The rotation modulates the biases of the level gyros, not of the one along the axis."
    )
    title = "Attitude RMS: azimuth against pitch and roll"
    return [drop_empty_columns(title, columns, rows, note)] if rows else []
