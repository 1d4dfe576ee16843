"""Find result files: files by name, folders, and patterns such as `runs/*/calibration.json`."""

import glob
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.files.results.documents import read_result


@dataclass(frozen=True)
class Found:
    """Result documents with their paths, and the files below folders that are no results."""

    documents: tuple[tuple[str, dict[str, Any]], ...]
    skipped: tuple[str, ...]

    def remarks(self) -> list[str]:
        """Return a line on the files that were skipped; none where there are none."""
        if not self.skipped:
            return []
        count = len(self.skipped)
        files = "files are" if count > 1 else "file is"
        return [f"{self.skipped[0]}: {count} JSON {files} no result and skipped, this one first"]


def find_results(sources: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the JSON files of folders and globs, and the files named one by one.

    Raises ResultError for a source that matches nothing.
    """
    found: list[str] = []
    named: list[str] = []
    for source in sources:
        path = Path(source)
        if path.is_dir():
            below = sorted(_json_files(source))
        elif path.exists() or not glob.has_magic(source):
            named.append(source)  # one that is missing is reported where it is read
            continue
        else:
            matches = glob.glob(source, recursive=True)  # noqa: PTH207 (absolute patterns too)
            below = sorted(match for match in matches if match.endswith(".json"))
        if not below:
            raise ResultError(f"{source}: no result files; check the folder or the pattern")
        found += below
    return list(dict.fromkeys(found)), list(dict.fromkeys(named))


def read_results(
    sources: Sequence[str], accepts: Callable[[dict[str, Any]], bool] = lambda doc: True
) -> Found:
    """Read the results of named files, in their order, and of folders and patterns, by path.

    accepts: whether the command uses a document; of the results below a folder or found by a
    pattern only these are returned. A file that is named itself is always returned.

    Raises ResultError for a named file that is no result, and where nothing is left.
    """
    found, named = find_results(sources)
    documents = [(path, read_result(path)) for path in named]
    skipped = []
    for path in (path for path in found if path not in set(named)):
        try:
            doc = read_result(path)
        except ResultError:
            skipped.append(path)
            continue
        if accepts(doc):
            documents.append((path, doc))
    if not documents:
        raise ResultError(f"{', '.join(sources)}: no results for this command")
    return Found(tuple(documents), tuple(skipped))


def calibration_paths(sources: Sequence[str]) -> tuple[str, ...]:
    """Return files by name, and the calibrations of folders and patterns, in their order.

    A file that is named twice stays twice: to apply it twice is an error of the user.

    Raises ResultError for a folder or a pattern without any.
    """
    paths: list[str] = []
    for source in sources:
        if Path(source).is_dir() or (glob.has_magic(source) and not Path(source).exists()):
            found = read_results([source], lambda doc: doc.get("kind") == "calibration")
            paths += [path for path, _ in found.documents if path not in paths]
        else:
            paths.append(source)
    return tuple(paths)


def _json_files(folder: str) -> Iterator[str]:
    """Yield the JSON files below a folder; data sets and hidden folders have none."""
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(("parameter=", "."))]
        for name in names:
            if name.endswith(".json"):
                yield os.path.join(place, name)  # noqa: PTH118 (a path object is slower)
