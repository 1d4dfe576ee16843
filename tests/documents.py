"""Small result documents, every figure put in by hand."""

import json

from rotcli.files.results.groups import Source

LOG = {"path": "logs/imu.parquet", "sha256": "ab" * 32, "rows": 42001, "start_s": 0, "end_s": 420}


def document(kind, imu, table_axis="z", **own):
    rig = {"site": {"latitude": 51.08}, "imu": {"name": imu}, "table": {"axis": table_axis}}
    if imu is None:
        del rig["imu"]
    return {"kind": kind, "schema": 1, "rotcli": "0.1.0", "inputs": [LOG], "rig": rig, **own}


def navigation(imu, mode, rate, north, east, azimuth=1.0, *, axis="z", duration=300.0, warnings=()):
    """Return a navigation document: north, east RMS in m, velocities a hundredth of them."""
    rms = {
        "latitude_m": north,
        "longitude_m": east,
        "height_m": 7.0,
        "v_north_mps": north / 100,
        "v_east_mps": east / 100,
        "v_up_mps": 0.07,
        "pitch_deg": 0.1,
        "roll_deg": 0.2,
        "azimuth_deg": azimuth,
        "horizontal_m": (north**2 + east**2) ** 0.5,
        "horizontal_mps": (north**2 + east**2) ** 0.5 / 100,
    }
    return document(
        "navigation",
        imu,
        axis,
        mode=mode,
        rate={"value": rate, "sigma": None, "unit": "deg/s"},
        duration_s=duration,
        rms=rms,
        final=rms,
        max=rms,
        warnings=list(warnings),
    )


def calibration(imu, rate, *, sigma_bias=2.0, sigma_scale=30.0, mean=None, axis="z", shift=0.0):
    """Return a calibration document about an axis x or z."""
    names = {"z": ("Kgxz", "Kgyz", "Kgz"), "x": ("Kgx", "Kgyx", "Kgzx")}[axis]
    biases = {
        f"bias_{a}": {"value": 10.0 * k + shift, "sigma": sigma_bias, "unit": "deg/h"}
        for k, a in enumerate("xyz")
    }
    column = {
        name: {"value": 100.0 * k + shift, "sigma": sigma_scale, "unit": "ppm"}
        for k, name in enumerate(names)
    }
    mean = mean or {"z": (0.0, 0.0, rate), "x": (rate, 0.0, 0.0)}[axis]
    return document(
        "calibration",
        imu,
        axis,
        axis=axis,
        rate={"value": rate, "sigma": None, "unit": "deg/s"},
        parameters={**biases, **column},
        predicted_sigma={
            "bias": {"value": 3.1, "sigma": None, "unit": "deg/h"},
            "scale": {"value": 86.1, "sigma": None, "unit": "ppm"},
        },
        mean_after={
            a: {"value": m, "sigma": None, "unit": "deg/s"}
            for a, m in zip("xyz", mean, strict=True)
        },
        warnings=[],
    )


def allan(imu):
    tau = [1.0, 10.0, 100.0]
    axes = {
        f"{sensor}_{a}": {
            "tau_s": tau,
            "deviation": [10.0, 3.0, 1.0],
            "lower": [9.0, 2.5, 0.5],
            "upper": [11.0, 3.5, None],
            "unit": unit,
            "coefficients": {
                "quantization": {"value": None, "sigma": None, "unit": quantum},
                "random_walk": {"value": 0.25, "sigma": 0.01, "unit": walk},
            },
            "minimum": {"tau_s": 100.0, "deviation": 1.0},
        }
        for sensor, unit, quantum, walk in (
            ("gyro", "deg/h", "arcsec", "deg/sqrt(h)"),
            ("accel", "m/s^2", "m/s", "m/s/sqrt(h)"),
        )
        for a in "xyz"
    }
    return document("allan", imu, axes=axes, warnings=[])


def sources(*docs):
    return [Source(f"{k}.json", doc) for k, doc in enumerate(docs)]


def write(folder, *docs):
    """Write documents as 0.json, 1.json … and return their paths."""
    paths = []
    for k, doc in enumerate(docs):
        paths.append(str(folder / f"{k}.json"))
        (folder / f"{k}.json").write_text(json.dumps(doc))
    return paths


def small_campaign(imu="NAV440"):
    """Two still runs and two rates in both modes; partial 500 m, full 250 m, still 1000 m."""
    return [
        navigation(imu, "conventional", 0.0, 300.0, 400.0),
        navigation(imu, "conventional", 0.0, 900.0, 1200.0),
        *(navigation(imu, "partial", r, 300.0, 400.0, r / 10.0) for r in (10.0, 20.0, 30.0)),
        *(navigation(imu, "full", r, 150.0, 200.0, 0.5) for r in (10.0, 20.0, 30.0)),
        *(calibration(imu, r) for r in (10.0, 20.0)),
    ]


def rows(table):
    """Return a table's rows as dictionaries by heading."""
    return [dict(zip(table.headings, row, strict=True)) for row in table.rows]
