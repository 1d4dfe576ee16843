"""`python -m tests.words`: find words that the glossary replaces (docs/contributing.md).

Names, comments, docstrings, messages and pages are searched alike. The standard term stands next to
each word; phrases of the field are listed in ALLOWED.
"""

import re
import subprocess
import sys
from pathlib import Path

# Word to avoid: standard term.
WORDS = {
    "tells?|told|telling": "report, warn, list, progress",
    "feels?|felt": "measure",
    "held|holds": "contain, store, keep in memory, fixed",
    "anew": "create again, repeat",
    "sway": "oscillation, coning",
    "feign": "simulate",
    "storeys?": "layer",
    "whoever|nobody": "who, no one",
    "mends?|mended": "correct",
    "stretch|stretches": "segment",
    "stands?|stood": "is, at rest",
    "whole": "complete",
    "wander|wanders": "slow noise, in-run bias",
    "push|pushes": "specific force",
    "strays?": "deviation",
    "beside": "next to",
    "but for": "except for",
}
# Phrases in which a word has a meaning of the field, or is a value of a file's contract.
ALLOWED = (
    "hand-held",
    'doppler = "held"',
    '"held"',
    "`held`",
    "held (from then on)",
    "held_out",  # held-out data of a validation
    "still_held",  # a fault of shared cases
    "held samples",
    "held_samples",
    ".tell()",  # files
    ".push(",  # JavaScript
    "gyro_wander",  # keys of results
    "accel_wander",
)
# The glossaries name the words that they replace.
GLOSSARIES = ("docs/contributing.md",)
PLACES = ("rotcli", "tests", "docs", "README.md", "Makefile", "CHANGELOG.md")
SUFFIXES = (".py", ".md", ".html", ".toml", "")
_PATTERN = re.compile(r"(?<![A-Za-z])(" + "|".join(WORDS) + r")(?![A-Za-z])", re.IGNORECASE)


def files() -> list[Path]:
    """Return the text files that git tracks in PLACES."""
    listed = subprocess.run(
        ["git", "ls-files", *PLACES], capture_output=True, text=True, check=True
    )
    paths = [Path(name) for name in listed.stdout.split("\n") if name]
    return [path for path in paths if path.suffix in SUFFIXES and path != Path("tests/words.py")]


def term(word: str) -> str:
    """Return the standard term for a word that was found."""
    return next(t for pattern, t in WORDS.items() if re.fullmatch(pattern, word, re.IGNORECASE))


def _without_allowed(line: str) -> str:
    for phrase in ALLOWED:
        line = line.replace(phrase, " " * len(phrase))
    return line


def main() -> None:
    """Print every place, and exit 1 if there is one."""
    found = 0
    for path in files():
        if str(path) in GLOSSARIES:
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            for match in _PATTERN.finditer(_without_allowed(line)):
                found += 1
                print(f"{path}:{number}: {match[0]} (use: {term(match[0])})")
    sys.exit(found > 0)


if __name__ == "__main__":
    main()
