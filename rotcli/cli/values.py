"""What the text of an option may be: stretches, finite numbers, bytes, lists of numbers.

A text that is none is a fault of the command line, told by click.
"""

import math
from typing import Any

import click


class Window(click.ParamType[tuple[float, float]]):
    """A stretch of a log, `START:END` in s on the log's own clock."""

    name = "START:END"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[float, float]:
        """Return (start, end)."""
        if isinstance(value, tuple):
            return value
        start, colon, end = str(value).partition(":")
        try:
            window = (float(start), float(end))
        except ValueError:
            window = (0.0, 0.0)
        if not colon or not window[0] < window[1] or not abs(window[1]) < float("inf"):
            self.fail(f"{value!r} is not START:END in seconds, start before end", param, ctx)
        return window


class Finite(click.ParamType[float]):
    """A finite number, not below `least`."""

    name = "number"

    def __init__(self, least: float = -math.inf) -> None:
        self.least = least

    def convert(self, value: Any, param: Any, ctx: Any) -> float:
        """Return the number."""
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not self.least <= number < math.inf or number == -math.inf:
            at_least = f", {self.least:g} or more" if self.least > -math.inf else ""
            self.fail(f"{value!r} is not a finite number{at_least}", param, ctx)
        return number


class Bytes(click.ParamType[int]):
    """A number of bytes, such as 500M or 20G."""

    name = "BYTES"

    def convert(self, value: Any, param: Any, ctx: Any) -> int:
        """Return the number."""
        text = str(value).strip().upper().removesuffix("B")
        power = "KMGT".find(text[-1:]) + 1 if text else 0
        try:
            count = float(text[:-1] if power else text) * 1000.0**power
        except ValueError:
            count = 0.0
        if not 1.0 <= count <= 1e18:
            self.fail(f"{value!r} is not a number of bytes such as 500M or 20G", param, ctx)
        return int(count)


def split_numbers(text: str) -> list[float]:
    """Return the numbers of a text with commas, none where one of them is no number."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        return []


def axis(text: str | None) -> str | list[float] | None:
    """Return the value of `--axis` as a rig holds it: a letter or a list of three numbers."""
    return text if text is None or "," not in text else vector(text, "--axis")


def vector(text: str | None, option: str) -> list[float] | None:
    """Return three numbers from `X,Y,Z`; a usage error otherwise."""
    if text is None:
        return None
    numbers = split_numbers(text)
    if len(numbers) != 3:
        raise click.BadParameter(f"{text!r} is not three numbers X,Y,Z", param_hint=option)
    return numbers
