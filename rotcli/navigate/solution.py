"""Solution files read back and drawn: the errors of a navigated run against time."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import ResultError
from rotcli.files.text import check_regular
from rotcli.lazy import lazily
from rotcli.navigate.plot import ERROR_COLUMNS, navigation_errors

with lazily():
    import pyarrow as pa
    import pyarrow.csv as pc
    import pyarrow.parquet as pq


_BEYOND = 1e200  # no error of a navigation comes near

if TYPE_CHECKING:
    from rotcli.files.figures import Drawing


def read_solution(path: str) -> dict[str, NDArray[np.float64]]:
    """Return the time and error columns of a solution that `rotcli navigate` wrote, each (n,).

    Raises ResultError for a file that cannot be read or is no solution.
    """
    try:
        check_regular(path)
        parquet = Path(path).suffix.lower() == ".parquet"
        table = pq.read_table(path) if parquet else pc.read_csv(path)
        names = table.column_names
    except OSError as fault:
        raise ResultError(f"{path}: cannot be read: {fault.strerror or fault}") from fault
    except (pa.ArrowException, UnicodeError) as fault:
        raise ResultError(f"{path}: not a solution file: {fault}; create it again") from fault
    missing = [name for name in ERROR_COLUMNS if name not in names]
    if missing or table.num_rows < 2:
        what = f"no column {missing[0]}" if missing else f"{table.num_rows} rows"
        text = f"{path}: not a solution of rotcli navigate: {what}; navigate again to write it"
        raise ResultError(text)
    try:
        found = {
            name: np.asarray(table[name].to_numpy(), dtype=np.float64) for name in ERROR_COLUMNS
        }
    except (KeyError, TypeError, ValueError) as fault:
        raise ResultError(f"{path}: not a solution file: {fault}; create it again") from fault
    for name, values in found.items():
        if not np.all(np.abs(values) < _BEYOND):
            raise ResultError(f"{path}: {name}: not numbers throughout; create it again")
    return found


def solution_figures(paths: Sequence[str]) -> "list[Drawing]":
    """Return title and drawing of each solution file."""
    return [
        (
            f"{path}: errors against time",
            partial(navigation_errors, read_solution(path), Path(path).stem),
        )
        for path in paths
    ]
