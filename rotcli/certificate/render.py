"""A certificate as one HTML page for A4 paper and as Markdown."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from rotcli.certificate.contents import Certificate, NoiseRow, ParameterRow
from rotcli.certificate.numbers import DASH, digits_of, number
from rotcli.files.figures import MANY, inline_svg, panels, plain, styled
from rotcli.files.results.page import render_page
from rotcli.lazy import lazily
from rotcli.version import __version__

with lazily():
    import markupsafe


if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PRINT_SCALES = ((14, 1.35), (22, 1.18))  # rows of the tables, factor of the letters
_HASH_LETTERS = 16  # of a SHA-256 on paper: 64 bits distinguish files, and one line contains them


def parameter_cells(row: ParameterRow) -> dict[str, str]:
    """Return the texts of a parameter's row by column."""
    shown = row.remark or "not estimated"
    if row.value is not None:
        shown = digits_of(row.value, row.sigma)
    return {
        "name": row.name,
        "value": shown,
        "sigma": number(row.sigma, ".2g"),
        "unit": row.unit,
        "mean": DASH if row.mean is None else digits_of(row.mean, row.sigma),
        "count": str(row.turn_ons),
        "turn_on": number(row.turn_on_sigma, ".2g"),
        "fleet": f"{number(row.fleet_turn_on, '.2g')} / {number(row.fleet_day_to_day, '.2g')}",
        "percentile": number(row.percentile, ".0f"),
        "trend": row.trend or DASH,
        "limits": row.limits or DASH,
        "verdict": row.verdict or DASH,
    }


def noise_cells(row: NoiseRow) -> dict[str, str]:
    """Return the texts of a noise coefficient by column; a limit starts with `<`."""
    if row.value is not None:
        value, si = digits_of(row.value, row.sigma), number(row.si, ".4g")
    elif row.upper is not None:
        value = f"< {row.upper:.2g}"
        si = DASH if row.si is None else f"< {row.si:.2g}"
    else:
        value = si = DASH
    return {
        "axis": row.axis,
        "symbol": row.symbol,
        "value": value,
        "unit": row.unit,
        "si": f"{si} {row.si_unit}" if si != DASH else DASH,
        "limits": row.limits or DASH,
        "verdict": row.verdict or DASH,
    }


def noise_summary(rows: Sequence[NoiseRow]) -> Iterator[tuple[str, list[dict[str, str]]]]:
    """Yield each axis with the cells of its coefficients."""
    for axis, group in groupby(rows, key=lambda row: row.axis):
        yield axis, [noise_cells(row) for row in group]


def identity_pairs(made: Certificate) -> list[tuple[str, str]]:
    """Return the lines about the device, in order; unknown ones are omitted."""
    who = made.identity
    pairs = [
        ("Device", who.name),
        ("Serial", who.serial),
        ("Customer", who.customer),
        ("Date", _span(made.dates)),
        ("Operator", who.operator),
        ("Place", who.place),
        *((key.replace("_", " ").capitalize(), value) for key, value in who.extra.items()),
        ("Specification", made.spec),
    ]
    return [(label, value) for label, value in pairs if value]


def _span(dates: Sequence[str]) -> str | None:
    """Return one date, or the first and the last of several."""
    if not dates:
        return None
    return dates[0] if len(dates) == 1 else f"{dates[0]} to {dates[-1]}"


def has_fleet(made: Certificate) -> bool:
    """Return whether any parameter has figures of the fleet."""
    return any(
        row.fleet_turn_on is not None or row.percentile is not None for row in made.parameters
    )


def to_markdown(made: Certificate, title: str) -> str:
    """Return the certificate as Markdown (GitHub tables)."""
    lines = [f"# {title}", ""]
    lines += [f"- {label}: {value}" for label, value in identity_pairs(made)]
    if made.verdict is not None:
        lines += ["", f"**Result: {made.verdict}**"]
    parameters = [parameter_cells(row) for row in made.parameters]
    columns = ["name", "value", "sigma", "unit", "count", "mean"]
    columns += ["turn_on", "fleet", "percentile", "trend"] if has_fleet(made) else []
    columns += ["limits", "verdict"] if made.spec else []
    lines += _markdown("Parameters", [_HEADINGS[c] for c in columns], parameters, columns)
    noise = [noise_cells(row) for row in made.noise]
    columns = ["axis", "symbol", "value", "unit", "si"]
    columns += ["limits", "verdict"] if made.spec else []
    lines += _markdown("Noise", [_HEADINGS[c] for c in columns], noise, columns)
    tests = [
        {"test": r.test, "name": r.name, "text": "; ".join(cell or DASH for cell in r.cells)}
        for r in made.tests
    ]
    lines += _markdown(
        "Tests", ["test", "figure", "result (x; y; z)"], tests, ["test", "name", "text"]
    )
    lines += ["", "## Equation of use", "", *(f"- `{text}`" for text in made.equations)]
    lines += ["", "## Not tested", "", ", ".join(made.not_tested) or "nothing"]
    inputs = [
        {"path": f.path, "kind": f.kind, "date": f.date or DASH, "sha256": f.sha256}
        for f in made.inputs
    ]
    lines += _markdown("Inputs", list(inputs[0]), inputs, list(inputs[0]))
    lines += ["", *(f"{note}." for note in made.notes), f"rotcli {__version__}"]
    return "\n".join(lines) + "\n"


_HEADINGS = {
    "name": "parameter",
    "value": "value",
    "sigma": "sigma",
    "unit": "unit",
    "count": "turn-ons",
    "mean": "mean",
    "turn_on": "turn-on sigma",
    "fleet": "fleet turn-on / day-to-day",
    "percentile": "percentile",
    "trend": "trend",
    "limits": "limits",
    "verdict": "verdict",
    "axis": "axis",
    "symbol": "coefficient",
    "si": "SI",
}


def _markdown(
    title: str, headings: Sequence[str], rows: Sequence[dict[str, str]], columns: Sequence[str]
) -> list[str]:
    if not rows:
        return []

    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"

    body = [line([row[c] for c in columns]) for row in rows]
    return ["", f"## {title}", "", line(headings), line(["---"] * len(headings)), *body]


def to_html(made: Certificate, title: str) -> str:
    """Return the page: one A4 sheet in print, one column on a phone."""
    detailed = _detailed(made)
    matrix = matrix_rows(made.parameters)
    return render_page(
        "certificate.html",
        title=title,
        version=__version__,
        made=made,
        identity=identity_pairs(made),
        matrix=matrix,
        scale=_print_scale(
            len(matrix) + min(len(detailed), MAX_DETAILED) + len(made.noise) + len(made.tests)
        ),
        detailed=[parameter_cells(row) for row in detailed[:MAX_DETAILED]],
        more=max(0, len(detailed) - MAX_DETAILED),
        fleet=has_fleet(made),
        noise=list(noise_summary(made.noise)),
        tests=[
            (test, list(group)) for test, group in groupby(made.tests, key=lambda row: row.test)
        ],
        inputs=[
            (f.path, f.kind, f.date or DASH, f.sha256[:_HASH_LETTERS], _logs(f.logs))
            for f in made.inputs
        ],
        figures=[markupsafe.Markup(svg) for svg in _figures(made)],
    )


_DATE_LABELS = 4  # under a small chart
MAX_DETAILED = 10  # rows on paper; the Markdown contains all
# Rows of the table of three axes: label and the parameter of each axis.
_GROUPS = (
    ("gyro bias d", "bias_x bias_y bias_z"),
    ("gyro matrix N, row x", "Kgx Kgxy Kgxz"),
    ("gyro matrix N, row y", "Kgyx Kgy Kgyz"),
    ("gyro matrix N, row z", "Kgzx Kgzy Kgz"),
    ("g-sensitivity G, row x", "gsens_xx gsens_xy gsens_xz"),
    ("g-sensitivity G, row y", "gsens_yx gsens_yy gsens_yz"),
    ("g-sensitivity G, row z", "gsens_zx gsens_zy gsens_zz"),
    ("gyro asymmetry", "gyro_asymmetry_x gyro_asymmetry_y gyro_asymmetry_z"),
    ("accelerometer bias b", "accel_bias_x accel_bias_y accel_bias_z"),
    ("accelerometer matrix M, row x", "Kax Kaxy Kaxz"),
    ("accelerometer matrix M, row y", "Kayx Kay Kayz"),
    ("accelerometer matrix M, row z", "Kazx Kazy Kaz"),
    ("accelerometer second order", "Ka2_x Ka2_y Ka2_z"),
    ("accelerometer asymmetry", "accel_asymmetry_x accel_asymmetry_y accel_asymmetry_z"),
)


def matrix_rows(parameters: Sequence[ParameterRow]) -> list[tuple[str, str, list[str]]]:
    """Return label, unit and the cells for x, y, z; other parameters follow with one cell."""
    by_name = {row.name: row for row in parameters}
    rows = []
    for label, text in _GROUPS:
        found = [by_name.pop(name, None) for name in text.split()]
        units = [row.unit for row in found if row is not None]
        if units:
            rows.append((label, units[0], [_with_sigma(row) for row in found]))
    rows += [(row.name, row.unit, [_with_sigma(row), "", ""]) for row in by_name.values()]
    return rows


def _with_sigma(row: ParameterRow | None) -> str:
    if row is None or row.value is None:
        return DASH
    sigma = "" if row.sigma is None else f" ± {digits_of(row.sigma, row.sigma)}"
    return f"{digits_of(row.value, row.sigma)}{sigma}"


def _detailed(made: Certificate) -> list[ParameterRow]:
    """Return the rows with limits, then those with figures of the fleet, then repeated ones."""

    def rank(row: ParameterRow) -> int:
        if row.limits is not None:
            return 0
        if row.percentile is not None or row.fleet_turn_on is not None:
            return 1
        return 2 if row.turn_ons > 1 else 3

    ordered = sorted(made.parameters, key=rank)
    least = min((rank(row) for row in ordered), default=3)
    return [row for row in ordered if rank(row) <= max(1, least) < 3]


def _print_scale(rows: int) -> float:
    """Return the size of the printed letters: larger where few rows leave space on the sheet."""
    return next((scale for most, scale in _PRINT_SCALES if rows <= most), 1.0)


def _logs(logs: Sequence[tuple[str, str]]) -> str:
    return "; ".join(f"{path} ({sha256[:_HASH_LETTERS]})" for path, sha256 in logs) or DASH


def _figures(made: Certificate) -> list[str]:
    figures = []
    if made.curves.allan:
        figures.append(inline_svg("allan", "Allan deviation of the gyros", _allan(made)))
    if made.curves.scale:
        figures.append(inline_svg("scale", "Residuals over the table rate", _scale(made)))
    if made.curves.history:
        figures.append(inline_svg("history", "Gyro biases over the results", _history(made)))
    return figures


@styled()
def _history(made: Certificate) -> "Figure":
    fig, (axes,) = panels(1, 1.6, "")
    first = made.curves.history[0][1]
    for (label, dates, values, sigmas), look in zip(made.curves.history, MANY, strict=False):
        axes.errorbar(range(len(dates)), values, yerr=sigmas, label=plain(label), **look)
    step = max(1, -(-len(first) // _DATE_LABELS))
    places = range(0, len(first), step)
    axes.set_xticks(places, [plain(first[k][:10]) for k in places], fontsize=7)
    axes.set_ylabel("gyro bias (deg/h)")
    axes.legend(fontsize=7)
    return fig


@styled()
def _allan(made: Certificate) -> "Figure":
    fig, (axes,) = panels(1, 1.6, "")
    for (label, tau, deviation), look in zip(made.curves.allan, MANY, strict=False):
        axes.loglog(tau, deviation, label=plain(label), **{**look, "marker": None})
    axes.set_xlabel("cluster time (s)")
    axes.set_ylabel(f"Allan deviation ({made.curves.allan_unit})")
    axes.legend(fontsize=7)
    return fig


@styled()
def _scale(made: Certificate) -> "Figure":
    fig, (axes,) = panels(1, 1.6, "")
    for (label, rate, residual), look in zip(made.curves.scale, MANY, strict=False):
        axes.plot(rate, residual, label=plain(label), **look)
    axes.set_xlabel("table rate (deg/s)")
    axes.set_ylabel("residual (deg/h)")
    axes.legend(fontsize=7)
    return fig
