"""Files that attack: bombs, absurd declarations, wrong types, odd names.

`LOGS` are refused, each with what the refusal must say; `SOUND` are odd and read all the same.
"""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.campaigns.faults.hostile_logs import Log, Maker, plain_text

Call = Callable[[list[str]], subprocess.CompletedProcess]


def refused(log: Log, path: Path, call: Call) -> str | None:
    """Give a hostile log to `rotcli allan`; None where it is refused in one helpful line."""
    _fresh(path)
    log.make(path)
    done = call(["allan", str(path), *log.options])
    one = done.returncode == 1 and done.stderr.count("\n") == 1 and len(done.stderr) < 1000
    if one and done.stderr.startswith("rotcli: error: ") and re.search(log.says, done.stderr):
        return None
    return f"{done.returncode}: {done.stderr[:300]}"


_PEAK = """
import resource, subprocess, sys
subprocess.run([sys.executable, "-m", "rotcli", *sys.argv[1:]], capture_output=True, timeout=120)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""


def within_memory(log: Log, path: Path, command: str = "allan") -> str | None:
    """Read a hostile log by a command; None where the peak of memory keeps to its limit.

    That is six times the file's bytes, or those of --max-bytes for what is compressed, next to the
    300 MB that Python and its libraries may take.
    """
    _fresh(path)
    log.make(path)
    size = path.stat().st_size if path.is_file() else 0
    size = max(size, 50_000_000 if log.options else 0)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    done = subprocess.run(
        [sys.executable, "-c", _PEAK, command, str(path), *log.options],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    )
    peak = int(done.stdout) * 1024
    limit = 300e6 + 6.0 * size
    return None if peak < limit else f"{command}: {peak / 1e6:.0f} MB, limit {limit / 1e6:.0f} MB"


def understood(make: Maker, path: Path, call: Call) -> str | None:
    """Convert an odd log and the plain one; None where both hold the same numbers.

    Stamps in other units may differ in their last digit.
    """
    _fresh(path)
    make(path)
    plain = path.with_name("plain.csv")
    plain.write_text("\n".join(plain_text()) + "\n")
    made = []
    for log in (plain, path):
        out = path.with_name("out.csv")
        done = call(["convert", str(log), "-o", str(out), "--quiet"])
        if done.returncode or done.stderr:
            return f"{done.returncode}: {done.stderr[:300]}"
        made.append(np.loadtxt(out, delimiter=",", skiprows=1))
    time, values = (np.array([content[:, at] for content in made]) for at in (0, slice(1, None)))
    same = np.array_equal(values[0], values[1]) and np.abs(time[0] - time[1]).max() < 1e-14
    return None if same else "read as something else"


def _fresh(path: Path) -> None:
    shutil.rmtree(path.parent, ignore_errors=True)
    path.parent.mkdir(parents=True)


TOMLS = {
    "nested arrays": "x = " + "[" * 100_000,
    "closed nested arrays": "x = " + "[" * 5000 + "]" * 5000,
    "nested tables": "x = " + "{a = " * 5000 + "1" + "}" * 5000,
    "a dotted key": ".".join(["a"] * 20_000) + " = 1",
    "a dotted header": "[" + ".".join(["a"] * 20_000) + "]",
    "a long number": "[site]\nlatitude = " + "9" * 100_000,
    "too large": "# " + "x" * 6_000_000,
    "a NUL": "[site]\nlatitude = 1\0",
}
JSONS = {
    "nested arrays": "[" * 100_000,
    "a long number": '{"kind": "calibration", "schema": ' + "1" * 100_000 + "}",
    "NaN": '{"kind": "calibration", "schema": 1, "axis": "z", "rate": {"value": NaN}}',
    "a list": "[]",
    "a string": '"calibration"',
    "a lone surrogate": '{"kind": "calibration", "schema": 1, "axis": "\\ud800"}',
    "too large": '{"kind": "' + "x" * (66 << 20) + '"}',
}
ODD_NAMES = (
    "with space",
    "quo'te\"s",
    "new\nline",
    "Ünïcödé 日本",
    "-dash",
    "%s%n{mode}",
    "<script>alert(1)<∕script>",
    "\\input{secret}",
    "$(touch pwned)",
    "*[a-z]?",
)
