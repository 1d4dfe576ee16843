"""The figures of a report as files of a folder."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rotcli.files.figures import save_figure, styled
from rotcli.files.results.documents import write_error

if TYPE_CHECKING:
    from rotcli.files.figures import Drawing

_MAX_NAME = 80  # letters


def figure_name(title: str) -> str:
    """Return the name of a figure's file, without its suffix.

    >>> figure_name("NAV440: RMS errors against the table rate")
    'nav440-rms-errors-against-the-table-rate'
    """
    return "-".join(re.findall(r"[a-z0-9]+", title.casefold()))[:_MAX_NAME].strip("-") or "figure"


def write_figures(folder: str, drawings: "Sequence[Drawing]", form: str) -> list[str]:
    """Draw every figure into a folder, which is created; return the names of the files.

    form: pdf, svg or png. Raises ResultError where the folder or a file cannot be written.
    """
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise write_error(folder, fault) from fault
    names: list[str] = []
    for title, draw in drawings:
        base = name = figure_name(title)
        number = 1
        while f"{name}.{form}" in names:
            number += 1
            name = f"{base}-{number}"
        names.append(f"{name}.{form}")
        with styled():
            save_figure(draw(), str(Path(folder) / names[-1]))
    return names
