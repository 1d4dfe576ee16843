"""SRINS voyages: simulate them, calibrate the drift along the rotation axis, observability."""

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

from rotcli.dataclass import dataclass
from rotcli.errors import LogError, ResultError, RigError
from rotcli.files.results.documents import document as result_document
from rotcli.files.results.documents import number, read_result
from rotcli.files.results.result import Result
from rotcli.lazy import lazily
from rotcli.srins import (
    attitude,
    document,
    estimate,
    navigate,
    observability,
    observability_document,
    tables,
)
from rotcli.srins.filter import FilterSettings
from rotcli.srins.model import Damping, VehicleMotion
from rotcli.srins.reciprocation import RotationScheme
from rotcli.units import DEG, DEG_PER_HOUR, PPM, UNITS, FloatArray

with lazily():
    from rotcli.srins import plot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.tables import Table
    from rotcli.logs.record import ImuLog, ImuSource, Progress, ReferenceLog, TableLog
    from rotcli.rig.rig import Rig


# S, section 5: the corner frequencies of the level damping network, rad/s.
DAMPING_NETWORK = (8.5e-4, 8.0e-3, 1.0e-2, 9.412e-2)
_FILTER_DURATION = 36000.0  # s; S lets the filter run for the last ten hours
_MIN_FILTER_DURATION = 600.0  # s; 60 steps of 10 s
_DEFAULT_LATITUDE = 42.3 * DEG  # of S's cruise
_DEFAULT_RATE = 6.0  # deg/s, of S's rotation


@dataclass(frozen=True)
class SrinsOptions:
    """Settings of an SRINS calibration.

    damping: corner frequencies, rad/s; settle: h before the filter starts; gnss_sigma: velocity
    m/s and position m; stated_drift: deg/h; scale: ppm and installation: arcsec, uncalibrated.
    """

    damped: bool = True
    damping: tuple[float, float, float, float] = DAMPING_NETWORK
    measured_damping_states: bool = True
    settle: float | None = None
    filter_interval: float | None = None
    gnss_sigma: tuple[float, float] | None = None
    speed_sigma: float | None = None
    stated_drift: float = 0.003
    scale: float = 10.0
    installation: float = 2.0


@dataclass(frozen=True)
class VoyageTruth:
    """The truth of a simulated voyage: sensor errors by state's name; azimuth (rad) of the vehicle.

    azimuth: None where it is unknown.
    """

    sensor_errors: dict[str, float]
    azimuth: float | None = None


@dataclass(frozen=True, eq=False)
class SrinsResult(Result):
    """An SRINS calibration: its document, and its time series."""

    series: dict[str, FloatArray]

    kind: ClassVar[str] = document.KIND

    def tables(self) -> "list[Table]":
        """Return the table of estimates."""
        return [tables.table(self.document)]

    def figure(self) -> "Figure":
        """Return the estimates against time."""
        return plot.drifts_figure(self.document, alone=True)


@dataclass(frozen=True, eq=False)
class SrinsObservabilityResult(Result):
    """The observability of an SRINS: its document."""

    kind: ClassVar[str] = observability_document.KIND

    def tables(self) -> "list[Table]":
        """Return singular values, and degrees by rotation scheme."""
        return [
            observability_document.singular_table(self.document),
            observability_document.table(self.document),
        ]

    def figure(self) -> "Figure":
        """Return the histogram of the singular values (S, figure 3)."""
        return plot.singular_figure(self.document)


def calibrate_voyage(
    imu: "ImuSource",
    table: "TableLog",
    gnss: "ReferenceLog",
    speed: "ReferenceLog | None",
    rig: "Rig",
    options: SrinsOptions | None = None,
    truth: VoyageTruth | None = None,
    progress: "Progress | None" = None,
) -> SrinsResult:
    """Run the damped mechanization over a voyage, then the filter (S, sections 3 and 4).

    Raises RigError for a rig that is not that of an SRINS, LogError for logs that do not match.
    """
    options = options or SrinsOptions()
    heading = _initial_attitude(rig)
    started = navigate.check_start(imu, table, heading, gnss, settings=rig.table)
    settings, assumed = _filter_settings(rig, options, has_speed=speed is not None)
    chunks = _with_progress(imu, progress)
    increments, start = navigate.preintegrate_log(chunks, averages=rig.imu.sampling != "instant")
    run = navigate.navigate_level(increments, start, table, heading, gnss, speed, settings.damping)
    sums, epochs = navigate.gnss_differences(run, gnss)
    phi = None
    if truth is not None and truth.azimuth is not None:
        phi = attitude.attitude_errors(run, table, truth.azimuth)
    begin = _filter_start(run, options.settle)
    part = run.since(begin)
    skipped = len(run.time) - len(part.time)
    found = estimate.calibrate(
        part.solution, sums[:, skipped:], epochs[skipped:], run.block, settings, start=begin
    )
    stated = document.Stated(
        drift=options.stated_drift * DEG_PER_HOUR,
        scale=options.scale * PPM,
        installation=options.installation * UNITS["angle"]["arcsec"],
        truth=None if truth is None else truth.sensor_errors,
    )
    error = document.ins_error(run, sums, epochs, phi)
    phi_part = None if phi is None else phi[:, skipped:]
    fields = document.fields(found, part, settings, error, stated, phi_part)
    logs: list[Any] = [imu, table, gnss, *([speed] if speed else [])]
    warnings = [text for log in logs for text in log.warnings]
    fields["warnings"] = [*warnings, *started, *assumed, *run.warnings, *found.warnings]
    doc = result_document(document.KIND, logs, rig.effective(), fields)
    latitude = float(part.solution.latitude[0])
    return SrinsResult(doc, document.series(found, float(part.time[0]), latitude))


def analyse_srins(
    rig: "Rig", latitude: float | None = None, rate: float | None = None
) -> SrinsObservabilityResult:
    """Return singular values, ranks and degrees by rotation scheme; latitude deg, rate deg/s.

    Raises ResultError for a latitude near the equator or a pole, or a rate of 0.
    """
    if latitude is not None:
        angle = latitude * DEG
    else:
        angle = _DEFAULT_LATITUDE if rig.site is None else rig.site.latitude
    if not 1.0 * DEG < abs(angle) < 85.0 * DEG:
        raise ResultError("latitude: use 1 to 85 deg north or south")
    speed = _DEFAULT_RATE if rate is None else abs(rate)
    if not 0.0 < speed < 1000.0:
        raise ResultError("rate: use a rate above 0 deg/s and below 1000")
    motion, rotation = VehicleMotion(angle, v_east=1.0), RotationScheme(speed * DEG)
    result = observability.observe(motion, FilterSettings(), rotation)
    fields = observability_document.fields(result, motion, rotation)
    doc = result_document(observability_document.KIND, [], rig.effective(), fields)
    return SrinsObservabilityResult(doc)


def read_truth(path: str) -> VoyageTruth:
    """Return the truth of truth.json of a voyage; raises ResultError."""
    doc = read_result(path, "simulation")
    errors = doc.get("sensor_errors")
    if not isinstance(errors, dict):
        raise ResultError(f"{path}: no sensor_errors; use truth.json of rotcli srins simulate")
    azimuth = number(doc, path, "azimuth_deg") * DEG if "azimuth_deg" in doc else None
    return VoyageTruth({str(name): number(errors, path, name) for name in errors}, azimuth)


def _with_progress(imu: "ImuSource", progress: "Progress | None") -> "Iterator[ImuLog]":
    done = 0
    for chunk in imu.chunks(slice(0, imu.samples)):
        yield chunk
        done += chunk.samples
        if progress:
            progress(done / imu.samples)


def _initial_attitude(rig: "Rig") -> tuple[float, float, float]:
    """Return pitch, roll, azimuth of the body at the start; raises RigError without azimuth."""
    name = rig.path or "no rig.toml"
    if rig.attitude.azimuth is None:
        raise RigError(f"{name}: [attitude] azimuth: missing; set the heading at the start, deg")
    if rig.table.axis_name != "z":
        raise RigError(f"{name}: [table] axis: a single-axis rotation INS rotates about z, up")
    return rig.attitude.pitch or 0.0, rig.attitude.roll or 0.0, rig.attitude.azimuth


def _filter_settings(
    rig: "Rig", options: SrinsOptions, *, has_speed: bool
) -> tuple[FilterSettings, list[str]]:
    """Return the settings of the filter, and warnings for assumed figures."""
    default = FilterSettings()
    velocity, position = options.gnss_sigma or (default.gnss_velocity, default.gnss_position)
    speed_sigma = options.speed_sigma
    if speed_sigma is None:
        speed_sigma = default.reference_white if has_speed else velocity
    white, warnings = {}, []
    for key, name, fallback, unit, size in (
        ("angle_random_walk", "gyro_white", default.gyro_white, "deg/sqrt(h)", DEG / 60.0),
        ("velocity_random_walk", "accel_white", default.accel_white, "m/s/sqrt(h)", 1.0 / 60.0),
    ):
        figure = rig.imu.figure(key)
        if figure is None or not figure.any():
            assumed = f"{fallback / size:.4g} {unit} is assumed"
            warnings.append(f"{rig.path or 'no rig.toml'}: [imu] {key} is missing; {assumed}")
            white[name] = fallback
        else:
            white[name] = float(figure.max())
    settings = replace(
        default,
        damping=Damping(*options.damping, enabled=1.0 if options.damped else 0.0),
        measured_damping=options.damped and options.measured_damping_states,
        interval=options.filter_interval or default.interval,
        reference_white=speed_sigma,
        gnss_velocity=velocity,
        gnss_position=position,
        **white,
    )
    return settings, warnings


def _filter_start(run: navigate.SrinsRun, settle: float | None) -> float:
    """Return the start of the filter, s on the log's clock; raises LogError."""
    span = float(run.time[-1] - run.time[0])
    settled = max(0.0, span - _FILTER_DURATION) if settle is None else settle * 3600.0
    if settled > span - _MIN_FILTER_DURATION:
        raise LogError(
            "settle",
            f"{settled / 3600.0:.4g} h of {span / 3600.0:.4g} h leave no time for the filter; "
            "use fewer hours",
        )
    return float(run.time[0]) + settled
