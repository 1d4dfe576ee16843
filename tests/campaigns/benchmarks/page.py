"""The table for the terminal, as a Markdown page and as JSON."""

import json
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict
from importlib import metadata
from itertools import groupby
from typing import Any

from tests.campaigns.benchmarks.measure import Figure, Row

_STEPS = {"s": ((1.0, "s"), (1e-3, "ms"), (1e-6, "us")), "m": ((1.0, "m"), (1e-3, "mm"))}
_HEADINGS = ("measured", "rotcli", "compared with", "takes", "ratio", "bound", "peak memory, MB")
_PACKAGES = ("numpy", "scipy", "pyarrow", "pandas", "allantools", "python-ins", "numba", "inu")
_INTRODUCTION = """\
# How fast

Kept from `make bench`, which writes this page to `build/bench.md` and the same figures to
`build/bench.json`. Seconds vary by a factor of two from machine to machine and from hour to hour;
the ratios are what counts. Every ratio is rotcli over the other: **below 1 rotcli is ahead**. Both
were measured turn and turn about in one run; a figure is the median, the quartiles follow
it in brackets. A function of milliseconds is called for a tenth of a second in each turn, without
garbage collection. A bound that is printed is a requirement; `make bench` ends with
status 1 when one does not hold.

"""


def machine() -> dict[str, Any]:
    """Return what the machine is, in general words, and the versions that were measured."""
    versions = {}
    for name in _PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "cores": os.cpu_count(),
        "memory_gb": round(memory / 1e9),
        "load_at_start": round(os.getloadavg()[0], 1),
        "python": platform.python_version(),
        "versions": versions,
    }


def _described(found: dict[str, Any]) -> str:
    versions = ", ".join(f"{name} {version}" for name, version in found["versions"].items())
    return (
        f"Machine: {found['cores']} cores, {found['memory_gb']} GB of memory, {found['system']}, "
        f"shared with other work (load {found['load_at_start']} at the start). "
        f"Python {found['python']}, {versions}."
    )


def _scale(figure: Figure) -> tuple[float, str]:
    """Return the size and name of the unit a figure reads best in."""
    steps = _STEPS.get(figure.unit, ((1.0, figure.unit),))
    return next((step for step in steps if abs(figure.median) >= step[0]), steps[-1])


def _number(value: float) -> str:
    if value != 0.0 and not 1e-3 <= abs(value) < 1e5:
        return f"{value:.1e}"
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def _figure(figure: Figure | None) -> str:
    if figure is None:
        return ""
    size, unit = _scale(figure)
    text = f"{_number(figure.median / size)} {unit}".strip()
    if figure.count == 1:
        return text
    return f"{text} ({_number(figure.low / size)}-{_number(figure.high / size)})"


def _bound(row: Row) -> str:
    if row.at_most is None:
        return ""
    judged = row.ratio if row.bound_on == "ratio" else row.ours
    limit = Figure(row.at_most, row.at_most, row.at_most, 1, judged.unit if judged else "")
    return f"<= {_figure(limit)}: {'kept' if row.kept else 'FAILS'}"


def _peak(row: Row) -> str:
    peaks = [row.peak, row.peer_peak] if row.peer_peak else [row.peak] if row.peak else []
    return " / ".join("-" if peak is None else f"{peak / 1e6:.0f}" for peak in peaks)


def _cells(row: Row) -> list[str]:
    what = f"{row.what} ({row.note})" if row.note else row.what
    ratio = _figure(row.ratio)
    return [what, _figure(row.ours), row.peer, _figure(row.theirs), ratio, _bound(row), _peak(row)]


def markdown(rows: Sequence[Row], about: dict[str, Any]) -> str:
    """Return the page: introduction, machine, and a table for each group."""
    parts = [_INTRODUCTION, _described(about), "\n"]
    for group, members in groupby(rows, key=lambda row: row.group):
        parts.append(f"\n## {group}\n\n| {' | '.join(_HEADINGS)} |\n")
        parts.append(f"|{' --- |' * len(_HEADINGS)}\n")
        parts += [f"| {' | '.join(_cells(row))} |\n" for row in members]
    return "".join(parts)


def text(row: Row) -> str:
    """Return a row for the terminal."""
    what, ours, peer, theirs, ratio, bound, peak = _cells(row)
    parts = [f"rotcli {ours}" if ours else "", f"{peer} {theirs}".strip()]
    parts += [f"ratio {ratio}" if ratio else "", bound, f"peak {peak} MB" if peak else ""]
    return f"  {what}: {'; '.join(part for part in parts if part)}"


def rows_of(text: str) -> list[Row]:
    """Return the rows of a bench.json."""

    def row(entry: dict[str, Any]) -> Row:
        figures = {k: Figure(**entry[k]) for k in ("ours", "theirs", "ratio") if entry[k]}
        return Row(**{k: v for k, v in entry.items() if k != "kept"} | figures)

    return [row(entry) for entry in json.loads(text)["rows"]]


def as_json(rows: Sequence[Row], about: dict[str, Any]) -> str:
    """Return everything measured: seconds, metres and bytes at full precision."""
    entries = [asdict(row) | {"kept": row.kept} for row in rows]
    return json.dumps({"machine": about, "rows": entries}, indent=2) + "\n"
