"""Odd logs of one known recording: dialects, names, units, kinds of time, preambles."""

import datetime
import gzip
from dataclasses import dataclass

import numpy as np

DEG = np.pi / 180
G = 9.80665
COUNT = 240
RATE = 100.0
AXES = tuple(f"{s}_{a}" for s in ("gyro", "accel") for a in "xyz")

NAMES = {
    "rotcli": ("gyro_{}", "accel_{}", "xyz"),
    "short": ("w{}", "a{}", "xyz"),
    "g and a": ("g{}", "a{}", "xyz"),
    "camel": ("Gyro{}", "Acc{}", "XYZ"),
    "Xsens": ("Gyr_{}", "Acc_{}", "XYZ"),
    "ROS": ("angular_velocity.{}", "linear_acceleration.{}", "xyz"),
    "words": ("Gyroscope {}", "Accelerometer {}", "XYZ"),
    "axis first": ("{} Gyro", "{} Accel", "XYZ"),
    "numbers": ("gyro[{}]", "accel[{}]", "012"),
    "prefixed": ("imu.gyro.{}", "imu.accel.{}", "xyz"),
    "omega": ("omega_{}", "f_{}", "xyz"),
}
GYRO_UNITS = {"rad/s": 1.0, "deg/s": DEG, "dps": DEG, "mdps": DEG / 1000, "deg/sec": DEG}
ACCEL_UNITS = {"m/s^2": 1.0, "g": G, "mg": G / 1000, "m/s2": 1.0, "m.s-2": 1.0}
PREAMBLES = {
    "none": [],
    "excel": ["sep={}"],
    "comments": ["# Logger 3000", "# rate = 100.0 Hz", ""],
    "vendor": ["FILE_INFO", "Model,3DM", "", "DATA_START"],
    "text": ["Recorded by hand", "unit 17"],
}
TIMES = (
    "s", "ms", "us", "epoch s", "epoch ms", "epoch us", "epoch ns", "iso", "iso blank", "iso z",
    "hms", "split", "week", "none", "counter", "wrap", "restart", "coarse", "repeated", "jitter",
)  # fmt: skip
EPOCH = 1_700_000_000


@dataclass(frozen=True)
class OddLog:
    """A log and the truth: bytes, kind of time, true gyro and accel (n, 3) SI, what is odd."""

    content: bytes
    time: str
    gyro: np.ndarray
    accel: np.ndarray
    what: dict


def recording(rng):
    """A still IMU with noise, its z axis up: gyro (n, 3) rad/s, accel (n, 3) m/s^2."""
    gyro = rng.normal([0.01, -0.02, 0.005], 0.003, (COUNT, 3))
    accel = rng.normal([0.1, -0.2, 9.79], 0.02, (COUNT, 3))
    return gyro, accel


def time_columns(kind, rng, names):
    """Names and cells of the time's columns."""
    t = np.arange(COUNT) / RATE
    k = np.arange(COUNT)
    name = str(rng.choice(["time", "t", "timestamp", "Time"]))
    if kind in ("s", "ms", "us"):
        size = {"s": 1.0, "ms": 1e3, "us": 1e6}[kind]
        bracket = f" [{kind}]" if rng.random() < 0.5 or kind == "s" else f" ({kind})"
        return [name + bracket], [[f"{v * size:.10g}" for v in t]]
    if kind.startswith("epoch"):
        unit = kind.split()[1]
        power = {"s": 0, "ms": 3, "us": 6, "ns": 9}[unit]
        nano = EPOCH * 10**9 + k * 10_000_000
        cells = [f"{n / 1e9:.3f}" if power == 0 else str(n // 10 ** (9 - power)) for n in nano]
        return [name], [cells]
    if kind in ("iso", "iso blank", "iso z"):
        start = datetime.datetime(2024, 3, 5, 12, 0, 0)
        sign, end = ("T", "") if kind == "iso" else (" ", "") if kind == "iso blank" else ("T", "Z")
        stamps = [start + datetime.timedelta(microseconds=int(i) * 10_000) for i in k]
        return [name], [[s.strftime(f"%Y-%m-%d{sign}%H:%M:%S.%f") + end for s in stamps]]
    if kind == "hms":
        return [name], [[f"10:{int(v // 60):02d}:{v % 60:06.3f}" for v in t]]
    if kind == "split":
        pair = ["sec", "nanosec"] if rng.random() < 0.5 else ["stamp.sec", "stamp.nanosec"]
        return pair, [[str(EPOCH + i // 100) for i in k], [str((i % 100) * 10_000_000) for i in k]]
    if kind == "week":
        return ["GPS Week", "GPS TOW"], [["2300"] * COUNT, [f"{1000 + v:.2f}" for v in t]]
    if kind == "none":
        return [], []
    if kind == "counter":
        return [str(rng.choice(["sample", "Packet number", "counter", "n_samples"]))], [
            [str(i + 17) for i in k]
        ]
    if kind == "wrap":
        ticks = (2**32 - 1_000_000 + k * 10_000) % 2**32
        return ["time [us]"], [[str(i) for i in ticks]]
    if kind == "restart":
        cells = np.where(k < COUNT // 2, t, (k - COUNT // 2) / RATE + 0.003)
        return ["time [s]"], [[f"{v:.3f}" for v in cells]]
    if kind == "coarse":
        return ["time [s]"], [[f"{np.floor(v * 2) / 2:.1f}" for v in t]]
    if kind == "repeated":
        cells = t.copy()
        for i in range(20, COUNT, 60):
            cells[i] = cells[i - 1]
        return ["time [s]"], [[f"{v:.2f}" for v in cells]]
    late = t + np.abs(rng.normal(0.0, 0.003, COUNT))
    return ["time [s]"], [[f"{v:.5f}" for v in np.maximum.accumulate(late) + 1e-6 * k]]


_UNIT_OF_A_NAME = {"square": " [{}]", "round": " ({})", "ending": "_{}"}


def odd_log(seed):
    """One odd log."""
    rng = np.random.default_rng(seed)
    gyro, accel = recording(rng)
    style = str(rng.choice(list(NAMES)))
    kind = TIMES[seed % len(TIMES)]
    delimiter = str(rng.choice([",", ";", "\t", "|"] + ([" "] if "blank" not in kind else [])))
    comma = delimiter != "," and rng.random() < 0.4 and not kind.startswith("epoch s")
    preamble = str(rng.choice(list(PREAMBLES)))
    units = str(rng.choice(["square", "round", "row", "ending", "none"]))
    gyro_unit, accel_unit = str(rng.choice(list(GYRO_UNITS))), str(rng.choice(list(ACCEL_UNITS)))
    if units == "ending":
        gyro_unit, accel_unit = ("dps", "g") if rng.random() < 0.5 else ("rad_s", "mps2")
    if units == "none" or style == "numbers":
        units, gyro_unit = "none", "rad/s"
        accel_unit = str(rng.choice(["m/s^2", "g"]))
    if delimiter == " " and (style in ("words", "axis first") or units in ("square", "round")):
        delimiter = "\t"
    sizes = {"rad_s": 1.0, "mps2": 1.0, **GYRO_UNITS, **ACCEL_UNITS}
    gyro_name, accel_name, letters = NAMES[style]
    names, cells = time_columns(kind, rng, style)
    for pattern, unit, values in ((gyro_name, gyro_unit, gyro), (accel_name, accel_unit, accel)):
        for k, letter in enumerate(letters):
            names.append(pattern.format(letter) + _UNIT_OF_A_NAME.get(units, "").format(unit))
            cells.append([f"{v:.12g}" for v in values[:, k] / sizes[unit]])
    if delimiter == " ":
        names = [name.replace(" ", "_") for name in names]
        cells = [[cell.replace(" ", "T") for cell in column] for column in cells]
    if rng.random() < 0.4:
        names, cells = [*names, "state"], [*cells, ["0"] * COUNT]
    rows = [delimiter.join(row) for row in zip(*cells, strict=True)]
    if comma:
        rows = [row.replace(".", ",") if kind not in ("iso", "iso blank", "iso z", "hms") else row
                for row in rows]  # fmt: skip
        comma = kind not in ("iso", "iso blank", "iso z", "hms")
    end = delimiter if rng.random() < 0.2 and delimiter not in " \t" else ""
    head = [line.format(delimiter) for line in PREAMBLES[preamble]]
    if preamble == "excel" and delimiter in " \t":
        head = []
    lines = [*head, delimiter.join(names) + (end if rng.random() < 0.5 else "")]
    if units == "row":
        extra = len(names) - 6 - (names[-1] == "state")
        row = ["s" if kind == "s" else "-"] * extra + [gyro_unit] * 3 + [accel_unit] * 3
        lines.append(delimiter.join(row + ["-"] * (len(names) - len(row))))
    ending = str(rng.choice(["\n", "\r\n"]))
    text = ending.join([*lines, *(row + end for row in rows), ""])
    encoding = str(rng.choice(["utf-8", "utf-8", "utf-8-sig", "utf-16"]))
    content = text.encode(encoding)
    content = gzip.compress(content) if rng.random() < 0.2 else content
    what = {
        "seed": seed, "names": style, "time": kind, "delimiter": delimiter, "comma": comma,
        "preamble": preamble, "units": (units, gyro_unit, accel_unit), "encoding": encoding,
        "end": end,
    }  # fmt: skip
    return OddLog(content, kind, gyro, accel, what)
