"""Tables 1 and 2 of O17 from filter results: RMS attitude errors and the six bias estimates.

O17 is "Improving Observability of an Inertial System by Rotary Motions of an IMU", Sensors 2017,
17, 698. Its recordings are not public: simulated logs with the papers' sensor figures replace them,
so that the published values next to ours agree in kind, not digit for digit.
"""

import tomllib
from collections.abc import Mapping, Sequence
from functools import cache, partial
from typing import TYPE_CHECKING, Any

from rotcli.errors import ResultError
from rotcli.files.installed import DATA
from rotcli.files.results.groups import Source
from rotcli.files.tables import Cell, Column, Estimate, Table
from rotcli.files.tables.model import BY_SIGMA
from rotcli.observe import document, plot
from rotcli.observe.plot import run_name

if TYPE_CHECKING:
    from rotcli.files.figures import Drawing

_ATTITUDE = ("roll", "pitch", "azimuth")
_ESTIMATES = tuple(f"{sensor}_bias_{a}" for sensor in ("accel", "gyro") for a in "xyz")
_TILT_TOLERANCE = 1.0  # deg, within which a run is the published one

COLUMNS = (
    Column("run"),
    Column("source"),
    *(Column(f"{name}, deg", ".2f") for name in _ATTITUDE),
    *(Column(f"accel {a}, m/s^2", BY_SIGMA) for a in "xyz"),
    *(Column(f"gyro {a}, deg/h", BY_SIGMA) for a in "xyz"),
    Column("unreliable"),
)
_NOTE = "RMS over the run; biases, with 1 sigma, at its end."


@cache
def published_tables() -> dict[str, Any]:
    """Return the published tables as the data file contains them."""
    text = (DATA / "published_o17.toml").read_text("utf-8")
    return tomllib.loads(text)


def observability_tables(sources: Sequence[Source], *, published: bool = False) -> list[Table]:
    """Return the tables of observability results: filter tables, then analyses.

    published: with the rows of O17.
    """
    docs = [_checked(source) for source in sources]
    return tables(docs, published=published) + [
        document.table(doc) for doc in docs if "filter" not in doc
    ]


def observability_figures(sources: Sequence[Source], *, published: bool = False) -> "list[Drawing]":
    """Return the paper's figures: still and turning runs together, for each rotation axis."""
    docs = [_checked(source) for source in sources]
    filtered = [doc for doc in docs if "filter" in doc]
    still = [doc for doc in filtered if run_name(doc) == "still"]
    turning: dict[str, list[Any]] = {}
    for doc in filtered:
        if doc not in still:
            turning.setdefault(str(doc["axis"]), []).append(doc)
    drawn: list[Drawing] = []
    for axis, runs in sorted(turning.items()) or [("", [])]:
        shown = [*still, *runs]
        title = f", rotation about {axis}" if axis else ", still"
        drawn += [
            (f"{group}{title}", partial(plot.group_figure, shown, group))
            for group in plot.GROUPS
            if shown
        ]
    drawn += [
        (f"Observability along {doc['sweep']['parameter']}", partial(plot.sweep_figure, doc))
        for doc in docs
        if "sweep" in doc
    ]
    return drawn


def _checked(source: Source) -> Mapping[str, Any]:
    """Return the document of a source; raises ResultError where something shown is missing."""
    for keys in [("rank",), ("rate", "value"), *(("attitude", f"{a}_deg") for a in _ATTITUDE[:2])]:
        source.number(*keys)
    needed = ["axis", "weak", "model", "states", "degrees", "combinations", "unobservable"]
    found = source.section("filter")
    if found:
        for name in _ATTITUDE:
            source.number("filter", "rms", f"{name}_deg")
        for name in _ESTIMATES:
            source.number("filter", "estimates", name, "value")
        missing = [k for k in ("not_to_be_used", "consistency", "history") if k not in found]
    else:
        missing = [k for k in ("sensor_frame", "advice") if k not in source.doc]
    missing += [k for k in needed if k not in source.doc]
    if missing:
        raise ResultError(f"{source.path}: {missing[0]}: missing; create the file again")
    return source.doc


def tables(docs: Sequence[Mapping[str, Any]], *, published: bool = True) -> list[Table]:
    """Return the filter results of `observability` documents, all runs in one table.

    published: as the paper's tables, one for each rotation axis, the still runs in each, published
    rows beneath ours; runs about x, which the paper does not list, in a table without them.
    """
    filtered = [doc for doc in docs if "filter" in doc]
    still = [doc for doc in filtered if run_name(doc) == "still"]
    made = []
    for table in published_tables()["table"] if published else ():
        turning = [doc for doc in filtered if doc not in still and doc["axis"] == table["axis"]]
        if not turning:
            continue
        rows: list[tuple[Cell, ...]] = []
        for doc in [*still, *turning]:
            rows.append(_ours(doc))
            rows += [_published(row) for row in table["rows"] if _is_run(row, doc)]
        made.append(
            Table(
                title=f"Rotation about {table['axis']} (O17 table {table['number']})",
                columns=COLUMNS,
                rows=rows,
                note=f"Published: {published_tables()['source']}. {_NOTE}",
            )
        )
    axes = {table["axis"] for table in published_tables()["table"]} if published else set()
    placed = still if made else []
    rest = [
        doc for doc in filtered if doc not in placed and (doc in still or doc["axis"] not in axes)
    ]
    if rest:
        rows = [(run, *cells) for run, _, *cells in map(_ours, rest)]
        title = "ZUPT filter estimates" + (", other runs" if made else "")
        made.append(Table(title, (COLUMNS[0], *COLUMNS[2:]), rows, _NOTE))
    return made


def _is_run(row: Mapping[str, Any], doc: Mapping[str, Any]) -> bool:
    if row["run"] == "still" or run_name(doc) == "still":
        return bool(row["run"] == run_name(doc))
    attitude = doc["attitude"]
    off = max(abs(attitude["pitch_deg"] - row["pitch"]), abs(attitude["roll_deg"]))
    return bool(off < _TILT_TOLERANCE)


def _ours(doc: Mapping[str, Any]) -> tuple[Cell, ...]:
    found = doc["filter"]
    bad = [n for n in (*_ESTIMATES, "azimuth") if n in found["not_to_be_used"]]
    return (
        run_name(doc),
        "rotcli",
        *(found["rms"][f"{name}_deg"] for name in _ATTITUDE),
        *(_estimate(found["estimates"][name]) for name in _ESTIMATES),
        ", ".join(name.replace("_bias", "").replace("_", " ") for name in bad),
    )


def _estimate(quantity: Mapping[str, Any]) -> Estimate:
    return Estimate(quantity["value"], quantity.get("sigma"))


def _published(row: Mapping[str, Any]) -> tuple[Cell, ...]:
    return (row["run"], "published", *row["values"], "")
