"""Readers that go away, and recipes of make that fail.

Every trial returns None when nothing was lost, else a description.
"""

import os
import shutil
import subprocess
from pathlib import Path

from tests.campaigns.faults.writers import ROOT, SEA, start

# Command lines that write to standard output, which may have no reader.
PIPED = [
    "allan still/imu.parquet",
    "allan still/imu.parquet -o -",
    "calibrate run/imu.parquet run/table.parquet",
    f"srins calibrate {SEA} -o -",
    "navigate run/imu.parquet run/table.parquet --calibration c.json -o -",
    "observe run/imu.parquet run/table.parquet -o -",
    "srins observe",
    "budget --imu nav440 --rate 10 -o -",
    "report c.json",
    "report c.json -o -",
    "--help",
]


def headed(folder: Path, line: str) -> str | None:
    """Read one line of a command's output and go away, as `| head -n 1` does."""
    process = start(line.split(), folder)
    assert process.stdout is not None
    first = process.stdout.readline()
    process.stdout.close()
    assert process.stderr is not None
    err = process.stderr.read().decode()
    process.stderr.close()
    code = process.wait()
    quiet = all(x.startswith("rotcli: warning: ") for x in err.splitlines())
    return None if first and quiet and code in (0, 141) else f"{code}: {err[-300:]}"


def piped(folder: Path, args: list[str]) -> str | None:
    """Close standard output while a command writes to it, as `| head` does."""
    read, write_end = os.pipe()
    process = start(args, folder, stdout=write_end)
    os.close(write_end)
    os.close(read)
    err = process.communicate()[1].decode()
    quiet = "Traceback" not in err and "Exception" not in err and "error" not in err
    return None if quiet and process.returncode in (0, 141) else f"{process.returncode}: {err}"


def failed_recipe(folder: Path) -> str | None:
    """Run make -j with a rotcli that writes half and fails; no target may look done."""
    for name in ("Makefile", "pyproject.toml"):
        shutil.copy(ROOT / name, folder)
    (folder / "venv").mkdir()
    (folder / "venv" / "installed").touch()
    fake = folder / "fake"
    fake.write_text(
        '#!/bin/sh\nwhile [ $# -gt 0 ]; do [ "$1" = -o ] && out=$2; shift; done\n'
        'case "$out" in *.json) echo half > "$out";; *) mkdir -p "$out"; '
        'for f in imu.parquet table.parquet rig.toml; do echo half > "$out/$f"; done;; '
        "esac\n"
        "sleep 0.02; exit 1\n"
    )
    fake.chmod(0o755)
    program = ["make", "-k", "-j4", f"ROTCLI={fake}", f"VENV={folder}/venv"]
    program += ["campaign", "observe", "srins"]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("MAKE")}
    done = subprocess.run(program, cwd=folder, capture_output=True, check=False, env=environment)
    # make may take a sibling of a failed target for older; without its truth a run is not done.
    left = [str(p) for p in folder.rglob("*.json")]
    return f"left {left[:5]}" if left or done.returncode == 0 else None
