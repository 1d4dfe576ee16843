"""The campaign by `make -j2`, in a folder of its own so that nothing of the user's moves."""

import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

from tests.campaigns.benchmarks.measure import ROTCLI, Row, Run, Settings, one

_HOME = Path(__file__).parents[3]


def rows(settings: Settings) -> Iterator[Row]:
    """One run of about ninety commands; none with --quick."""
    if settings.quick:
        return
    folder = settings.folder / "campaign-home"
    (folder / "venv").mkdir(parents=True)
    for name in ("Makefile", "pyproject.toml"):
        shutil.copy(_HOME / name, folder)
    (folder / "venv" / "installed").touch()  # newer than pyproject.toml: nothing is installed
    command = ["make", "-j2", "campaign", "VENV=venv", f"ROTCLI={' '.join(ROTCLI)}"]
    start = time.perf_counter()
    subprocess.run(
        command,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(_HOME)},
        stdout=subprocess.DEVNULL,
        check=True,
    )
    seconds = time.perf_counter() - start
    yield one("make -j2 campaign, once", Run([seconds]), at_most=90.0)
