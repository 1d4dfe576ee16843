"""Result files: one JSON object with provenance, written atomically, and read back.

Every document starts `kind, schema, rotcli, inputs, rig`; what follows is the kind's own, put
together in the module of that kind. Quantities carry value, sigma and unit.
"""

import hashlib
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from rotcli.errors import ResultError
from rotcli.files.atomic import atomic_write
from rotcli.files.results.validate import unique_keys, validate
from rotcli.files.text import MOST_JSON, file_fingerprint, read_text
from rotcli.version import __version__

SCHEMA = 1
_BEYOND = 1e200  # no quantity of a result comes near
STANDARD_OUTPUT = "-"


class Log(Protocol):
    """What provenance needs of a log record."""

    @property
    def path(self) -> str: ...  # noqa: D102
    @property
    def rows(self) -> int: ...  # noqa: D102
    @property
    def stamp(self) -> tuple[int, int] | None: ...  # noqa: D102
    @property
    def time(self) -> Any: ...  # noqa: D102


def quantity(value: float, sigma: float | None, unit: str) -> dict[str, Any]:
    """Return a quantity as results hold it; sigma is None where unknown."""
    return {"value": value, "sigma": sigma, "unit": unit}


def document(
    kind: str, logs: Sequence[Log], rig: Mapping[str, Any], own: Mapping[str, Any]
) -> dict[str, Any]:
    """Return a result document: provenance of the logs, the effective rig, the kind's own fields.

    Numbers that are not finite become null.
    """
    return {
        "kind": kind,
        "schema": SCHEMA,
        "rotcli": __version__,
        "inputs": [_provenance(log) for log in logs],
        "rig": _plain(rig),
        **{key: _plain(value) for key, value in own.items()},
    }


def write_result(path: str, result: Mapping[str, Any]) -> None:
    """Write a document to a file, or to standard output when the path is `-`.

    Raises ResultError when the file cannot be written; an older one then stays as it was.
    """
    text = json.dumps(result, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    write_text(path, text)


def write_text(path: str, text: str) -> None:
    """Write a text file, or standard output for `-`, in UTF-8; raises ResultError.

    Parts of a file's name that are not text become escapes, which JSON reads back.
    """
    data = text.encode("utf-8", "backslashreplace")
    if path == STANDARD_OUTPUT:
        sys.stdout.flush()
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
        return
    try:
        with atomic_write(path) as stream:
            stream.write(data)
    except OSError as fault:
        raise write_error(path, fault) from fault


def write_error(path: str, fault: OSError) -> ResultError:
    """Return the error that says why an output cannot be written."""
    return ResultError(
        f"{path}: cannot be written: {fault.strerror or fault}; "
        "choose another folder or check its permissions"
    )


def read_result(path: str, kind: str | None = None) -> dict[str, Any]:
    """Read a result document; with `kind`, insist on that kind.

    Raises ResultError for a file that is no such document.
    """
    try:
        data = parse_json(read_text(path, MOST_JSON))
    except OSError as fault:
        raise ResultError(f"{path}: cannot be read: {fault.strerror or fault}") from fault
    except (ValueError, RecursionError) as fault:
        raise ResultError(f"{path}: not a result file: {fault}; make it with rotcli") from fault
    if not isinstance(data, dict) or not isinstance(data.get("kind"), str):
        raise ResultError(f"{path}: not a result file: it has no kind; make it with rotcli")
    if data.get("schema") != SCHEMA:
        raise ResultError(
            f"{path}: schema {data.get('schema')!r} is not known to rotcli {__version__}, "
            f"which reads schema {SCHEMA}; use the rotcli that wrote it"
        )
    validate(data, path)
    if kind is not None and data["kind"] != kind:
        raise ResultError(f"{path}: contains a result of kind {data['kind']}; a {kind} is needed")
    return data


def parse_json(text: str | bytes) -> Any:
    """Return the content of JSON text.

    Raises ValueError for a key that occurs twice and for a number that no result contains, and
    RecursionError.
    """
    return json.loads(
        text,
        parse_int=_int,
        parse_float=_float,
        parse_constant=_float,
        object_pairs_hook=unique_keys,
    )


def _int(text: str) -> int:
    return int(text) if abs(_float(text)) < _BEYOND else 0


def _float(text: str) -> float:
    value = float(text)
    if not abs(value) < _BEYOND:
        raise ValueError(f"{text[:20]} is no number of a result")
    return value


@contextmanager
def sound(path: str, kind: str) -> Iterator[None]:
    """Turn what a document of wrong shape runs into, where it is used, into one ResultError."""
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as fault:
        text = f"{type(fault).__name__}: {str(fault)[:100]}"
        raise ResultError(
            f"{path}: not a valid {kind} result ({text}); create it again with rotcli"
        ) from fault


def number(data: Mapping[str, Any], path: str, *keys: str) -> float:
    """Return the finite number at `keys` of a document read from `path`; raises ResultError."""
    value: Any = data
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ResultError(
            f"{path}: {'.'.join(keys)}: {value!r} is not a number; create it again with rotcli"
        )
    return float(value)


def sha256(path: str) -> str:
    """Return the hash of a file's bytes, as results hold it; raises OSError."""
    with Path(path).open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _provenance(log: Log) -> dict[str, Any]:
    try:
        digest = sha256(log.path)
        changed = log.stamp is not None and file_fingerprint(log.path) != log.stamp
    except OSError as fault:
        what = f"cannot be read again for its hash: {fault.strerror or fault}"
        raise ResultError(f"{log.path}: {what}; leave it in place until the end") from fault
    if changed:
        raise ResultError(
            f"{log.path}: changed after it was read; wait until the logger is done, and run again"
        )
    return {
        "path": log.path,
        "sha256": digest,
        "rows": log.rows,
        "start_s": float(log.time[0]),
        "end_s": float(log.time[-1]),
    }


def _plain(value: Any) -> Any:
    """Return the value in JSON's own types."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
