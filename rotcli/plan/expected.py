"""Expected RMS of a navigation with the planned IMU: what accuracy the test can lead to.

R16's run (still, turning, 300 s of navigation about the vertical axis) with the noise figures of
the rig, at the largest rate of the plan: conventional, with biases only (the axis column known to
scale_sigma), and fully calibrated.
"""

from typing import Any

import numpy as np

from rotcli.files.tables import Cell, Column, Table
from rotcli.models.earth import gravity_at
from rotcli.models.expected.motion import StillTable, TooManyBlocksError
from rotcli.models.expected.plan import Mode, PlannedSensors, planned_errors
from rotcli.models.expected.statistics import validity_limits
from rotcli.rig.noise_sources import accel_noise, gyro_noise, missing_figures
from rotcli.rig.rig import DEFAULT_SITE, Rig
from rotcli.units import DEG

DURATION = 300.0  # s, R16 section 4
_MODES: tuple[Mode, ...] = ("conventional", "partial", "full")


def expected_fields(rig: Rig, max_rate: float) -> dict[str, Any]:
    """Return the expected RMS of each mode, or the reason why there is none; max_rate: deg/s."""
    missing = missing_figures(rig.imu)
    if missing:
        return {"reason": f"[imu] lacks {', '.join(missing)}", "runs": []}
    site = rig.site or DEFAULT_SITE
    gravity = gravity_at(site.latitude, site.height, site.gravity)
    table = StillTable(site.latitude, site.height, gravity)
    prior = rig.imu.figure("scale_sigma")
    sensors = PlannedSensors(
        gyro=tuple(gyro_noise(rig.imu)),
        accel=tuple(accel_noise(rig.imu)),
        matrix=np.zeros((3, 3)),
        matrix_sigma=0.0 if prior is None else float(np.max(prior)),
    )
    runs = [_run(sensors, table, mode, max_rate) for mode in _MODES]
    if prior is None:
        runs[1] = {"mode": "partial", "reason": "[imu] scale_sigma is missing"}
    return {"reason": None, "duration_s": DURATION, "rate_dps": max_rate, "runs": runs}


def _run(sensors: PlannedSensors, table: StillTable, mode: Mode, rate: float) -> dict[str, Any]:
    """Return the expected RMS of one mode, or why there is none."""
    try:
        errors = planned_errors(sensors, table, mode, rate * DEG, DURATION)
    except TooManyBlocksError as error:
        return {"mode": mode, "reason": str(error)}
    limit = next((limit for limit in validity_limits(errors) if limit), "")
    if limit:
        return {"mode": mode, "reason": limit}
    rms = errors.rms
    return {
        "mode": mode,
        "reason": None,
        "horizontal_m": float(rms[9]),
        "horizontal_mps": float(rms[10]),
        "pitch_deg": float(rms[6]) / DEG,
        "azimuth_deg": float(rms[8]) / DEG,
    }


def expected_table(fields: dict[str, Any]) -> list[Table]:
    """Return the expected RMS as a table; none where nothing is known."""
    if not fields.get("runs"):
        return []
    keys = ("horizontal_m", "horizontal_mps", "pitch_deg", "azimuth_deg")
    rows: list[tuple[Cell, ...]] = [
        (run["mode"], *(run.get(key) for key in keys)) for run in fields["runs"]
    ]
    columns = (
        Column("mode"),
        Column("position, m", ".1f"),
        Column("velocity, m/s", ".2f"),
        Column("pitch, deg", ".3f"),
        Column("azimuth, deg", ".3f"),
    )
    reasons = [f"{run['mode']}: {run['reason']}." for run in fields["runs"] if run["reason"]]
    note = "Noise figures of the rig; still 60 s, turning 60 s about the vertical, navigation."
    title = f"Expected RMS over {fields['duration_s']:g} s at {fields['rate_dps']:g} deg/s"
    return [Table(title, columns, rows, " ".join([note, *reasons]))]
