"""O17, "Improving Observability of an Inertial System by Rotary Motions of an IMU"."""

from pathlib import Path
from typing import Any

from rotcli.files.results.documents import read_result
from rotcli.observe.observability import TableMotion, analyse
from rotcli.observe.published_o17 import published_tables
from rotcli.units import DEG
from tests.campaigns.papers.item import (
    AGREES,
    CONTRADICTED,
    CORRECTED,
    DIFFERS,
    IN_KIND,
    Item,
)

# Runs of `make observe`: folder, row of the paper's table.
RUNS = {
    "O17 table 1": ("y", {"still": "still", "pitch 0": "y-level", "pitch 30": "y-pitch-30"}),
    "O17 table 2": ("z", {"still": "still", "level": "z-level", "pitch 30": "z-pitch-30"}),
}
_RATE = 10.0 * DEG
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_OBSERVED, _HIDDEN = 5.0, 10.0  # deg of azimuth: about one, and tens, in the paper
# Title, axis, pitch, roll (deg), rank stated by the paper.
_PROPERTIES: tuple[tuple[str, str | None, float, float, int], ...] = (
    ("still", None, 0.0, 0.0, 8),
    ("about x, roll 0", "x", 0.0, 0.0, 10),
    ("about x, roll 30 deg", "x", 0.0, 30.0, 11),
    ("about y, pitch 0", "y", 0.0, 0.0, 10),
    ("about y, pitch 30 deg", "y", 30.0, 0.0, 11),
    ("about z, level", "z", 0.0, 0.0, 8),
    ("about z, pitch 30 deg", "z", 30.0, 0.0, 11),
    ("about x, roll 90 deg", "x", 0.0, 90.0, 11),
    ("about y, pitch 90 deg", "y", 90.0, 0.0, 11),
    ("about z, pitch 90 deg", "z", 90.0, 0.0, 11),
)


def formula_items() -> list[Item]:
    """Return the ranks of the properties, their combinations, and those of maneuvers."""
    items = [_rank_item(*case) for case in _PROPERTIES]
    return [*items, _combination_item(), *_maneuver_items()]


def _rank_item(title: str, axis: str | None, pitch: float, roll: float, stated: int) -> Item:
    motion = TableMotion(
        None if axis is None else _AXES[axis],
        _RATE if axis else 0.0,
        pitch=pitch * DEG,
        roll=roll * DEG,
    )
    rank = analyse(motion).rank
    verdict = AGREES if rank == stated else CONTRADICTED
    what = f"{title}: rank of 12 states"
    return Item("O17 properties 1 to 5", what, str(rank), str(stated), verdict)


def _combination_item() -> Item:
    """Property 5, about a level z: the sign of the gyro bias follows the sense of rotation."""
    found = analyse(TableMotion(_AXES["z"], _RATE)).n.combinations
    texts = [c.text for c in found if "d_" in c.text]
    right = all("- (g/w)*d_" in text for text in texts) and len(texts) == 2
    return Item(
        "O17 properties 1 to 5",
        "property 5: combinations with the gyro biases",
        ", ".join(texts),
        "the other sign",
        CORRECTED if right else DIFFERS,
    )


def _maneuver_items() -> list[Item]:
    items = []
    for title, accelerations, stated in (
        ("one constant acceleration", ((1.0, 0.0, 0.0),), 12),
        ("accelerations in two directions", ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), 12),
    ):
        still = ((0.0, 0.0, 0.0),)
        rank = analyse(TableMotion(accelerations=(*accelerations, *still))).rank
        verdict = AGREES if rank == stated else CONTRADICTED
        what = f"rank with {title}"
        items.append(Item("O17 (36), (37)", what, str(rank), str(stated), verdict))
    return items


def campaign_items(folder: Path) -> list[Item]:
    """Return the items of the six runs of `make observe`; folder: observe/."""
    items = []
    tables = {f"O17 table {table['number']}": table for table in published_tables()["table"]}
    for item, (axis, runs) in RUNS.items():
        rows = {row["run"]: row["values"] for row in tables[item]["rows"]}
        for run, name in runs.items():
            doc = read_result(str(folder / name / "observe.json"))
            items.append(_azimuth_item(item, f"about {axis}, {run}", doc, rows[run][2]))
            items.append(_level_item(item, f"about {axis}, {run}", doc, rows[run][:2]))
    return items


def _azimuth_item(item: str, run: str, doc: dict[str, Any], paper: float) -> Item:
    """The rotation makes the azimuth observable, or it does not: about one degree, or tens."""
    ours = doc["filter"]["rms"]["azimuth_deg"]
    same = max(ours, paper) < _OBSERVED or min(ours, paper) > _HIDDEN
    verdict = IN_KIND if same else DIFFERS
    return Item(item, f"{run}: azimuth RMS, deg", f"{ours:.2f}", f"{paper:.2f}", verdict)


def _level_item(item: str, run: str, doc: dict[str, Any], paper: list[float]) -> Item:
    """Roll and pitch are limited by unobservable accelerometer biases: below 2 deg."""
    ours = [doc["filter"]["rms"][f"{name}_deg"] for name in ("roll", "pitch")]
    verdict = IN_KIND if max(*ours, *paper) < 2.0 else DIFFERS
    shown = [", ".join(f"{value:.2f}" for value in side) for side in (ours, paper)]
    return Item(item, f"{run}: roll, pitch RMS, deg", *shown, verdict)
