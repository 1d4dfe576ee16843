"""What an SRINS observes, as a result document and tables, beside the paper's table 1."""

from collections.abc import Mapping, Sequence
from typing import Any

from rotcli import units
from rotcli.files.result_groups import Source
from rotcli.files.tables import Column, Table
from rotcli.srins.model import STATES, VehicleMotion
from rotcli.srins.observability import SCHEMES, THRESHOLD, SrinsObservability
from rotcli.srins.reciprocation import Reciprocation

KIND = "srins-observability"
# S, table 1: its largest singular values; the others as ours to the digits printed.
PUBLISHED = (52.487, 6.8877, 0.99478)
PUBLISHED_RANK = 9
REMARK = (
    "The paper's 52.487, 6.8877 and 0.99478 come from a spurious entry in its F and cannot come "
    "from a correct model. Raw singular values depend on the units of the states: rank "
    f"{PUBLISHED_RANK} at the paper's threshold {THRESHOLD:g} is a matter of SI units; the "
    "degrees 1 - sigma(T)/sigma(0) of the filter are not."
)
_MOVES = {
    "still": "still",
    "one-stop": "stops at 0",
    "two-stop": "stops at 0, 180",
}


def fields(
    result: SrinsObservability, motion: VehicleMotion, rotation: Reciprocation
) -> dict[str, Any]:
    """Return the document's own fields."""
    return {
        "model": "srins",
        "axis": "z",
        "latitude_deg": motion.latitude / units.DEG,
        "velocity_mps": [motion.v_east, motion.v_north],
        "rotation": {"rate_dps": rotation.rate / units.DEG, "dwell_s": rotation.dwell},
        "states": list(STATES),
        "singular_values": result.singular_values,
        "rank": result.rank,
        "rank_threshold": THRESHOLD,
        "true_rank": result.true_rank,
        "hours": result.hours,
        "degrees": {kind: dict(zip(STATES, result.degrees[kind], strict=True)) for kind in SCHEMES},
        "warnings": [],
    }


def singular_table(doc: Mapping[str, Any]) -> Table:
    """Return the singular values next to the paper's."""
    values = doc["singular_values"]
    published = [*PUBLISHED, *[None] * (len(values) - len(PUBLISHED))]
    return Table(
        "SRINS: singular values of the stripped observability matrix, SI units, fixed angle",
        (Column("number", "d"), Column("ours", ".4e"), Column("paper, table 1", "g")),
        [(k, v, p) for k, (v, p) in enumerate(zip(values, published, strict=True), start=1)],
        f"Rank at {doc['rank_threshold']:g}: {doc['rank']} (paper {PUBLISHED_RANK}); true rank "
        f"{doc['true_rank']}. {REMARK}",
    )


def table(doc: Mapping[str, Any]) -> Table:
    """Return the degrees of observability of the rotation schemes."""
    degrees = doc["degrees"]
    return Table(
        f"SRINS: degree of observability after {doc['hours']:g} h, 0 hidden to 1 clear",
        (Column("state"), *(Column(_MOVES[kind], ".4f") for kind in SCHEMES)),
        [(name, *(degrees[kind][name] for kind in SCHEMES)) for name in doc["states"]],
        "1 - sigma(T)/sigma(0) of the 16-state filter: free of units, but relative to its prior "
        "sigmas. Columns: no rotation; reciprocating by whole turns; by half turns.",
    )


def observability_tables(sources: Sequence[Source]) -> list[Table]:
    """Return the report's tables."""
    return [made(source.doc) for source in sources for made in (singular_table, table)]
