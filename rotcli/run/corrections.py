"""Apply calibration documents of any model to an IMU log: the one place for all commands.

Each model has a reader that returns a `ReadingCorrection`; a list of them corrects a log in
memory or a streamed one, chunk by chunk. A new model is one entry of `READERS`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.files.results.documents import read_result
from rotcli.lazy import lazily
from rotcli.logs.record import CHUNK_SAMPLES, ImuLog, ImuSource, Sampling
from rotcli.models.sensors import TriadErrors, correct
from rotcli.models.triad import parameters as p
from rotcli.models.triad.correction import EQUATION, correct_readings
from rotcli.run.correction import KIND, Correction, read_correction
from rotcli.units import FloatArray

with lazily():
    from rotcli.run.laboratory import corrections as laboratory

if TYPE_CHECKING:
    from rotcli.run.laboratory.corrections import Document

_SMALLEST_DETERMINANT = 0.01  # raw counts scaled by guess stay above 0.1
DEFAULT_MODEL = "column"  # of documents that were written before there were several


class ReadingCorrection(Protocol):
    """What a calibration document does to readings."""

    @property
    def path(self) -> str: ...  # noqa: D102
    @property
    def equation(self) -> str: ...  # noqa: D102
    @property
    def imu(self) -> str | None: ...  # noqa: D102

    def apply(self, log: ImuLog) -> tuple[FloatArray, FloatArray]:
        """Return corrected gyros (n, 3), rad/s, and accelerometers (n, 3), m/s^2, of a log."""


@dataclass(frozen=True, eq=False)
class ColumnCorrection:
    """Biases and one column of the gyro matrix (model `column`)."""

    path: str
    imu: str | None
    gyro: TriadErrors
    accel_bias: FloatArray

    equation: str = "w = (I + N)^-1 (gyro - d), f = accel - b"

    def apply(self, log: ImuLog) -> tuple[FloatArray, FloatArray]:
        """Return corrected readings."""
        return correct(self.gyro, log.gyro), log.accel - self.accel_bias


@dataclass(frozen=True, eq=False)
class TriadCorrection:
    """Both triads (model `triad`): all parameters (60,), SI; null ones are zero."""

    path: str
    imu: str | None
    x: FloatArray
    absent: tuple[str, ...] = ()

    equation: str = EQUATION

    def apply(self, log: ImuLog) -> tuple[FloatArray, FloatArray]:
        """Return corrected readings."""
        return correct_readings(self.x, log.gyro, log.accel)


def _imu_name(doc: Mapping[str, Any]) -> str | None:
    rig = doc.get("rig")
    imu = rig.get("imu") if isinstance(rig, dict) else None
    name = imu.get("name") if isinstance(imu, dict) else None
    return name if isinstance(name, str) else None


def read_column(path: str, doc: Mapping[str, Any]) -> ReadingCorrection:
    """Return the correction of a document of model `column`."""
    found = read_correction(path)
    full = found.gyro_column is not None
    return ColumnCorrection(path, found.imu, found.gyro_errors(full=full), found.accel_bias)


def triad_vector(path: str, doc: Mapping[str, Any]) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the parameters (60,), SI, of a triad document, and the sensor parameters it lacks."""
    parameters = doc.get("parameters")
    if not isinstance(parameters, dict):
        raise ResultError(f"{path}: parameters: missing; run rotcli triad again")
    x, factors, unit_names = np.zeros(p.count()), p.unit_factors(), p.unit_names()
    absent = []
    for k, name in enumerate(p.NAMES[: p.LEVERS.start]):
        entry = parameters.get(name)
        value = entry.get("value") if isinstance(entry, dict) else None
        if value is None:
            absent.append(name)
            continue
        sound = isinstance(value, int | float) and not isinstance(value, bool)
        if not sound or not isinstance(entry, dict) or entry.get("unit") != unit_names[k]:
            raise ResultError(
                f"{path}: parameters.{name}: {entry!r} is not a value in {unit_names[k]}; "
                "run rotcli triad again"
            )
        x[k] = float(value) * factors[k]
    for group, what in ((p.N, "gyro"), (p.M, "accelerometer")):
        if np.linalg.det(np.eye(3) + x[group].reshape(3, 3)) < _SMALLEST_DETERMINANT:
            raise ResultError(
                f"{path}: the {what} matrix cannot be inverted; run rotcli triad again"
            )
    return x, tuple(absent)


def read_triad(path: str, doc: Mapping[str, Any]) -> ReadingCorrection:
    """Return the correction of a document of model `triad`."""
    x, absent = triad_vector(path, doc)
    return TriadCorrection(path, _imu_name(doc), x, absent)


READERS: dict[str, Callable[[str, Mapping[str, Any]], ReadingCorrection]] = {
    "column": read_column,
    "triad": read_triad,
    "scale": lambda path, doc: laboratory.read_scale(path, doc),
    "thermal": lambda path, doc: laboratory.read_thermal(path, doc),
}


def calibration_model(path: str) -> tuple[str, dict[str, Any]]:
    """Return the model of a calibration document and the document; raises ResultError."""
    doc = read_result(path, KIND)
    model = doc.get("model", DEFAULT_MODEL)
    if model not in READERS:
        known = ", ".join(READERS)
        raise ResultError(f"{path}: model: {model!r} is unknown; known: {known}")
    return str(model), doc


def read_corrections(paths: Sequence[str], imu: str | None = None) -> list[ReadingCorrection]:
    """Return the corrections of calibration documents, in order; raises ResultError.

    imu: name of the IMU in the rig; a document of another IMU is an error. Scale and thermal
    calibrations are put in their order, and every error counts once (`combine`).
    """
    return _corrections([(path, *calibration_model(path)) for path in paths], imu)


def _corrections(
    documents: "Sequence[Document]", imu: str | None, omitted: Sequence[str] = ()
) -> list[ReadingCorrection]:
    """Return the corrections of documents; those of `omitted` paths are applied elsewhere."""
    found: dict[str, ReadingCorrection] = {}
    for path, model, doc in documents:
        if path in omitted:
            continue
        correction = READERS[model](path, doc)
        if imu and correction.imu and imu.split() != correction.imu.split():
            raise ResultError(
                f"{path}: made for the IMU {correction.imu}, but the rig names {imu}; calibrate "
                "this IMU, or correct [imu] name"
            )
        found[path] = correction
    if any(model in ("scale", "thermal") for _, model, _ in documents):
        return laboratory.combine(documents, found)
    return list(found.values())


def split_corrections(
    paths: Sequence[str], imu: str | None = None
) -> tuple[Correction | None, list[ReadingCorrection]]:
    """Return the single-axis calibration of model `column`, if any, and all others in order.

    Navigation checks the axis and the rate of the former; the others apply to readings of any
    motion. Raises ResultError, also for two of model `column`.
    """
    documents = [(path, *calibration_model(path)) for path in paths]
    columns = [path for path, model, _ in documents if model == DEFAULT_MODEL]
    if len(columns) > 1:
        raise ResultError(
            f"{columns[1]}: a second single-axis calibration; merge those of three axes with "
            "rotcli triad"
        )
    others = _corrections(documents, imu, columns)
    column = None
    if columns:
        column = read_correction(columns[0])
        column.check_imu_name(imu)
    return column, others


def neutral_correction(others: Sequence[ReadingCorrection], axis: FloatArray) -> Correction:
    """Return a single-axis correction that changes nothing, for readings corrected by others."""
    return Correction(
        path=others[0].path,
        axis=axis,
        rates=(),
        gyro_bias=np.zeros(3),
        gyro_column=np.zeros(3),
        accel_bias=np.zeros(3),
        imu=others[0].imu,
    )


def biases_of(corrections: Sequence[ReadingCorrection]) -> list[ReadingCorrection]:
    """Return corrections that subtract the biases alone; raises ResultError for other models."""
    found: list[ReadingCorrection] = []
    for correction in corrections:
        if isinstance(correction, laboratory.ScaleCorrection | laboratory.ThermalCorrection):
            found.append(correction.biases_alone())
            continue
        if not isinstance(correction, TriadCorrection):
            raise ResultError(f"{correction.path}: its model has no biases alone; use mode full")
        x = np.zeros_like(correction.x)
        for group in (p.GYRO_BIAS, p.ACCEL_BIAS):
            x[group] = correction.x[group]
        found.append(replace(correction, x=x))
    return found


def correct_log(log: ImuLog, corrections: Sequence[ReadingCorrection]) -> ImuLog:
    """Return a log with all corrections applied, one after the other."""
    for correction in corrections:
        gyro, accel = correction.apply(log)
        log = replace(log, gyro=gyro, accel=accel)
    return log


class CorrectedSource:
    """A streamed IMU log whose chunks are corrected as they are read."""

    def __init__(self, source: ImuSource, corrections: Sequence[ReadingCorrection]) -> None:
        """Wrap a source; the file's provenance stays the source's."""
        self.source, self.corrections = source, corrections

    @property
    def path(self) -> str:
        """The file."""
        return self.source.path

    @property
    def interval(self) -> float:
        """Sample interval, s."""
        return self.source.interval

    @property
    def sampling(self) -> Sampling:
        """What a sample means."""
        return self.source.sampling

    @property
    def rows(self) -> int:
        """Records of the file."""
        return self.source.rows

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the source."""
        return self.source.warnings

    @property
    def time(self) -> FloatArray:
        """First and last time, s."""
        return self.source.time

    @property
    def samples(self) -> int:
        """Samples of the even clock."""
        return self.source.samples

    @property
    def channels(self) -> tuple[str, ...]:
        """Axes that the file contains."""
        return self.source.channels

    @property
    def stamp(self) -> tuple[int, int] | None:
        """Size and time of change of the file."""
        stamp: tuple[int, int] | None = getattr(self.source, "stamp", None)
        return stamp

    def between(self, start: float, end: float) -> slice:
        """Return the span of samples within [start, end] (s)."""
        return self.source.between(start, end)

    def within(self, start: float, end: float) -> slice:
        """Return the span of samples that describe [start, end] (s) alone."""
        return self.source.within(start, end)

    def times(self, span: slice) -> FloatArray:
        """Return the times (k,) of a span, s."""
        return self.source.times(span)

    def crop(self, start: float, end: float) -> ImuLog:
        """Return the corrected samples within [start, end] (s) in memory."""
        return correct_log(self.source.crop(start, end), self.corrections)

    def chunks(self, span: slice) -> Iterator[ImuLog]:
        """Yield corrected chunks of a span."""
        for piece in self.source.chunks(span):
            yield correct_log(piece, self.corrections)

    def fill(self, out: FloatArray, name: str, span: slice) -> None:
        """Write one corrected axis of a span into out (k,)."""
        done = 0
        for piece in self.chunks(span):
            column = piece.column(name)
            out[done : done + len(column)] = column
            done += len(column)


def corrected(source: ImuSource, corrections: Sequence[ReadingCorrection]) -> ImuSource:
    """Return a source with all corrections applied; the same source when there are none."""
    if not corrections:
        return source
    if isinstance(source, ImuLog) and source.samples <= CHUNK_SAMPLES:
        return correct_log(source, corrections)
    return CorrectedSource(source, corrections)
