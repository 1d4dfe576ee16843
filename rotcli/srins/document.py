"""A long-run SRINS calibration as a result document and as time series."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotcli import units
from rotcli.dataclass import dataclass
from rotcli.files.results.documents import quantity
from rotcli.models import earth
from rotcli.srins.estimate import (
    Consistency,
    SrinsCalibration,
    uncalibrated_drift_error,
    uncalibrated_level_error,
    unreliable_estimates,
)
from rotcli.srins.filter import FilterSettings
from rotcli.srins.model import (
    ACCEL_BIAS,
    ATTITUDE,
    GYRO_BIAS,
    GYRO_BIAS_Z,
    SENSOR_ERRORS,
    STATES,
)
from rotcli.srins.navigate import SrinsRun
from rotcli.units import FloatArray

KIND = "srins"
FRACTIONS = (0.33, 0.22, 0.10)  # of the stated drift: the paper's steps of convergence
_ARCSEC = units.UNITS["angle"]["arcsec"]
# Every state's human unit; positions are shown in metres.
_UNIT = {
    **dict.fromkeys(STATES, ("m/s", 1.0)),
    **dict.fromkeys(STATES[ATTITUDE], ("arcsec", _ARCSEC)),
    **dict.fromkeys(STATES[GYRO_BIAS], ("deg/h", units.DEG_PER_HOUR)),
    **dict.fromkeys(STATES[ACCEL_BIAS], ("m/s^2", 1.0)),
}
_HISTORY = (*SENSOR_ERRORS, "phi_U", "phi_E", "phi_N")
_POINTS = 601  # of a history: a minute in ten hours
_CYCLE = 240.0  # s, of the paper's rotation scheme


def _units(latitude: float) -> list[tuple[str, float]]:
    R_M, R_N = (float(r) for r in earth.radii(latitude))
    metres = {"d_latitude": 1.0 / R_M, "d_longitude": 1.0 / (R_N * float(np.cos(latitude)))}
    return [("m", metres[name]) if name in metres else _UNIT[name] for name in STATES]


@dataclass(frozen=True)
class Stated:
    """Sensor errors that the user states, SI: drift rad/s, scale, installation rad.

    truth: true sensor errors by state's name in the document's units, where known.
    """

    drift: float
    scale: float
    installation: float
    truth: Mapping[str, float] | None = None


def fields(
    result: SrinsCalibration,
    run: SrinsRun,
    settings: FilterSettings,
    error: Mapping[str, FloatArray],
    stated: Stated,
    attitude: FloatArray | None = None,
) -> dict[str, Any]:
    """Return the fields of the document.

    run: from the filter's start on; error: the INS error over the complete run; attitude: true
    attitude errors (3, n + 1), rad, of the run, where known.
    """
    started = float(run.time[0])
    latitude = float(run.solution.latitude[0])
    unit = _units(latitude)
    damping = settings.damping
    final = {
        name: quantity(result.estimates[-1, k] / f, result.sigma[-1, k] / f, u)
        for k, (name, (u, f)) in enumerate(zip(STATES, unit, strict=True))
    }
    return {
        "method": "srins",
        "mode": "damped" if damping.enabled else "undamped",
        "measured_damping_states": settings.measured_damping,
        "damping_radps": [damping.w1, damping.w2, damping.w3, damping.w4],
        "latitude_deg": latitude / units.DEG,
        "filter": {
            "start_s": started,
            "end_s": started + float(result.time[-1]),
            "interval_s": settings.interval,
        },
        "estimates": {name: final[name] for name in SENSOR_ERRORS},
        "states": {name: final[name] for name in STATES if name not in SENSOR_ERRORS},
        "truth": dict(stated.truth) if stated.truth else None,
        **_expected_errors(stated, run, latitude),
        "unreliable": unreliable_estimates(result, settings.initial_sigma(latitude)),
        "convergence": _convergence(result, stated.drift),
        "consistency": {
            "gnss": _consistency(result.gnss),
            "reference": None if result.reference is None else _consistency(result.reference),
        },
        "degrees": dict(zip(STATES, result.observability, strict=True)),
        "maneuvers_h": result.maneuvers / units.HOUR,
        "history": _history(result, unit, None if attitude is None else _at_steps(attitude, run)),
        "ins_error": _thinned(error),
    }


def _expected_errors(stated: Stated, run: SrinsRun, latitude: float) -> dict[str, Any]:
    """Return the errors of gyro_bias_z and gyro_bias_y caused by uncalibrated scale factors."""
    axial = uncalibrated_drift_error(latitude, stated.scale, stated.installation)
    level = uncalibrated_level_error(latitude, stated.scale, run.solution.theta)
    return {
        "expected_bias": {
            **quantity(axial / units.DEG_PER_HOUR, None, "deg/h"),
            "scale_ppm": stated.scale / units.PPM,
            "installation_arcsec": stated.installation / _ARCSEC,
        },
        "expected_bias_y": quantity(level / units.DEG_PER_HOUR, None, "deg/h"),
    }


def _convergence(result: SrinsCalibration, drift: float) -> dict[str, Any]:
    times = result.convergence(GYRO_BIAS_Z, drift * np.array(FRACTIONS))
    return {
        "stated_drift_dph": drift / units.DEG_PER_HOUR,
        "fractions": list(FRACTIONS),
        "hours": [None if t is None else t / units.HOUR for t in times],
    }


def _at_steps(attitude: FloatArray, run: SrinsRun) -> Callable[[FloatArray], FloatArray]:
    """Return the interpolation of attitude (3, n + 1) to times (m,), s since the run's start.

    It is averaged over four minutes: the ripple of the rotation would make aliases of a history
    with a point a minute.
    """
    time = run.time - run.time[0]
    kernel = np.ones(max(1, round(_CYCLE / run.block)))
    count = np.convolve(np.ones(len(time)), kernel, mode="same")
    smooth = [np.convolve(row, kernel, mode="same") / count for row in attitude]
    return lambda wanted: np.stack([np.interp(wanted, time, row) for row in smooth])


def _consistency(found: Consistency) -> dict[str, Any]:
    low, high = found.bounds
    return {
        "nis_over_expected": found.ratio,
        "lower": low,
        "upper": high,
        "count": found.count,
        "sound": found.consistent,
    }


def _kept(count: int) -> NDArray[np.int64]:
    """Return the indices kept of a series, the last one among them."""
    return np.unique(np.linspace(0, count - 1, min(count, _POINTS)).round().astype(np.int64))


def _history(
    result: SrinsCalibration,
    unit: Sequence[tuple[str, float]],
    attitude: Callable[[FloatArray], FloatArray] | None,
) -> dict[str, Any]:
    """Return estimates and sigmas against time; of the attitude also the true errors, if known."""
    kept = _kept(len(result.time))
    true = {}
    if attitude is not None:
        true = dict(zip(STATES[ATTITUDE], attitude(result.time[kept]) / _ARCSEC, strict=True))
    history: dict[str, Any] = {"time_h": result.time[kept] / units.HOUR}
    for name in _HISTORY:
        k = STATES.index(name)
        history[name] = {
            "estimate": result.estimates[kept, k] / unit[k][1],
            "sigma": result.sigma[kept, k] / unit[k][1],
            "unit": unit[k][0],
        }
        if name in true:
            history[name]["true"] = true[name]
    return history


def _thinned(error: Mapping[str, FloatArray]) -> dict[str, Any]:
    kept = _kept(len(next(iter(error.values()))))
    return {name: values[kept] for name, values in error.items()}


def ins_error(
    run: SrinsRun,
    differences: FloatArray,
    epochs: NDArray[np.int64],
    attitude: FloatArray | None = None,
) -> dict[str, FloatArray]:
    """Return INS - GNSS over the complete run: hours, m/s, m; means of minutes without gaps.

    attitude: true attitude errors (3, n + 1), rad, at the blocks' edges, where known: arcsec.
    """
    per = max(1, round(60.0 / run.block))
    minutes = len(epochs) // per

    def means(rows: FloatArray, count: FloatArray) -> FloatArray:
        sums = rows[:, : minutes * per].reshape(len(rows), minutes, per).sum(axis=2)
        return np.asarray(sums[:, kept] / count[kept])

    count = epochs[: minutes * per].reshape(minutes, per).sum(axis=1)
    kept = count > 0
    mean = means(differences, count)
    R_M, R_N = (float(r) for r in earth.radii(float(run.solution.latitude[0])))
    across = R_N * float(np.cos(run.solution.latitude[0]))
    middle = run.time[0] + run.block * per * (np.arange(minutes) + 0.5)
    columns = {
        "time_h": middle[kept] / units.HOUR,
        "v_east_mps": mean[0],
        "v_north_mps": mean[1],
        "north_m": mean[2] * R_M,
        "east_m": mean[3] * across,
    }
    if attitude is not None:
        phi = means(attitude[:, 1:], np.full(minutes, per)) / _ARCSEC
        columns |= dict(zip(("phi_E_arcsec", "phi_N_arcsec", "phi_U_arcsec"), phi, strict=True))
    return columns


def series(result: SrinsCalibration, started: float, latitude: float) -> dict[str, FloatArray]:
    """Return every state's estimate and sigma at each filter step, columns with their units."""
    columns: dict[str, FloatArray] = {"time [s]": started + result.time}
    for k, (name, (u, f)) in enumerate(zip(STATES, _units(latitude), strict=True)):
        columns[f"{name} [{u}]"] = result.estimates[:, k] / f
        columns[f"sigma_{name} [{u}]"] = result.sigma[:, k] / f
    return columns
