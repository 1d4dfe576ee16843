"""Error budget of a table rotation: sensor errors in, a result with its document out."""

import logging
import math
from collections.abc import Mapping
from dataclasses import field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from rotcli.budget import document
from rotcli.budget.estimate import budget
from rotcli.budget.expected import budget_expectation
from rotcli.budget.sensors import Sensors
from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.files.results.documents import document as result_document
from rotcli.files.results.documents import number, read_result, sha256
from rotcli.files.results.expected_runs import expected_fields
from rotcli.files.results.result import Result
from rotcli.lazy import lazily
from rotcli.models.base import FixedBase
from rotcli.models.earth import gravity_at
from rotcli.models.expected.motion import StillTable
from rotcli.models.rotation import attitude_matrix
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import DEFAULT_SITE, Rig, rig_from_dict
from rotcli.run.correction import KIND, Correction, read_correction
from rotcli.run.corrections import calibration_model, triad_vector
from rotcli.units import DEG

with lazily():
    from rotcli.budget import plot, plot_within

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.tables import Table

_log = logging.getLogger(__name__)
_SAME_RATE = 0.01  # of the calibration's rate; MEMS gyros are not linear beyond (R16 section 3)
_DEFAULT_RATE = 10.0  # deg/s


@dataclass(frozen=True)
class BudgetOptions:
    """Settings of a budget.

    imu: name or file of a profile; calibration: file. Figures override both: accel_bias m/s^2,
    gyro_bias deg/h, gyro_scale and gyro_installation ppm; noise by rig key, in rig units. rate
    deg/s: None for that of the calibration, else 10. duration: of the growth, s. within_turn: with
    the errors against the table angle (R16 (10) to (25)).
    """

    axes: tuple[str, ...] = ()
    rate: float | None = None
    calibration: str | None = None
    imu: str | None = None
    accel_bias: list[float] | None = None
    gyro_bias: list[float] | None = None
    gyro_scale: list[float] | None = None
    gyro_installation: list[float] | None = None
    noise: Mapping[str, float | None] = field(default_factory=dict)
    duration: float = 300.0
    within_turn: bool = False


@dataclass(frozen=True, eq=False)
class BudgetResult(Result):
    """An error budget: its document."""

    kind: ClassVar[str] = document.KIND

    def tables(self) -> "list[Table]":
        """Return the tables: one turn, full model, growth, calibration time."""
        return document.tables(self.document)

    def one_line_summary(self) -> str:
        """Return the recommendation."""
        return str(self.document["recommendation"])

    def figure(self) -> "Figure":
        """Return the errors within the turn, if requested, else growth and calibration time."""
        if self.document.get("within_turn"):
            return plot_within.within_figure(self.document)
        return plot.budget_figure(self.document)


@dataclass(frozen=True, eq=False)
class SensorErrors:
    """Sensor errors and noise of a budget, and their origin."""

    sensors: Sensors
    rig: Rig
    rate: float
    name: str | None
    sources: dict[str, str]
    warnings: tuple[str, ...]


def gather_sensor_errors(options: BudgetOptions, rig: Rig | None) -> SensorErrors:
    """Return the sensor errors of profile, calibration and figures, each overriding the former.

    rig: None for that of the calibration, else the default. Raises ResultError if there are no
    sensor errors at all, or the table does not turn.
    """
    sensors, name, warnings = Sensors(), None, []
    rate, sources = options.rate, {}
    if options.imu:
        profile = read_profile(options.imu)
        sensors, name, sources["imu"] = sensors.with_profile(profile), profile.name, options.imu
    if options.calibration and calibration_model(options.calibration)[0] == "triad":
        path = options.calibration
        doc = read_result(path, KIND)
        sensors = sensors.with_triad(*triad_vector(path, doc))
        rig = _rig_of(path, doc) if rig is None else rig
        sources |= {"calibration": path, "calibration_sha256": sha256(path)}
    elif options.calibration:
        path = options.calibration
        correction, calibration_rig, calibrated = _read_calibration(path)
        sensors = sensors.with_correction(correction)
        rig = calibration_rig if rig is None else rig
        rate = calibrated if rate is None else rate
        sources |= {"calibration": path, "calibration_sha256": sha256(path)}
        if abs(abs(rate) - abs(calibrated)) > _SAME_RATE * abs(calibrated):
            warnings.append(
                f"{path}: calibration at {calibrated:.6g} deg/s, budget for {rate:.6g} deg/s. "
                "MEMS gyros are not linear; calibrate at the rate of the run"
            )
    sensors = sensors.with_figures(
        accel_bias=options.accel_bias,
        gyro_bias=options.gyro_bias,
        gyro_scale=options.gyro_scale,
        gyro_installation=options.gyro_installation,
    )
    if not sensors.known:
        raise ResultError("no sensor errors: give an IMU profile, a calibration, or figures")
    rate = _DEFAULT_RATE if rate is None else float(rate)
    if rate == 0.0 or not math.isfinite(rate):
        raise ResultError("rate: a table that does not turn has no turn; give a rate above 0")
    rig = rig or Rig()
    sensors = sensors.with_noise(rig.imu, options.noise)
    return SensorErrors(sensors, rig, rate, name, sources, (*warnings, *sensors.assumed()))


def budget_of(errors: SensorErrors, options: BudgetOptions) -> BudgetResult:
    """Return the error after one turn about each axis, its growth, and the best axis."""
    rig, sensors = errors.rig, errors.sensors
    site, attitude = rig.site or DEFAULT_SITE, rig.attitude
    gravity = gravity_at(site.latitude, site.height, site.gravity)
    C_nb = attitude_matrix(attitude.pitch or 0.0, attitude.roll or 0.0, attitude.azimuth or 0.0)
    origin = [errors.sources[key] for key in ("imu", "calibration") if key in errors.sources]
    _log.info(
        "sensor errors from %s; one turn at %.6g deg/s, then %g s",
        ", ".join(origin) or "the options",
        errors.rate,
        options.duration,
    )
    result = budget(
        sensors.gyro,
        sensors.accel_bias,
        sensors.noise,
        FixedBase(site.latitude, gravity, C_nb),
        rate=errors.rate * DEG,
        axes=tuple(dict.fromkeys(options.axes)) or ("x", "y", "z"),
        duration=options.duration,
    )
    expected = budget_expectation(
        sensors,
        StillTable(
            latitude=site.latitude,
            height=site.height,
            gravity=gravity,
            pitch=attitude.pitch or 0.0,
            roll=attitude.roll or 0.0,
            azimuth=attitude.azimuth or 0.0,
        ),
        axes=tuple(dict.fromkeys(options.axes)) or ("x", "y", "z"),
        rate=errors.rate * DEG,
        duration=options.duration,
        matrix_sigma=_matrix_sigma(errors),
        attitude_sigma=np.array(
            [s or 0.0 for s in (attitude.pitch_sigma, attitude.roll_sigma, attitude.azimuth_sigma)]
        ),
    )
    fields = {
        **document.fields(result, within_turn=options.within_turn),
        "expected": expected_fields(expected),
        "sources": errors.sources,
    }
    fields["recommendation"] += sensors.ranking_caveat()
    fields["warnings"] = list(errors.warnings)
    return BudgetResult(result_document(document.KIND, [], rig.effective(), fields))


def _matrix_sigma(errors: SensorErrors) -> float:
    """Return the sigma of the gyro matrix: the rig's where no element is known, else 0."""
    prior = errors.rig.imu.figure("scale_sigma")
    unknown = not any(name.startswith("Kg") for name in errors.sensors.known)
    return float(np.max(prior)) if unknown and prior is not None else 0.0


def _read_calibration(path: str) -> tuple[Correction, Rig, float]:
    """Return the correction of a calibration file, the rig and the rate (deg/s) it is for."""
    correction, doc = read_correction(path), read_result(path, KIND)
    return correction, _rig_of(path, doc), number(doc, path, "rate", "value")


def _rig_of(path: str, doc: Mapping[str, Any]) -> Rig:
    """Return the rig of a calibration document; raises ResultError or RigError."""
    rig = doc.get("rig") or {}
    if not isinstance(rig, dict):
        raise ResultError(f"{path}: rig: not a table of sections; calibrate again, or give a rig")
    return rig_from_dict(rig, path)
