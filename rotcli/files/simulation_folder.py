"""Keep a folder to one simulation, and never replace a recording."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rotcli.errors import ResultError
from rotcli.files.atomic import folder_lock
from rotcli.files.results.documents import write_error
from rotcli.files.text import check_regular

# How the rig.toml begins that is written next to simulated logs.
MARKS = (b"# The rig of a simulated log", b"# The rig of a simulated voyage")


@contextmanager
def lock_simulation_folder(place: Path, files: list[Path]) -> Iterator[None]:
    """Keep a folder to one simulation while its files are written, truth.json taken away first.

    Raises ResultError for a folder in which another process writes, or that contains files of other
    origin.
    """
    try:
        with folder_lock(place):
            check_ours(place, files)
            (place / "truth.json").unlink(missing_ok=True)
            yield
    except BlockingIOError as fault:
        what = "another simulation writes here; wait for it, or choose another folder"
        raise ResultError(f"{place}: {what}") from fault
    except OSError as fault:
        raise write_error(str(place), fault) from fault


def check_ours(place: Path, files: list[Path]) -> None:
    """Refuse to replace what no simulation made: a recording is not made twice."""
    rig = place / "rig.toml"
    if rig.exists():
        check_regular(rig)
        with rig.open("rb") as stream:
            if stream.readline().startswith(MARKS):
                return
    for path in files:
        if path.exists():
            raise ResultError(
                f"{path}: is there and not of a simulation; choose another folder, or remove it"
            )
