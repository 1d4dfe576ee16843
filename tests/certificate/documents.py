"""A complete characterisation of one device, as the commands write it, for certificates."""

import copy
from typing import Any

from rotcli.models.triad import parameters as p
from tests.export import documents as base

UNIT = {
    "serial": "SN0001",
    "date": "2026-03-02",
    "operator": "A. Operator",
    "place": "Laboratory 3",
    "customer": "Example Ltd",
    "order_number": "4711",
}
LOGS = [
    {"path": "logs/imu.parquet", "sha256": "1" * 64, "rows": 6000, "start_s": 0.0, "end_s": 60.0},
    {"path": "logs/table.parquet", "sha256": "2" * 64, "rows": 3000, "start_s": 0.0, "end_s": 60.0},
]


def _with_unit(doc: dict[str, Any], date: str = UNIT["date"]) -> dict[str, Any]:
    made = copy.deepcopy(doc)
    return {**made, "rotcli": "0.1.0", "unit": {**UNIT, "date": date}, "inputs": LOGS}


def allan(date: str = UNIT["date"]) -> dict[str, Any]:
    doc = _with_unit(base.allan()[1], date)
    for k, (axis, entry) in enumerate(doc["axes"].items()):
        entry["unit"] = "deg/h" if axis.startswith("gyro") else "ug"
        entry["tau_s"] = [0.01 * 2**n for n in range(18)]
        entry["deviation"] = [(100.0 + 5 * k) / 2 ** (0.5 * n) + 10.0 for n in range(18)]
        for c in entry["coefficients"].values():
            c["sigma"] = None if c["value"] is None else 0.02 * c["value"]
            c["si"] = {"value": c["value"], "sigma": None, "unit": "SI"}
    return doc


def triad(date: str = UNIT["date"], shift: float = 0.0) -> dict[str, Any]:
    """Return a triad document with every parameter of the device and of the table."""
    doc = _with_unit(base.triad()[1], date)
    doc["equation"] = "f = (I + M)^-1 (accel - b), w = (I + N)^-1 (gyro - d - G f)"
    for k, (name, unit) in enumerate(zip(p.NAMES, p.unit_names(), strict=True)):
        value = doc["parameters"].get(name, base.quantity(3.0 * k - 40.0, 2.0, unit))["value"]
        doc["parameters"][name] = base.quantity(value + shift, 15.0 if unit == "ppm" else 4.0, unit)
    doc["parameters"]["Ka2_z"] = {
        **base.quantity(None, None, "ug/g^2"),
        "status": "null",
        "reason": "sigma exceeds 0.3 of the typical size",
    }
    return doc


def scale(date: str = UNIT["date"]) -> dict[str, Any]:
    """Return a scale document with the figures that a certificate shows."""

    def channel(linear: bool) -> dict[str, Any]:
        return {
            "linear": linear,
            "scale": base.quantity(1200.0, 29.5, "ppm"),
            "asymmetry": base.quantity(12.0, 20.0, "ppm"),
            "hysteresis": base.quantity(5.0, 13.0, "deg/h"),
            "nonlinearity": {
                **base.quantity(41.0, 15.0, "ppm of full scale"),
                "raw_limit_95": 65.0,
            },
            "offset_own_span": base.quantity(59.0, 8.0, "deg/h"),
            "residuals": [
                {"rate_dps": float(r), "residual_dph": (r * 37) % 11 - 5.0}
                for r in range(-100, 101, 20)
            ],
        }

    return {
        **_with_unit(base.triad()[1], date),
        "model": "scale",
        "equation": "gyro = w + d + e(u.w)",
        "parameters": {"bias_z": base.quantity(60.0, 14.0, "deg/h")},
        "channels": {"x": channel(True), "y": channel(True), "z": channel(False)},
        "misalignment": {**base.quantity(1360.0, 40.0, "urad"), "limit": None},
        "horizon": {"start_s": 424.0, "end_s": 724.0},
        "warnings": ["the sigmas contain white noise only"],
    }


def thermal(date: str = UNIT["date"]) -> dict[str, Any]:
    return _with_unit(base.thermal()[1], date)
