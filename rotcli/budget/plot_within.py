"""Figure of the errors within one turn: each source in East, North, Up against the table angle."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rotcli.budget.estimate import ACCEL_BIAS, GYRO_BIAS, SOURCES
from rotcli.budget.within import COMPONENTS
from rotcli.files import captions
from rotcli.files.figures import INK, SERIES, legend_above, panels, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HEIGHT = 1.25  # inch, of a panel
_WIDTH, _LABELS = 2.6, 0.8  # inch, of a column of panels and of the labels next to it
_NAMES = dict(
    zip(SOURCES, ("accel bias", "gyro bias", "scale factor", "installation"), strict=True)
)


def _rows() -> list[tuple[str, str, str]]:
    """Return the rows of panels: source, key of its series, label."""
    rows = [
        (source, "error", f"{name},\n{'m/s$^2$' if source == ACCEL_BIAS else 'deg/h'}")
        for source, name in _NAMES.items()
    ]
    return [
        *rows,
        (GYRO_BIAS, "attitude_deg", "attitude from\ngyro bias, deg"),
        (GYRO_BIAS, "velocity_mps", "velocity from\ngyro bias, m/s"),
    ]


@styled()
def within_figure(doc: Mapping[str, Any]) -> "Figure":
    """Draw the errors of a turn: a row for each source, a column for each rotation axis.

    The last two rows are the attitude and velocity errors that the gyro bias causes; the velocity
    does not return to zero.
    """
    within, rows = doc["within_turn"], _rows()
    rate = f"{doc['rate']['value']:.6g} deg/s"
    title = captions.title_without_imu(doc, f"errors within one turn at {rate}")
    width = None if len(within) == 1 else _LABELS + len(within) * _WIDTH
    fig, axes = panels(len(rows), _HEIGHT, title, columns=len(within), width=width)
    axes = axes.reshape(len(rows), len(within))
    for column, (axis, sources) in zip(axes.T, within.items(), strict=True):
        for panel, (source, key, _) in zip(column, rows, strict=True):
            entry = sources[source]
            for name, look in zip(COMPONENTS, SERIES, strict=True):
                style = {**look, "marker": None}
                panel.plot(entry["angle_deg"], entry[key][name], label=name, **style)
            panel.axhline(0.0, color=INK, linewidth=0.6)
            panel.margins(x=0.0)
            panel.set_xticks([_sign(entry) * k for k in range(0, 361, 90)])
        column[-1].set_xlabel(f"table angle about {axis}, deg")
    for panel, (_, _, label) in zip(axes[:, 0], rows, strict=True):
        panel.set_ylabel(label)
    legend_above(axes[0, 0], 3)
    return fig


def _sign(entry: Mapping[str, Any]) -> int:
    return 1 if entry["angle_deg"][-1] > 0.0 else -1
