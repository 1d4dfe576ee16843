"""Time stamps that are texts: dates and times of day, recognised and converted.

ISO 8601 in the common spellings, `2024/03/05`, `05.03.2024`, `3/5/2024 2:00:00 PM`, `05-Mar-2024`,
and times of day, also with milliseconds behind a colon.
"""

import re

import numpy as np
from numpy.typing import NDArray

from rotcli.lazy import lazily

with lazily():
    import pandas as pd

_CLOCK = r"\d{1,2}:\d{2}(:\d{2}([.,:]\d+)?)?( ?[AaPp]\.?[Mm]\.?)?"
_ZONE = r"(Z|UTC|GMT| ?[+-]\d{2}:?\d{2})?"
_DATE = (
    r"(\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}"
    r"|\d{1,2}[- ][A-Za-z]{3}[- ]\d{4})"
)
_STAMP = rf"{_DATE}([T ,_]+{_CLOCK} ?{_ZONE})?|\d{{1,3}}:\d{{2}}(:\d{{2}})?([.,:]\d+)?"
_ARROW_STAMP = r"\d{4}-\d{2}-\d{2}[T ]\d{2}:\d{2}:\d{2}(\.\d{1,9})?"
_ARROW_TIME = r"([01]\d|2[0-3]):\d{2}:\d{2}(\.\d{1,9})?"
_FRACTION = r"(:\d{2}:\d{2})[,:](\d+)"  # 10:00:00,123 and 10:00:00:123
_DAY_FIRST = r"\d{1,2}\.\d{1,2}\.\d{4}"


def is_stamp(cell: str) -> bool:
    """Return whether a cell is a date or a time of day.

    >>> is_stamp("2024-03-05T12:00:00.5Z"), is_stamp("10:00:00:123"), is_stamp("12.5")
    (True, True, False)
    """
    return re.fullmatch(_STAMP, cell.strip()) is not None


def stamp_form(cell: str) -> str:
    """Return how a stamp is converted: `timestamp`, `timestamp utc`, `time of day` or `text`."""
    if re.fullmatch(_ARROW_STAMP, cell):
        return "timestamp"
    if cell.endswith("Z") and re.fullmatch(_ARROW_STAMP, cell[:-1]):
        return "timestamp utc"
    return "time of day" if re.fullmatch(_ARROW_TIME, cell) else "text"


def is_time_of_day(cell: str) -> bool:
    """Return whether a stamp has no date, so that it starts again after a day."""
    return not re.search(r"[-/]|\d\.\d{1,2}\.\d", cell)


def nanoseconds(cells: list[str]) -> NDArray[np.int64]:
    """Return dates (since 1970) or times of day (since midnight) of one form as ns.

    Raises ValueError where a cell is neither.
    """
    fraction = re.compile(_FRACTION)
    cells = [fraction.sub(r"\1.\2", cell.strip()) for cell in cells]
    first = cells[0]
    if ":" in first and is_time_of_day(first) and not re.search(r"[A-Za-z]", first):
        padded = [c if c.count(":") == 2 else f"0:{c}" for c in cells]
        days = pd.to_timedelta(pd.Series(padded)).to_numpy()
        return np.asarray(days.astype("timedelta64[ns]").astype(np.int64))
    day_first = re.match(_DAY_FIRST, first) is not None
    times = pd.to_datetime(pd.Series(cells), format="mixed", utc=True, dayfirst=day_first)
    stamps = times.dt.tz_localize(None).to_numpy().astype("datetime64[ns]")
    return np.asarray(stamps.astype(np.int64))
