"""Load columns of a log of any kind: complete (`load`) or in chunks (`load_chunks`).

One call for text, Parquet and bags; the kind is that of the header. Every number is finite.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rotcli.errors import LogError
from rotcli.lazy import lazily
from rotcli.logs.container.columns import Chunks, Loaded, Wanted
from rotcli.logs.container.header import Header, Progress, as_log_error

with lazily():
    from rotcli.logs.container import bag_file, csv_file, parquet_file

_MIN_CHUNK_SHARE = 0.25  # of the usual chunk; a smaller one joins the chunk before


def load(
    header: Header, wanted: Wanted, *, min_rows: int = 2, progress: Progress | None = None
) -> Loaded:
    """Read columns, every number finite, at least `min_rows` rows.

    progress: gets the share (0 to 1) of a text log that is read. Raises LogError that names the
    row and column of the first error.
    """
    with as_log_error(header.path):
        loaded = _load(header, wanted, progress)
        finite = _is_finite(loaded, wanted)
        if not finite and not wanted.sparse and _has_empty_records(loaded, wanted):
            loaded = _load(header, replace(wanted, sparse=True), progress)
        header.check_unchanged()
    if loaded.rows < min_rows:
        found = "no data rows" if loaded.rows == 0 else f"only {loaded.rows} data row"
        place = " below the header" if header.is_text and header.header_line else ""
        raise LogError(header.path, f"{found}{place}; at least {min_rows} are needed")
    if not finite:
        _check_finite(loaded, wanted)
    return loaded


def _load(header: Header, wanted: Wanted, progress: Progress | None) -> Loaded:
    if header.kind == "bag":
        return bag_file.load(header, wanted)
    if header.kind == "parquet":
        return parquet_file.load(header, wanted)
    return csv_file.load(header, wanted, progress)


def _has_empty_records(loaded: Loaded, wanted: Wanted) -> bool:
    """Return whether some records, not all, are NaN in all channels: blanks of another log."""
    places = [wanted.columns.index(i) for i in wanted.values]
    if not places or loaded.header.kind == "bag":
        return False
    empty = np.logical_and.reduce([np.isnan(loaded.column(k)) for k in places])
    return bool(empty.any() and not empty.all())


def load_chunks(
    header: Header, wanted: Wanted, rows: int, first: int = 0
) -> Iterator[tuple[Loaded, float]]:
    """Yield the columns about `rows` records at a time, and the share of the file read so far.

    For logs too long for the memory. The first chunk contains record `first` or comes before it:
    a Parquet file is entered at its row group. Raises LogError as `load` does.
    """
    chunks = parquet_file.load_chunks if header.kind == "parquet" else csv_file.load_chunks
    last: tuple[Loaded, float] | None = None
    with as_log_error(header.path):
        for loaded, share in chunks(header, wanted, rows, first):
            _check_finite(loaded, wanted)
            if last is None:
                last = loaded, share
            elif loaded.rows < rows * _MIN_CHUNK_SHARE:  # the end of a row group
                last = _concatenate(last[0], loaded), share
            else:
                yield last
                last = loaded, share
    if last is None or not last[0].rows:
        raise LogError(header.path, "no data rows; at least 2 are needed")
    yield last


def _concatenate(before: Loaded, after: Loaded) -> Loaded:
    columns = [[*a, *b] for a, b in zip(before.columns, after.columns, strict=True)]
    return replace(before, rows=before.rows + after.rows, columns=columns)


def _is_finite(loaded: Loaded, wanted: Wanted) -> bool:
    """Return whether every number is finite."""
    with np.errstate(all="ignore"):
        return all(np.isfinite(c.sum()) for chunks, _ in _numeric(loaded, wanted) for c in chunks)


def _numeric(loaded: Loaded, wanted: Wanted) -> list[tuple[Chunks, int]]:
    """Return the chunks and the column of each column of numbers."""
    return [
        (chunks, i)
        for chunks, i in zip(loaded.columns, wanted.columns, strict=True)
        if wanted.texts.get(i) != "name"
    ]


def _check_finite(loaded: Loaded, wanted: Wanted) -> None:
    """Raise LogError for the first number that is not finite."""
    if _is_finite(loaded, wanted):
        return
    found = []
    for chunks, i in _numeric(loaded, wanted):
        values = np.concatenate(chunks)
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            found.append((int(bad[0]), i, str(values[bad[0]])))
    if found:
        index, i, value = min(found)
        finding = f"{value} is not a finite number; correct or remove the row"
        raise LogError(
            loaded.header.path, finding, row=loaded.row(index), column=loaded.header.names[i]
        )
