"""Small text files, read at once within a limit: rigs, profiles, scenarios, results."""

import errno
import os
import re
import stat
from pathlib import Path
from typing import Any

from rotcli.lazy import lazily

with lazily():
    import tomllib

MOST_TOML = 4 << 20  # bytes; a rig has some thousand
_MOST_DOTS = 100
MOST_JSON = 64 << 20  # bytes; the largest results have a few million


_BIDIRECTIONAL = "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"
_INVISIBLE = f"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029{_BIDIRECTIONAL}]"


def visible(text: str) -> str:
    r"""Return text with control and bidirectional characters as escapes.

    A name or a warning may come from a stranger's file; it must not control a terminal or reorder a
    line.

    >>> visible("a\x1b]0;b\x07\u202e")
    'a\\x1b]0;b\\x07\\u202e'
    """
    if text.isprintable():
        return text
    return re.sub(_INVISIBLE, lambda match: repr(match[0])[1:-1], text)


def spreadsheet_text(text: str) -> str:
    """Return text that a spreadsheet shows and does not compute: `'` before `=`, `+`, `-`, `@`.

    >>> spreadsheet_text("=1+1"), spreadsheet_text("-0.5"), spreadsheet_text("a-b")
    ("'=1+1", '-0.5', 'a-b')
    """
    text = visible(text)
    if not text.startswith(("=", "+", "-", "@", "\t")):
        return text
    try:
        float(text)
    except ValueError:
        return "'" + text
    return text


def read_text(path: str | Path, most: int = MOST_TOML) -> str:
    """Return the UTF-8 text of a regular file of `most` bytes at most, without a byte order mark.

    Raises OSError (for a device or pipe and a file that is too large, too), UnicodeDecodeError.
    """
    check_regular(path)
    with Path(path).open("rb") as stream:
        found = stream.read(most + 1)
    if len(found) > most:
        raise OSError(errno.EFBIG, f"larger than {most >> 20} MB; is this the right file?")
    return found.decode("utf-8-sig")


def parse_toml(text: str) -> dict[str, Any]:
    """Return the content of TOML text; raises ValueError, also for tables nested beyond reason."""
    # A key of thousands of dots keeps the parser busy for minutes.
    words = re.split(r"[\n=,{}\[\]#]", text.replace(" ", "").replace("\t", ""))
    if max(word.count(".") for word in words) > _MOST_DOTS:
        raise ValueError("nested too deeply: a key of too many dots")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error


def check_regular(path: str | Path) -> None:
    """Raise OSError unless the file is a regular one, which can be read twice."""
    if "\0" in str(path):
        raise OSError(errno.EINVAL, "a name with a NUL")
    mode = os.stat(path).st_mode  # noqa: PTH116 (of thousands of files: twice as fast)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "Is a directory")
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "a pipe or device, not a file; save it as a file first")


def file_fingerprint(path: str | Path) -> tuple[int, int]:
    """Return size and time of change of a file, which change when it is written to."""
    found = Path(path).stat()
    return found.st_size, found.st_mtime_ns
