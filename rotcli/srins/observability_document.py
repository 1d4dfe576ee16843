"""Observability of an SRINS as a result document and tables, compared with the paper's table 1."""

from collections.abc import Mapping, Sequence
from typing import Any

from rotcli import units
from rotcli.files.results.groups import Source
from rotcli.files.tables import Column, Table, drop_empty_columns
from rotcli.srins.model import STATES, VehicleMotion
from rotcli.srins.observability import SCHEMES, THRESHOLD, SrinsObservability
from rotcli.srins.reciprocation import RotationScheme

KIND = "srins-observability"
# S, table 1: the nine singular values above its threshold, by state. The paper names the states of
# all but the three values near 1, which are those of the states that remain.
PUBLISHED = {
    "phi_N": 52.487,
    "gyro_bias_x": 9.8039,
    "phi_E": 9.8039,
    "gyro_bias_y": 6.8877,
    "dV_N": 1.0,
    "d_latitude": 1.0,
    "d_longitude": 0.9999999988,
    "dV_E": 0.99478,
    "gyro_bias_z": 5.294e-4,
}
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
    result: SrinsObservability, motion: VehicleMotion, rotation: RotationScheme
) -> dict[str, Any]:
    """Return the fields of the document."""
    return {
        "model": "srins",
        "axis": "z",
        "latitude_deg": motion.latitude / units.DEG,
        "velocity_mps": [motion.v_east, motion.v_north],
        "rotation": {"rate_dps": rotation.rate / units.DEG, "dwell_s": rotation.dwell},
        "states": list(STATES),
        "singular_values": result.singular_values,
        "singular_states": list(result.singular_states),
        "rank": result.rank,
        "rank_threshold": THRESHOLD,
        "true_rank": result.true_rank,
        "hours": result.hours,
        "degrees": {kind: dict(zip(STATES, result.degrees[kind], strict=True)) for kind in SCHEMES},
        "warnings": [],
    }


def singular_table(doc: Mapping[str, Any], *, published: bool = True) -> Table:
    """Return the singular values with their states; published: and those of the paper."""
    values = doc["singular_values"]
    states = doc.get("singular_states") or [None] * len(values)
    rows = [
        (k, state, value, PUBLISHED.get(state) if published else None)
        for k, (state, value) in enumerate(zip(states, values, strict=True), start=1)
    ]
    note = f"Rank at {doc['rank_threshold']:g}: {doc['rank']}"
    note += f" (paper {PUBLISHED_RANK})" if published else ""
    note += f"; true rank {doc['true_rank']}." + (f" {REMARK}" if published else "")
    return drop_empty_columns(
        "SRINS: singular values of the stripped observability matrix, SI units, fixed angle",
        (
            Column("number", "d"),
            Column("state"),
            Column("ours" if published else "singular value", ".4e"),
            Column("paper, table 1", ".10g"),
        ),
        rows,
        note,
    )


def table(doc: Mapping[str, Any]) -> Table:
    """Return the degrees of observability of the rotation schemes."""
    degrees = doc["degrees"]
    return Table(
        f"SRINS: degree of observability after {doc['hours']:g} h, 0 = unobservable, 1 = full",
        (Column("state"), *(Column(_MOVES[kind], ".4f") for kind in SCHEMES)),
        [(name, *(degrees[kind][name] for kind in SCHEMES)) for name in doc["states"]],
        "1 - sigma(T)/sigma(0) of the 16-state filter: independent of units, but relative to the "
        "initial sigmas. Columns: no rotation; reciprocating by full turns; by half turns.",
    )


def observability_tables(sources: Sequence[Source], *, published: bool = False) -> list[Table]:
    """Return the report's tables."""
    return [
        made
        for source in sources
        for made in (singular_table(source.doc, published=published), table(source.doc))
    ]
