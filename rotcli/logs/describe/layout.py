"""The layout of a log: which column is which channel, in which unit; and its problems.

`rotcli.logs.describe` makes it from a header and a rig, before any record is converted.
"""

from dataclasses import field
from typing import Any, Literal, NoReturn

from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.files.toml_schema import to_toml
from rotcli.logs.container.columns import Wanted

Origin = Literal["rig", "header", "format", "name", "values", "assumed"]
TimeKind = Literal["unit", "text", "week", "split", "counter", "none"]


@dataclass(frozen=True)
class Problem:
    """A finding about how a log is written, and the rig keys that solve it.

    rig: section to keys to values, empty where no line is known. fatal: the log cannot be read
    as it is. instead: another remedy, before the line.
    """

    finding: str
    rig: dict[str, dict[str, Any]] = field(default_factory=dict)
    advice: str = ""
    fatal: bool = True
    instead: str = ""

    @property
    def lines(self) -> list[str]:
        """The rig lines, as `[imu] rate = 100.0`."""
        return [
            f"[{section}] {key} = {to_toml(value)}"
            for section, keys in self.rig.items()
            for key, value in keys.items()
        ]

    @property
    def text(self) -> str:
        """Finding and action in one sentence."""
        action = " and ".join(self.lines)
        action = f"{self.instead}set {action}" if action else ""
        both = ", ".join(part for part in (action, self.advice) if part)
        return f"{self.finding}; {both}" if both else self.finding


@dataclass(frozen=True)
class Source:
    """Where a channel comes from: a reading in SI is (raw - offset) * scale.

    increments: the channel is an angle or a velocity over the sampling interval.
    """

    column: int
    scale: float
    offset: float = 0.0
    unit: str = ""
    origin: Origin = "assumed"
    increments: bool = False


@dataclass(frozen=True)
class TimeSource:
    """Where the time comes from.

    kind: unit (numbers), text (dates, times of day), week (GPS week and seconds), split (seconds
    and nanoseconds), counter (records or ticks), none (no column). scale: s of one unit of each
    column. periods: s after which a counter may start again. start, interval: s, of even times.
    correction: column that corrects the interval of each record, us. text: form of the text.
    """

    kind: TimeKind
    columns: tuple[int, ...] = ()
    scale: tuple[float, ...] = (1.0,)
    periods: tuple[float, ...] = ()
    start: float = 0.0
    interval: float = 0.0
    correction: int | None = None
    text: str = ""
    unit: str = ""
    origin: Origin = "assumed"

    @property
    def is_even(self) -> bool:
        """Whether the records are at even times, which no column contains."""
        return self.kind == "none" and self.interval > 0.0 and self.correction is None


@dataclass(frozen=True)
class Layout:
    """The layout of one log.

    sources: channel to its source. selected: column and value of the IMU that is read, where the
    log contains several. sparse: some cells are blank because two logs share the file. notes:
    warnings. problems: what prevents reading.
    """

    path: str
    time: TimeSource
    sources: dict[str, Source]
    selected: tuple[int, Any] | None = None
    sparse: bool = False
    notes: tuple[str, ...] = ()
    problems: tuple[Problem, ...] = ()

    @property
    def wanted(self) -> Wanted:
        """The columns to load: time, channels, correction of the time, number of the IMU."""
        channels = tuple(source.column for source in self.sources.values())
        columns = [*self.time.columns, *channels]
        texts = {self.time.columns[0]: self.time.text} if self.time.text else {}
        if self.time.correction is not None:
            columns.append(self.time.correction)
        if self.selected is not None:
            columns.append(self.selected[0])
            texts[self.selected[0]] = "name"
        return Wanted(tuple(columns), channels, texts, self.sparse)

    @property
    def is_streamable(self) -> bool:
        """Whether chunks can be read one by one: numeric stamps or none, every record used."""
        return (
            (self.time.kind == "unit" or self.time.is_even)
            and not self.time.periods
            and self.selected is None
            and not self.sparse
        )

    def raise_problems(self) -> None:
        """Raise LogError with all problems, where there are any."""
        fatal = [problem for problem in self.problems if problem.fatal]
        if fatal:
            raise_all(self.path, fatal)


def raise_all(path: str, problems: list[Problem]) -> NoReturn:
    """Raise one LogError for all problems of a log."""
    if len(problems) == 1:
        text = problems[0].text
    else:
        parts = [f"({k}) {problem.text}" for k, problem in enumerate(problems, start=1)]
        text = f"{len(problems)} problems: " + " ".join(parts)
    error = LogError(path, text)
    error.problems = tuple(problems)
    raise error
