"""S, "Comprehensive calibration of a single-axis rotation INS with level damping"."""

from pathlib import Path
from typing import Any

import numpy as np

from rotcli.files.results.documents import read_result
from rotcli.files.results.groups import Source
from rotcli.srins.claims import claims_table
from rotcli.srins.observability_document import PUBLISHED, PUBLISHED_RANK
from tests.campaigns.papers.item import (
    AGREES,
    CONTRADICTED,
    CORRECTED,
    DIFFERS,
    IN_KIND,
    Item,
)

RUNS = {
    "cruise": ("damped", "undamped"),
    "early": ("estimated", "measured"),
    "late": ("estimated", "measured"),
    "follows": ("estimated", "measured"),
}
# Values that come from one wrong entry of the paper's F; a correct model cannot give them.
WRONG_ENTRY = ("phi_N", "gyro_bias_y", "dV_E")
_SAME = 0.006  # relative: gravity of the site, and g W cos L
_OVERSHOOT = 2.0  # factor: the phase of the rotation at the maneuver changes it that much
_PEAKS = {"early": 3.6, "late": 0.6}  # 1e-3 deg/h, of a separate prototype of S, one digit


def items_of(folder: Path) -> list[Item]:
    """Return the items of `make srins`; folder: srins/."""
    observed = read_result(str(folder / "observability.json"))
    sources = [
        Source(str(path), read_result(str(path)))
        for run, modes in RUNS.items()
        for path in (folder / run / f"{mode}.json" for mode in modes)
    ]
    docs = {Path(s.path).parent.name + "/" + Path(s.path).stem: dict(s.doc) for s in sources}
    return [
        *singular_items(observed),
        *_damping_items(docs["cruise/damped"], docs["cruise/undamped"]),
        *_convergence_items(docs["cruise/damped"]),
        *_maneuver_items(docs),
        *_claim_items(sources),
    ]


def singular_items(doc: dict[str, Any]) -> list[Item]:
    """Table 1 and figure 3: the singular values by state, and the rank."""
    ours = dict(zip(doc["singular_states"], doc["singular_values"], strict=True))
    items = []
    for state, value in PUBLISHED.items():
        same = abs(ours[state] - value) <= _SAME * value
        verdict = CORRECTED if state in WRONG_ENTRY else AGREES if same else DIFFERS
        what = f"singular value of {state}"
        items.append(Item("S table 1", what, f"{ours[state]:.5g}", f"{value:.10g}", verdict))
    rank, threshold = doc["rank"], doc["rank_threshold"]
    what = f"values above {threshold:g}"
    verdict = AGREES if rank == PUBLISHED_RANK else DIFFERS
    return [*items, Item("S figure 3", what, str(rank), str(PUBLISHED_RANK), verdict)]


def _largest(doc: dict[str, Any], *names: str) -> float:
    return float(max(np.abs(doc["ins_error"][name]).max() for name in names))


def _damping_items(damped: dict[str, Any], undamped: dict[str, Any]) -> list[Item]:
    """Figure 4: the damping removes the Schuler oscillation."""
    items = []
    for kind, unit, names in (
        ("velocity", "m/s", ("v_east_mps", "v_north_mps")),
        ("level attitude", "arcsec", ("phi_E_arcsec", "phi_N_arcsec")),
    ):
        sizes = [_largest(doc, *names) for doc in (damped, undamped)]
        verdict = IN_KIND if sizes[0] < 0.5 * sizes[1] else DIFFERS
        what = f"largest {kind} error, damped against undamped, {unit}"
        items.append(
            Item("S figure 4", what, f"{sizes[0]:.2g}, {sizes[1]:.2g}", "smaller", verdict)
        )
    ripples = [_ripple(doc) for doc in (damped, undamped)]
    verdict = IN_KIND if ripples[0] < 0.5 * ripples[1] else DIFFERS
    what = "Schuler oscillation of the position, damped against undamped, m"
    shown = f"{ripples[0]:.0f}, {ripples[1]:.0f}"
    return [*items, Item("S figure 4", what, shown, "smaller", verdict)]


def _ripple(doc: dict[str, Any]) -> float:
    """Return the RMS (m) of the north position error about its mean over 84 minutes."""
    time, north = np.array(doc["ins_error"]["time_h"]), np.array(doc["ins_error"]["north_m"])
    step = float(np.median(np.diff(time)))
    kernel = np.ones(round(1.407 / step))  # h, the Schuler period
    inside = slice(len(kernel), -len(kernel))
    smooth = np.convolve(north, kernel / kernel.size, mode="same")
    return float(np.std((north - smooth)[inside]))


def _convergence_items(doc: dict[str, Any]) -> list[Item]:
    """Figures 5 and 6: drifts and biases converge to the truth."""
    items = []
    for figure, names, unit, scale in (
        ("S figure 5", ("gyro_bias_y", "gyro_bias_z"), "1e-3 deg/h", 1e3),
        ("S figure 6", ("accel_bias_x", "accel_bias_y"), "ug", 1.0 / 9.80665e-6),
    ):
        for name in names:
            q, true = doc["estimates"][name], doc["truth"][name]
            known = abs(doc["expected_bias"]["value"]) if name.startswith("gyro") else 2.0 / scale
            same = abs(q["value"] - true) < 3.0 * q["sigma"] + known
            shown = f"{scale * q['value']:.2f} (sigma {scale * q['sigma']:.2f})"
            what = f"{name} after ten hours, {unit}"
            verdict = AGREES if same else DIFFERS
            items.append(Item(figure, what, shown, f"{scale * true:.2f} (stated)", verdict))
    return items


def _maneuver_items(docs: dict[str, dict[str, Any]]) -> list[Item]:
    """Figures 7 to 9: overshoot of the axial drift, of the level drifts, of the attitude."""
    items = []
    for run, figure in (("late", "S figure 7"), ("early", "S figure 8")):
        peaks = {
            name: _peak(docs[f"{run}/estimated"], docs["follows/estimated"], name)
            for name in ("gyro_bias_x", "gyro_bias_z")
        }
        ours, paper = 1e3 * peaks["gyro_bias_z"], _PEAKS[run]
        same = 1.0 / _OVERSHOOT < ours / paper < _OVERSHOOT
        what = f"{run} maneuver: overshoot of gyro_bias_z, 1e-3 deg/h"
        verdict = IN_KIND if same else DIFFERS
        items.append(Item(figure, what, f"{ours:.2f}", f"about {paper:g} expected", verdict))
        factor = peaks["gyro_bias_x"] / peaks["gyro_bias_z"]
        what = f"{run} maneuver: overshoot of x over that of z"
        verdict = IN_KIND if factor > 10.0 else DIFFERS
        items.append(Item(figure, what, f"{factor:.0f} times", "tens of times", verdict))
    peak = _peak(docs["early/estimated"], docs["follows/estimated"], "phi_N", "true")
    end = np.abs(docs["early/estimated"]["history"]["phi_N"]["true"][-1])
    verdict = IN_KIND if peak > 5.0 * end else DIFFERS
    what = "early maneuver: phi_N at most, at the end, arcsec"
    return [*items, Item("S figure 9", what, f"{peak:.0f}, {end:.0f}", "fades", verdict)]


def _peak(doc: dict[str, Any], other: dict[str, Any], name: str, key: str = "estimate") -> float:
    """Return the largest difference to a run of the same noise, from the maneuver on."""
    after = np.array(doc["history"]["time_h"]) > doc["maneuvers_h"][0]
    mine, theirs = (np.array(d["history"][name][key]) for d in (doc, other))
    return float(np.abs(mine - theirs)[after].max())


def _claim_items(sources: list[Source]) -> list[Item]:
    """The claims of the text, judged from the results."""
    items = []
    for claim, supported, found in claims_table(sources).rows:
        verdict = AGREES if supported == "yes" else CONTRADICTED
        items.append(Item("S claims", str(claim), str(found), "stated", verdict))
    return items
