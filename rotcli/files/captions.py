"""What a figure says of itself, found alone in a folder: whose it is, how it moved, which log.

The words come from the result document that the figure is drawn next to. They are text as it
is in the files; `figures` draws them so.
"""

from collections.abc import Mapping
from typing import Any

from rotcli.files.results.groups import NAMELESS, Source
from rotcli.models.turntable import STILL_RATE
from rotcli.units import DEG, format_span

_PATH = 48  # characters of a path that fit in one line below a figure


def subject(doc: Mapping[str, Any], *words: str) -> str:
    """Return the IMU's name and what more is to be said of it.

    >>> subject({"rig": {"imu": {"name": "NAV440"}}}, "full", "still")
    'NAV440, full, still'
    """
    return ", ".join([Source("", doc).imu, *words])


def title_without_imu(doc: Mapping[str, Any], *words: str) -> str:
    """Return `subject` of what needs no IMU: a name is said only where there is one."""
    text = ", ".join(words)
    return subject(doc, *words) if Source("", doc).imu != NAMELESS else text[:1].upper() + text[1:]


def is_still_rate(rate_dps: float) -> bool:
    """Return whether a document's table rate (deg/s) is that of a still table.

    Documents have the rate 0 when still; those of rotcli 0.1 have the noise of the encoder.
    """
    return abs(rate_dps) * DEG <= STILL_RATE


def motion(doc: Mapping[str, Any], *, constant_rate: bool = True) -> str:
    """Return how the table moves: still, or its axis and rate.

    constant_rate: whether the rate is the one rate, not a mean.

    >>> motion({"axis": "x", "rate": {"value": 10.0}})
    'about x at 10 deg/s'
    """
    source = Source("", doc)
    rate = source.number_or_none("rate", "value")
    if not constant_rate:
        return f"about {source.axis} at varying rates"
    if doc.get("axis") == "none" or (rate is not None and is_still_rate(rate)):
        return "still"
    return f"about {source.axis}" + ("" if rate is None else f" at {rate:.5g} deg/s")


def log(doc: Mapping[str, Any]) -> str:
    """Return the first log's name, its end where it is long, and the window (s) that was used.

    >>> log({"inputs": [{"path": "run/imu.csv"}], "window": {"start_s": 60.0, "end_s": 90.5}})
    'run/imu.csv, 60 to 90.5 s'
    """
    inputs = doc.get("inputs") or [{}]
    path = str(inputs[0].get("path", ""))
    shown = path if len(path) <= _PATH else "…" + path[1 - _PATH :]
    filtered = doc.get("filter") or {}
    window = doc.get("window") or filtered.get("window") or filtered
    if "start_s" not in window:
        return shown
    return f"{shown}, {format_span(window['start_s'], window['end_s'])}"
