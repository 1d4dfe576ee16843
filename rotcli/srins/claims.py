"""The claims of the level-damping paper ("S"), each with what the results of a report show."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rotcli.files.results.groups import Source
from rotcli.files.tables import Column, Table

AXIAL = "gyro_bias_z"
LEVEL = ("gyro_bias_x", "gyro_bias_y")
_LATE = 0.4  # of the filter's duration: S has maneuvers after 15 % and 45 % of its ten hours
_SAME = 0.01  # relative difference of two sigmas that are the same
_LASTING = 1.0  # sigma of the estimate: an offset below it does not last
_REAL = 3.0  # sigma by which an estimated drift differs from 0

Doc = Mapping[str, Any]


def claims_table(sources: Sequence[Source]) -> Table:
    """Return the claims with a verdict, computed from the results; a dash where they are absent."""
    docs = [source.doc for source in sources]
    rows = [(claim, *(judge(docs) or (None, None))) for claim, judge in _CLAIMS]
    return Table(
        "SRINS: claims of the paper, and what these results show",
        (Column("claim"), Column("supported"), Column("found here")),
        rows,
        "Gyro drifts in 1e-3 deg/h. A maneuver disturbs the estimates where the speed reference "
        "does not follow it; measured damping states remove most of that. A dash: no such results.",
    )


def _cruises(docs: Sequence[Doc], mode: str = "damped") -> list[Doc]:
    return [doc for doc in docs if doc["mode"] == mode and not len(doc["maneuvers_h"])]


def _maneuvers(docs: Sequence[Doc], *, late: bool) -> list[Doc]:
    """Return the runs whose first maneuver is late, or early."""
    found = []
    for doc in docs:
        if len(doc["maneuvers_h"]):
            span = doc["filter"]["end_s"] - doc["filter"]["start_s"]
            if (doc["maneuvers_h"][0] * 3600.0 > _LATE * span) == late:
                found.append(doc)
    return found


def _last(doc: Doc, name: str = AXIAL) -> tuple[float, float]:
    """Return estimate and sigma at the end, 1e-3 deg/h."""
    q = doc["estimates"][name]
    return 1e3 * q["value"], 1e3 * q["sigma"]


def _true(doc: Doc, name: str = AXIAL) -> float | None:
    value = (doc.get("truth") or {}).get(name)
    return None if value is None else 1e3 * value


def _verdict(supported: bool) -> str:
    return "yes" if supported else "no"


def _damping_is_small(docs: Sequence[Doc]) -> tuple[str, str] | None:
    damped, undamped = _cruises(docs), _cruises(docs, "undamped")
    if not damped or not undamped:
        return None
    peaks = [
        max(np.abs(doc["ins_error"][name]).max() for name in ("v_east_mps", "v_north_mps"))
        for doc in (damped[0], undamped[0])
    ]
    text = f"largest velocity error {peaks[0]:.2g} m/s damped, {peaks[1]:.2g} m/s undamped"
    return _verdict(peaks[0] < 0.5 * peaks[1]), text


def _accurate(docs: Sequence[Doc]) -> tuple[str, str] | None:
    damped = _cruises(docs)
    true = _true(damped[0]) if damped else None
    if true is None:
        return None
    value, sigma = _last(damped[0])
    bias = 1e3 * damped[0]["expected_bias"]["value"]
    text = (
        f"{value:.2f}, true {true:.2f}; sigma {sigma / abs(true):.0%}, uncalibrated errors "
        f"{bias / abs(true):.0%}"
    )
    return _verdict(abs(value - true) < 2.0 * sigma + bias), text


def _needs_damping(docs: Sequence[Doc]) -> tuple[str, str] | None:
    damped, undamped = _cruises(docs), _cruises(docs, "undamped")
    if not damped or not undamped:
        return None
    with_it, without = _last(damped[0])[1], _last(undamped[0])[1]
    text = f"sigma {with_it:.4f} with damping, {without:.4f} without"
    return _verdict(without > (1.0 + _SAME) * with_it), text


def _early_offset(docs: Sequence[Doc]) -> tuple[str, str] | None:
    offsets = [
        abs(value - true) / sigma
        for doc in _maneuvers(docs, late=False)
        for (value, sigma), true in [(_last(doc), _true(doc))]
        if true is not None
    ]
    if not offsets:
        return None
    text = f"at the end off by {max(offsets):.1f} sigma at most"
    return _verdict(max(offsets) > _LASTING), text


def _late_faster(docs: Sequence[Doc]) -> tuple[str, str] | None:
    late = _maneuvers(docs, late=True)
    other = [*_cruises(docs), *_maneuvers(docs, late=False)]
    if not late or not other:
        return None
    sigma = [min(_last(doc)[1] for doc in group) for group in (late, other)]
    text = f"sigma at the end {sigma[0]:.4f}, in the other runs {sigma[1]:.4f}"
    return _verdict(sigma[0] < (1.0 - _SAME) * sigma[1]), text


def _equivalents(docs: Sequence[Doc]) -> tuple[str, str] | None:
    damped = _cruises(docs)
    if not damped:
        return None
    texts, real = [], False
    for name in LEVEL:
        value, sigma = _last(damped[0], name)
        real = real or abs(value) > _REAL * sigma
        texts.append(f"{name[-1]} {value:.2f} (sigma {sigma:.2f})")
    true = _true(damped[0], LEVEL[0])
    known = "" if true is None else f", true {true:.2f} in the sensor frame"
    return _verdict(not real), ", ".join(texts) + known


_CLAIMS = (
    ("damping keeps the velocity errors small", _damping_is_small),
    ("the drift along the axis is estimated accurately", _accurate),
    ("the estimate of the drift needs the damping", _needs_damping),
    ("an early maneuver leaves a lasting offset", _early_offset),
    ("a late maneuver speeds up convergence", _late_faster),
    ("the estimates of the x and y drifts are modulated equivalents", _equivalents),
)
