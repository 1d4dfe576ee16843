"""Tables into files of other programs: CSV, a folder of CSV, Excel, Parquet; the same bytes.

A CSV cell that a spreadsheet would compute is quoted; numbers keep their full precision.
"""

import io
import re
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rotcli.errors import ResultError
from rotcli.files.tables.model import Table
from rotcli.files.text import spreadsheet_text
from rotcli.lazy import lazily

with lazily():
    import openpyxl
    from openpyxl import styles

    from rotcli.files.results import documents

if TYPE_CHECKING:
    from pandas import DataFrame

_ZIP_DATE = (1980, 1, 1, 0, 0, 0)  # earliest that a zip archive can store
_SHEET_NAME = 31  # letters, limit of Excel


def csv_text(frame: "DataFrame") -> str:
    """Return a frame as CSV, one rectangular table that pandas.read_csv reads."""
    safe = frame.copy()
    for name in safe.columns:
        if not _is_number(safe[name]):
            safe[name] = [_safe(cell) for cell in safe[name]]
    return str(safe.to_csv(index=False, lineterminator="\n"))


def _is_number(column: Any) -> bool:
    return column.dtype.kind in "iuf"


def _safe(cell: object) -> object:
    return spreadsheet_text(cell) if isinstance(cell, str) else cell


def file_names(tables: Sequence[Table]) -> list[str]:
    """Return a file name without suffix for each table, all different."""
    names: list[str] = []
    for table in tables:
        name = "-".join(re.findall(r"[a-z0-9]+", table.title.casefold()))[:60].strip("-")
        unique, number = name or "table", 1
        while unique in names:
            number += 1
            unique = f"{name}-{number}"
        names.append(unique)
    return names


def parquet_bytes(frame: "DataFrame") -> bytes:
    """Return a frame as a Parquet file."""
    stream = io.BytesIO()
    frame.to_parquet(stream, index=False)
    return stream.getvalue()


def excel_bytes(frame: "DataFrame", tables: Sequence[Table]) -> bytes:
    """Return a workbook: the long table on the first sheet, then a sheet for each table.

    Raises ResultError where openpyxl is not installed.
    """
    try:
        book = openpyxl.Workbook()
    except ImportError:
        raise ResultError(
            "writing .xlsx needs openpyxl: pip install 'rotcli[xlsx]'; or write .csv"
        ) from None
    sheets = [("data", list(frame.columns), frame.itertuples(index=False, name=None), "")]
    for name, table in zip(_sheet_names(tables), tables, strict=True):
        shown = table.to_frame()
        rows = shown.itertuples(index=False, name=None)
        sheets.append((name, list(shown.columns), rows, f"{table.title}. {table.note}"))
    for k, (name, heads, rows, note) in enumerate(sheets):
        sheet = book.active if k == 0 else book.create_sheet()
        sheet.title = name
        sheet.append(heads)
        for row in rows:
            sheet.append([_excel_cell(cell) for cell in row])
        for cell in sheet[1]:
            cell.font = styles.Font(bold=True)
            cell.alignment = styles.Alignment(wrap_text=True)
        sheet.freeze_panes = "A2"
        if note:
            sheet.append([])
            sheet.append([spreadsheet_text(note)])
    stream = io.BytesIO()
    book.save(stream)
    return _without_dates(stream.getvalue())


def _sheet_names(tables: Sequence[Table]) -> list[str]:
    names: list[str] = []
    for name in file_names(tables):
        short, number = name[:_SHEET_NAME].strip("-"), 1
        while short in names:
            number += 1
            short = f"{name[: _SHEET_NAME - 4].strip('-')}-{number}"
        names.append(short)
    return names


def _excel_cell(cell: object) -> object:
    if isinstance(cell, float) and cell != cell:
        return None
    return _safe(cell)


def _without_dates(data: bytes) -> bytes:
    """Return a workbook without the times at which it was written."""
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(data)) as read,
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as written,
    ):
        for member in read.infolist():
            content = read.read(member)
            if member.filename == "docProps/core.xml":
                content = re.sub(rb"<dcterms:(\w+)[^>]*>[^<]*</dcterms:\1>", b"", content)
            info = zipfile.ZipInfo(member.filename, _ZIP_DATE)
            info.compress_type = zipfile.ZIP_DEFLATED
            written.writestr(info, content)
    return stream.getvalue()


def write_folder(folder: str, tables: Sequence[Table]) -> list[str]:
    """Write one CSV per table into a folder, which is created; return the names of the files.

    Raises ResultError for a folder or file that cannot be written.
    """
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise documents.write_error(folder, fault) from fault
    names = [f"{name}.csv" for name in file_names(tables)]
    for name, table in zip(names, tables, strict=True):
        documents.write_text(str(Path(folder) / name), csv_text(table.to_frame()))
    return names
