"""Values of options: time spans, finite numbers, bytes, lists of numbers.

An invalid text is a usage error of click.
"""

import math

import click


class Window(click.ParamType):  # type: ignore[type-arg]
    """A part of a log, `START:END` in s on the log's own clock."""

    name = "START:END"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float]:
        """Return (start, end)."""
        if isinstance(value, tuple):
            return value[0], value[1]
        start, colon, end = str(value).partition(":")
        try:
            window = (float(start), float(end))
        except ValueError:
            window = (0.0, 0.0)
        if not colon or not window[0] < window[1] or not abs(window[1]) < float("inf"):
            self.fail(f"{value!r} is not START:END in seconds, start before end", param, ctx)
        return window


class Finite(click.ParamType):  # type: ignore[type-arg]
    """A number from `minimum` to `maximum`; no option needs a larger one than 1e9."""

    name = "number"

    def __init__(self, minimum: float = -1e9, maximum: float = 1e9) -> None:
        self.minimum, self.maximum = minimum, maximum

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number."""
        try:
            number = float(str(value))
        except ValueError:
            number = math.nan
        if not self.minimum <= number <= self.maximum:
            allowed = f"{self.minimum:g} to {self.maximum:g}"
            self.fail(f"{value!r} is not a number from {allowed}", param, ctx)
        return number


class Picture(click.ParamType):  # type: ignore[type-arg]
    """A file name with the suffix of a picture."""

    name = "FILE"
    suffixes = (".png", ".svg", ".pdf")

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> str:
        """Return the name."""
        name = str(value)
        if not name.lower().endswith(self.suffixes):
            self.fail(f"{name}: not the name of a picture; name it .png, .svg or .pdf", param, ctx)
        return name


class Bytes(click.ParamType):  # type: ignore[type-arg]
    """A number of bytes, such as 500M or 20G."""

    name = "BYTES"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> int:
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
    """Return the numbers of a text with commas, none where one of them is not a number."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        return []


def numbers(text: str | None, count: int, option: str) -> list[float] | None:
    """Return `count` finite numbers of an option, None without it; raises BadParameter."""
    if text is None:
        return None
    found = split_numbers(text)
    if len(found) != count or not all(math.isfinite(number) for number in found):
        raise click.BadParameter(f"{text!r} is not {count} numbers with commas", param_hint=option)
    return found


def axis(text: str | None) -> str | list[float] | None:
    """Return the value of `--axis` as a rig contains it: a letter or a list of three numbers."""
    return text if text is None or "," not in text else vector(text, "--axis")


def vector(text: str | None, option: str) -> list[float] | None:
    """Return three numbers from `X,Y,Z`; raises BadParameter."""
    if text is None:
        return None
    found = split_numbers(text)
    if len(found) != 3:
        raise click.BadParameter(f"{text!r} is not three numbers X,Y,Z", param_hint=option)
    return found
