"""The published values that results are shown next to: rotcli/data/published_r16.toml."""

import math
import tomllib
from collections.abc import Mapping
from functools import cache
from typing import Any

from rotcli.dataclass import dataclass
from rotcli.files.installed import DATA


@dataclass(frozen=True)
class Published:
    """What R16 says of one IMU.

    source: the table of the conventional run. rms: mode to RMS by JSON key (m, m/s, deg); one
    run for `conventional`, the mean of ten rates else. bias_dph: deg/h, and scale_ppm by rate
    (deg/s): 1-sigma calibration errors caused by noise. lowest: cluster time (s) and value (deg/h)
    of the lowest Allan deviation of gyro x, figure 6.
    """

    source: str
    rms: Mapping[str, Mapping[str, float]]
    bias_dph: float
    scale_ppm: Mapping[float, float]
    lowest: tuple[float, float] | None = None


@dataclass(frozen=True)
class PublishedConditions:
    """What the published figures hold for: axis, navigation time (s), number of rates.

    across_dps, along_dps: bounds of the mean gyro output after calibration (table 7), deg/s.
    """

    axis: str
    duration_s: float
    rates: int
    across_dps: float
    along_dps: float


@cache
def _data() -> dict[str, Any]:
    text = (DATA / "published_r16.toml").read_text("utf-8")
    return tomllib.loads(text)


def cited(title: str, source: str, published: bool) -> str:
    """Return a title, with the table or figure of the paper that it repeats where one compares.

    >>> cited("Gyro output", "R16 table 7", True), cited("Gyro output", "R16 table 7", False)
    ('Gyro output (R16 table 7)', 'Gyro output')
    """
    return f"{title} ({source})" if published else title


@cache
def set_up() -> PublishedConditions:
    """Return the set-up behind the published figures."""
    data = _data()
    return PublishedConditions(
        data["axis"], data["duration_s"], data["rates"], **data["mean_after"]
    )


@cache
def published(imu: str) -> Published | None:
    """Return what is published of an IMU, or None; case and signs of the name do not matter.

    >>> published("mti-g").bias_dph
    23.2
    >>> published("my own IMU") is None
    True
    """
    for name, entry in _data()["imu"].items():
        if _plain(name) == _plain(imu):
            rms = {mode: dict(entry[mode]) for mode in ("conventional", "partial", "full")}
            still = rms["conventional"]
            still["horizontal_m"] = math.hypot(still["latitude_m"], still["longitude_m"])
            still["horizontal_mps"] = math.hypot(still["v_north_mps"], still["v_east_mps"])
            noise = entry["noise"]
            scale = dict(zip(noise["rates_dps"], noise["scale_ppm"], strict=True))
            lowest = (noise["lowest_tau_s"], noise["lowest_dph"])
            return Published(entry["table"], rms, noise["bias_dph"], scale, lowest)
    return None


def _plain(name: str) -> str:
    return "".join(letter for letter in name.casefold() if letter.isalnum())
