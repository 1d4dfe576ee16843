"""The encoding of a text log: by its first bytes, or as the rig says."""

import re

from rotcli.errors import LogError

NO_TEXT = "neither CSV (UTF-8 text with a header line) nor Parquet; is this the right file?"
# First bytes of files that other programs read and write as CSV or Parquet.
_OTHER_FILES = {
    b"PK\x03\x04": "a ZIP archive (or an Excel or NumPy file)",
    b"BZh": "compressed by bzip2",
    b"\xfd7zXZ": "compressed by xz",
    b"7z\xbc\xaf": "a 7z archive",
    b"MATLAB 5.0 MAT": "a MATLAB file",
    b"\x89HDF\r\n": "an HDF5 file (MATLAB 7.3 writes it, too)",
    b"\x93NUMPY": "a NumPy file",
    b"ARROW1": "an Arrow (Feather) file",
    b"\xd0\xcf\x11\xe0": "an Excel file",
    b"FMT, 128": "an ArduPilot text log (mavlogdump.py --types IMU --format csv writes CSV)",
    b"ULog\x01": "a PX4 ULog (ulog2csv writes CSV)",
    b"\xa3\x95\x80": "an ArduPilot dataflash log (mavlogdump.py --format csv writes CSV)",
}
_HEADER_LIMIT = 1 << 20  # letters of a first line
_BYTE_ORDERS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
_MIN_ZEROS = 0.7  # share of every second byte that is 0 in UTF-16 without a byte order mark
_MAX_OTHER_ZEROS = 0.01  # share of the bytes between them
_SHOWN = 1024  # bytes or letters that show whether a file is text


def find_encoding(head: bytes) -> str:
    """Return the encoding that the first bytes of a text show: utf-8, or a form of UTF-16."""
    if head[:2] in _BYTE_ORDERS:
        return _BYTE_ORDERS[head[:2]]
    start = head[:_SHOWN]
    if b"\0" not in start or len(start) < 4:
        return "utf-8"
    zeros = [half.count(0) / len(half) for half in (start[::2], start[1::2])]
    if zeros[1] > _MIN_ZEROS and zeros[0] < _MAX_OTHER_ZEROS:
        return "utf-16-le"
    if zeros[0] > _MIN_ZEROS and zeros[1] < _MAX_OTHER_ZEROS:
        return "utf-16-be"
    return "utf-8"


def decode(path: str, head: bytes, encoding: str) -> str:
    """Return the head of a text log as text; raises LogError where it is no text."""
    if not head.strip(b"\xef\xbb\xbf\xff\xfe \t\r\n\0"):
        raise LogError(path, "the file is empty; a header line and rows of numbers are expected")
    other = next((kind for start, kind in _OTHER_FILES.items() if head.startswith(start)), None)
    if other:
        raise LogError(path, f"the file is {other}; write the log as CSV, gzip, zstd or Parquet")
    if encoding == "utf-8":
        if b"\0" in head:
            raise LogError(path, NO_TEXT)
        if len(re.split(rb"[\r\n]", head, maxsplit=1)[0]) >= _HEADER_LIMIT:
            finding = "the first line has more than a million letters"
            raise LogError(path, f"{finding}; it should name some ten columns", row=1)
    # Half a letter may be at the end; comments of vendors may be in an older encoding.
    text = head.decode("utf-8-sig" if encoding == "utf-8" else encoding, "replace")
    if encoding == "utf-8" and "\ufffd" in text[:-1]:
        text = head.decode("cp1252", "replace")
    letters = text[:_SHOWN]
    if sum(not (c.isprintable() or c in "\t\r\n") for c in letters) > 0.1 * len(letters):
        raise LogError(path, NO_TEXT)
    return text
