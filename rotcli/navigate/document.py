"""A navigated window as a result document, as a table and as a time series."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rotcli.files.documents import quantity
from rotcli.files.tables import Column, Table
from rotcli.units import DEG

if TYPE_CHECKING:  # a report reads results only: the stage need not be imported
    from rotcli.navigate.estimate import Navigation, Summary

Array = NDArray[np.float64]

KIND = "navigation"
# JSON key of each error, in the order of rotcli.navigate.estimate.ERROR_NAMES, and its unit.
KEYS = {
    "latitude_m": 1.0,
    "longitude_m": 1.0,
    "height_m": 1.0,
    "v_north_mps": 1.0,
    "v_east_mps": 1.0,
    "v_up_mps": 1.0,
    "pitch_deg": DEG,
    "roll_deg": DEG,
    "azimuth_deg": DEG,
}


def fields(result: "Summary") -> dict[str, Any]:
    """Return the document's own fields: errors in m, m/s and deg."""
    start, end = (float(t) for t in result.time)
    return {
        "mode": result.mode,
        "rate": quantity(result.rate / DEG, None, "deg/s"),
        "duration_s": end - start,
        "window": {"start_s": start, "end_s": end},
        "rms": _figures(result.errors.rms),
        "final": _figures(result.errors.final),
        "max": _figures(result.errors.max),
    }


def _figures(errors: Array) -> dict[str, float]:
    keys = {**KEYS, "horizontal_m": 1.0, "horizontal_mps": 1.0}
    return {key: float(e) / unit for (key, unit), e in zip(keys.items(), errors, strict=True)}


def table(docs: Sequence[Mapping[str, Any]]) -> Table:
    """Return the errors of navigation documents of one log, a row for each.

    Of one document RMS, final and greatest; of several the RMS side by side.
    """
    names = (*KEYS, "horizontal_m", "horizontal_mps")
    parts = ("rms", "final", "max") if len(docs) == 1 else ("rms",)
    headings = {"rms": "RMS", "final": "final", "max": "greatest"}
    columns = [Column("error")]
    for doc in docs:
        columns += [Column(f"{doc['mode']} {headings[part]}", ".3f") for part in parts]
    rows: list[tuple[Any, ...]] = []
    for name in names:
        error, unit = name.rsplit("_", 1)
        shown = f"{error.replace('_', ' ')}, {'m/s' if unit == 'mps' else unit}"
        rows.append((shown, *(doc[part][name] for doc in docs for part in parts)))
    return Table(
        title=f"Navigation errors over {summary(docs[0])}", columns=tuple(columns), rows=rows
    )


def summary(doc: Mapping[str, Any]) -> str:
    """Return time and motion of a navigation document in words."""
    rate = doc["rate"]["value"]
    motion = "still" if rate == 0.0 else f"mean table rate {rate:.5g} deg/s"
    return f"{doc['duration_s']:.5g} s, {motion}"


def headline(doc: Mapping[str, Any]) -> str:
    """Return the result of a navigation document in one line."""
    rms = doc["rms"]
    return (
        f"{doc['mode']}, {summary(doc)}: horizontal {rms['horizontal_m']:.4g} m, "
        f"{rms['horizontal_mps']:.3g} m/s RMS"
    )


def solution(result: "Navigation") -> dict[str, Array]:
    """Return the time series of a navigated window, columns with their units."""
    errors = dict(zip(KEYS, result.errors.T, strict=True))
    return {
        "time [s]": result.time,
        "latitude [deg]": result.latitude / DEG,
        "longitude [deg]": result.longitude / DEG,
        "height [m]": result.height,
        "v_east [m/s]": result.v_n[:, 0],
        "v_north [m/s]": result.v_n[:, 1],
        "v_up [m/s]": result.v_n[:, 2],
        "pitch [deg]": result.pitch / DEG,
        "roll [deg]": result.roll / DEG,
        "azimuth [deg]": result.azimuth / DEG,
        "err_north [m]": errors["latitude_m"],
        "err_east [m]": errors["longitude_m"],
        "err_up [m]": errors["height_m"],
        "err_v_east [m/s]": errors["v_east_mps"],
        "err_v_north [m/s]": errors["v_north_mps"],
        "err_v_up [m/s]": errors["v_up_mps"],
        "err_pitch [deg]": errors["pitch_deg"] / DEG,
        "err_roll [deg]": errors["roll_deg"] / DEG,
        "err_azimuth [deg]": errors["azimuth_deg"] / DEG,
    }


class Thinned:
    """A time series that comes part by part, thinned to what a plot can show.

    rows: of the whole; up to twice as many as are SHOWN stay as they are.
    """

    SHOWN = 50_000

    def __init__(self, rows: int) -> None:
        self._every = max(1, rows // self.SHOWN)
        self._skip = 0
        self._parts: list[dict[str, Array]] = []

    def add(self, columns: Mapping[str, Array]) -> None:
        """Take the part that follows."""
        count = len(next(iter(columns.values())))
        self._parts.append(
            {name: values[self._skip :: self._every].copy() for name, values in columns.items()}
        )
        self._skip = (self._skip - count) % self._every

    def columns(self) -> dict[str, Array]:
        """Return the series, columns with their units."""
        return {
            name: np.concatenate([part[name] for part in self._parts]) for name in self._parts[0]
        }
