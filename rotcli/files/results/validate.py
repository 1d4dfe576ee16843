"""Validate result documents: the schema of rotcli/data/schema, and what a schema cannot state.

Units are part of the contract: a bias in deg/s read as deg/h would be 3600 times too small.
"""

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from rotcli.errors import ResultError
from rotcli.files.installed import DATA
from rotcli.lazy import lazily

with lazily():
    import fastjsonschema
    import numpy as np

# Cosine distance from a unit vector that rounding in a file explains.
_AXIS_TOLERANCE = 1e-3
# Relative asymmetry and smallest eigenvalue of a covariance that rounding in a file explains.
_COVARIANCE_TOLERANCE = 1e-6
_COLUMNS = {
    "x": ("Kgx", "Kgyx", "Kgzx"),
    "y": ("Kgxy", "Kgy", "Kgzy"),
    "z": ("Kgxz", "Kgyz", "Kgz"),
}


def unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of a JSON file; raises ValueError for a key that occurs twice."""
    found = dict(pairs)
    if len(found) < len(pairs):
        twice = Counter(name for name, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"{twice}: this key occurs twice")
    return found


def validate(doc: Mapping[str, Any], path: str) -> None:
    """Raise ResultError, naming the key, for a document that breaks the contract."""
    _check_schema("", doc, path)
    kind = doc["kind"]
    if kind in ("allan", "calibration", "navigation"):
        _check_schema(kind, doc, path)
    if kind == "calibration":
        _check_calibration(doc, path)


def _check_schema(definition: str, doc: Mapping[str, Any], path: str) -> None:
    if isinstance(doc.get("schema"), bool):  # JSON Schema takes true for 1
        raise ResultError(f"{path}: schema: true is not 1; create the file again with rotcli")
    try:
        _validator(definition)(doc)
    except fastjsonschema.JsonSchemaValueException as error:
        place = error.name.removeprefix("data").lstrip(".")
        text = error.message.removeprefix(error.name).strip()
        text = text.replace("same as const definition: ", "")
        found = json.dumps(error.value, ensure_ascii=False, default=str)
        shown = found if len(found) < 60 else found[:57] + "..."
        raise ResultError(
            f"{path}: {place or 'document'}: {shown}: {text}; create the file again with rotcli"
        ) from error


@cache
def _validator(definition: str) -> Callable[[Mapping[str, Any]], object]:
    """Return the compiled check of a definition of the schema; `` is the document itself."""
    file = DATA / "schema" / "result.json"
    schema: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    if definition:
        chosen = schema["definitions"][definition]
        schema = {"definitions": schema["definitions"], **chosen}
    check: Callable[[Mapping[str, Any]], object] = fastjsonschema.compile(schema)
    return check


def _check_calibration(doc: Mapping[str, Any], path: str) -> None:
    """Check axis against column, and the covariance: shape, names, symmetry, definiteness."""
    parameters = doc.get("parameters", {})
    axis = doc.get("axis")
    if isinstance(axis, list) and abs(math.hypot(*axis) - 1.0) > _AXIS_TOLERANCE:
        raise ResultError(f"{path}: axis: {axis} is not a unit vector; calibrate again")
    if isinstance(axis, str) and doc.get("model", "column") == "column":
        present = {name for name in parameters if name.startswith("Kg")}
        missing = set(_COLUMNS[axis]) - present
        if present and missing:
            names = ", ".join(sorted(missing))
            raise ResultError(
                f"{path}: parameters: {names} missing for a rotation about {axis}; calibrate again"
            )
    covariance = doc.get("covariance")
    if covariance is not None:
        _check_covariance(covariance, parameters, path)


def _check_covariance(
    covariance: Mapping[str, Any], parameters: Mapping[str, Any], path: str
) -> None:
    order, rows = covariance["order"], covariance["matrix"]
    unknown = [name for name in order if name not in parameters]
    if unknown:
        raise ResultError(
            f"{path}: covariance.order: {unknown[0]} is not a parameter; calibrate again"
        )
    if len(rows) != len(order) or any(len(row) != len(order) for row in rows):
        shape = f"{len(rows)} rows of {', '.join(sorted({str(len(row)) for row in rows}))}"
        raise ResultError(
            f"{path}: covariance.matrix: {shape} for {len(order)} parameters; calibrate again"
        )
    units = covariance.get("units")
    if units is not None and units != [parameters[name]["unit"] for name in order]:
        raise ResultError(f"{path}: covariance.units: not those of the parameters; calibrate again")
    estimated = {n for n, q in parameters.items() if q.get("value") is not None and q.get("sigma")}
    absent = sorted(estimated - set(order))
    if absent:
        raise ResultError(f"{path}: covariance.order: {absent[0]} is missing; calibrate again")
    matrix = np.array(rows, dtype=float).reshape(len(order), len(order))
    sigma = np.sqrt(np.abs(np.diag(matrix)))
    scaled = matrix / np.maximum(np.outer(sigma, sigma), 1e-300)
    if np.any(np.diag(matrix) < 0.0):
        name = order[int(np.argmin(np.diag(matrix)))]
        raise ResultError(f"{path}: covariance.matrix: the variance of {name} is negative")
    if np.abs(scaled - scaled.T).max(initial=0.0) > _COVARIANCE_TOLERANCE:
        raise ResultError(f"{path}: covariance.matrix: not symmetric; calibrate again")
    eigenvalues = np.linalg.eigvalsh((scaled + scaled.T) / 2.0)
    if eigenvalues.min(initial=0.0) < -_COVARIANCE_TOLERANCE * len(order):
        raise ResultError(f"{path}: covariance.matrix: not positive definite; calibrate again")
