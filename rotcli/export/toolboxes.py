"""Toolboxes: NaveGo's imu structure and PSINS' imuerrset.

NaveGo: imu_si_errors.m, gyro_gen.m. PSINS: imuerrset.m, imuadderr.m; its matrices are in the
accelerometer convention (dKa lower triangular), installation errors in arcsec.
"""

import math

import numpy as np

from rotcli import units
from rotcli.export.intrinsics import intrinsics
from rotcli.export.numbers import Numbers, TriadNumbers
from rotcli.export.numbers import write_number as _n
from rotcli.export.simulators import known, per_axis
from rotcli.export.target import Body, Format
from rotcli.units import FloatArray

_UG = units.UNITS["acceleration"]["ug"]
_MG = units.UNITS["acceleration"]["mg"]
_ROOT_HOUR = math.sqrt(units.HOUR)  # sqrt(s) per sqrt(h)
_ARCSEC = units.DEG / 3600.0
# (row, column) of PSINS' dKGij, in its order yx, zx, zy, xy, xz, yz; dKAij has the first three.
_PSINS_ORDER = ((1, 0), (2, 0), (2, 1), (0, 1), (0, 2), (1, 2))


def _row(values: FloatArray) -> str:
    return "[" + " ".join(_n(v) for v in values) + "]"


def _column(values: FloatArray) -> str:
    return "[" + "; ".join(_n(v) for v in values) + "]"


def navego(numbers: Numbers) -> Body:
    """Return NaveGo's imu structure (before imu_si_errors)."""
    figures, (gyro, accel) = numbers.figures, numbers.noise()
    rule = numbers.settings.axes
    gyro_sigma, gyro_time = _markov(gyro)
    accel_sigma, accel_time = _markov(accel)
    per_root_hour_s = _ROOT_HOUR / units.DEG  # rad/s/sqrt(s) to deg/sqrt(h)/s
    pairs = [
        ("arw", per_axis(gyro, gyro.white, rule) / units.DEG_PER_ROOT_HOUR, "deg/sqrt(h), N"),
        ("arrw", _walk(gyro, rule) * per_root_hour_s, "deg/sqrt(h)/s, K"),
        ("vrw", per_axis(accel, accel.white, rule) * _ROOT_HOUR, "m/s/sqrt(h), N"),
        ("vrrw", _walk(accel, rule) * _ROOT_HOUR, "m/s/sqrt(h)/s, K"),
        ("gb_sta", known(figures.gyro_bias) / units.DEG, "deg/s"),
        ("ab_sta", known(figures.accel_bias) / _MG, "mg"),
        ("gb_dyn", gyro_sigma / units.DEG, "deg/s, Gauss-Markov sigma"),
        ("ab_dyn", accel_sigma / _MG, "mg, Gauss-Markov sigma"),
        ("gb_corr", gyro_time, "s"),
        ("ab_corr", accel_time, "s"),
    ]
    lines = [f"imu.{name} = {_row(values)};  % {unit}" for name, values, unit in pairs]
    notes = []
    if any(process is not None for process in (*gyro.slow, *accel.slow)):
        notes = [
            "NaveGo's gb_psd = gb_dyn/sqrt(gb_corr) lacks sqrt(2): a Gauss-Markov process has the "
            "root density sigma sqrt(2/T). sigma is not changed here",
            "K is 0 on an axis with a Gauss-Markov process, or the slow noise would count twice",
        ]
    return Body([*lines, f"imu.freq = {_n(numbers.rate)};  % Hz"], notes)


def _walk(triad: TriadNumbers, rule: str) -> FloatArray:
    """Return K (3,), 0 where a Gauss-Markov process describes the slow noise."""
    walk = per_axis(triad, triad.walk, rule)
    return np.where([process is None for process in triad.slow], walk, 0.0)


def _markov(triad: TriadNumbers) -> tuple[FloatArray, FloatArray]:
    """Return sigma (3,) and time (3,), s, of the Gauss-Markov processes; sigma 0 where none."""
    sigma, time = np.zeros(3), np.full(3, 100.0)  # any time does for sigma 0
    for k, process in enumerate(triad.slow):
        if process is not None:
            sigma[k], time[k] = process
    return sigma, time


def psins(numbers: Numbers) -> Body:
    """Return a call of PSINS' imuerrset."""
    figures, (gyro, accel) = numbers.figures, numbers.noise()
    rule = numbers.settings.axes
    gyro_slow, gyro_time = _psins_slow(gyro, rule, units.DEG_PER_HOUR)
    accel_slow, accel_time = _psins_slow(accel, rule, _UG)
    matrices = intrinsics(figures)
    if matrices is None:
        n, m = known(figures.gyro_matrix), np.zeros((3, 3))
    else:
        n, m = matrices.gyro - np.eye(3), matrices.accel - np.eye(3)
    order = np.array(_PSINS_ORDER).T
    pairs = [
        ("eb", known(figures.gyro_bias) / units.DEG_PER_HOUR, "deg/h"),
        ("db", known(figures.accel_bias) / _UG, "ug"),
        ("web", per_axis(gyro, gyro.white, rule) / units.DEG_PER_ROOT_HOUR, "deg/sqrt(h), N"),
        ("wdb", per_axis(accel, accel.white, rule) / _UG, "ug/sqrt(Hz), N"),
        ("sqrtR0G", gyro_slow, "deg/h/sqrt(h), K" if np.isinf(gyro_time) else "deg/h, sigma"),
        ("TauG", np.array([gyro_time]), "s"),
        ("sqrtR0A", accel_slow, "ug/sqrt(h), K" if np.isinf(accel_time) else "ug, sigma"),
        ("TauA", np.array([accel_time]), "s"),
        ("dKGii", np.diag(n) / units.PPM, "ppm"),
        ("dKAii", np.diag(m) / units.PPM, "ppm"),
        ("dKGij", n[tuple(order)] / _ARCSEC, "arcsec: yx zx zy xy xz yz"),
        ("dKAij", m[tuple(order[:, :3])] / _ARCSEC, "arcsec: yx zx zy"),
        ("KA2", known(figures.second_order) * units.STANDARD_GRAVITY**2 / _UG, "ug/g^2"),
    ]
    lines = [f"{name} = {_value(values)};  % {unit}" for name, values, unit in pairs]
    names = ", ".join(name for name, _, _ in pairs)
    lines.append(f"imuerr = imuerrset({names});")
    notes = [] if matrices is None else ["dKG and dKA are in the accelerometer convention"]
    if matrices is None and np.isfinite(figures.gyro_matrix).any():
        notes.append("elements of the gyro matrix that were not measured are written as 0")
    return Body(lines, notes)


def _psins_slow(triad: TriadNumbers, rule: str, size: float) -> tuple[FloatArray, float]:
    """Return sqrtR0 (3,) and its time, s: K per sqrt(h) and inf, or sigma if all axes have one."""
    if all(process is not None for process in triad.slow):
        sigma, time = _markov(triad)
        return sigma / size, float(np.mean(time))
    return per_axis(triad, triad.walk, rule) * _ROOT_HOUR / size, math.inf


def _value(values: FloatArray) -> str:
    if len(values) == 1:
        return "inf" if np.isinf(values[0]) else _n(float(values[0]))
    return _column(values)


_SHARED = frozenset({"white", "walk", "markov", "axes", "gyro_bias", "accel_bias"})
FORMATS = (
    Format("navego", "NaveGo imu structure", "navego_imu.m", _SHARED, navego, comment=("% ", "")),
    Format(
        "psins",
        "PSINS imuerrset",
        "psins_imuerr.m",
        _SHARED
        | {"gyro_scale", "gyro_installation", "accel_scale", "accel_installation", "second_order"},
        psins,
        comment=("% ", ""),
    ),
)
