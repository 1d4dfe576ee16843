"""Simulators: MATLAB imuSensor, gnss-ins-sim, Gazebo.

MATLAB: gyroparams and accelparams (MathWorks documentation). gnss-ins-sim: imu_model.py and
pathgen.py, whose slow bias is `b <- (1 - 1/(f T)) b + (drift/f) w`, so the drift depends on the
rate. Gazebo: gz-sensors GaussianNoiseModel.cc, where `stddev` is per sample and
`dynamic_bias_stddev` is a density.
"""

import math

import numpy as np

from rotcli import units
from rotcli.export.numbers import Numbers, TriadNumbers
from rotcli.export.numbers import write_number as _n
from rotcli.export.polynomials import recentre
from rotcli.export.target import Body, Format
from rotcli.export.thermal import Thermal
from rotcli.models.noise_numbers import per_sample, walk_rate_per_step
from rotcli.units import FloatArray

MATLAB_CENTRE = 25.0  # degC, reference temperature of imuSensor
INFINITE_TIME = 1e12  # s, correlation time that turns gnss-ins-sim's bias into a random walk
GAZEBO_TIME = 1e6  # s, correlation time that turns Gazebo's bias into a random walk
PERCENT = 100.0


def per_axis(triad: TriadNumbers, values: FloatArray, rule: str) -> FloatArray:
    """Return values (3,) of a triad; an axis that was not measured gets the triad's one value."""
    if not np.isfinite(values).any():
        return np.zeros(3)
    return np.where(np.isfinite(values), values, triad.one(values, rule))


def known(values: FloatArray) -> FloatArray:
    """Return values with 0 where unknown."""
    return np.where(np.isfinite(values), values, 0.0)


def _row(values: FloatArray) -> str:
    return "[" + ", ".join(_n(v) for v in values) + "]"


def matlab(numbers: Numbers) -> Body:
    """Return a script that makes an imuSensor with the figures."""
    figures, (gyro, accel) = numbers.figures, numbers.noise()
    notes = ["BiasInstability is shaped by BiasInstabilityCoefficients: check its Allan deviation"]
    lines = [f"imu = imuSensor('accel-gyro', 'SampleRate', {_n(numbers.rate)});"]
    lines += _matlab_triad(
        "imu.Gyroscope = gyroparams( ...",
        numbers,
        gyro,
        (
            _matlab_constant(figures.gyro_bias, figures.thermal, "gyro"),
            figures.gyro_matrix,
            figures.gyro_range,
        ),
        _matlab_thermal(figures.thermal, notes),
    )
    accel_thermal = (
        [] if figures.thermal is None else _matlab_bias(figures.thermal, figures.thermal.accel)
    )
    lines += _matlab_triad(
        "imu.Accelerometer = accelparams( ...",
        numbers,
        accel,
        (
            _matlab_constant(figures.accel_bias, figures.thermal, "accel"),
            figures.accel_matrix,
            figures.accel_range,
        ),
        accel_thermal,
    )
    if np.isfinite(figures.gyro_matrix).any() and not np.isfinite(figures.gyro_matrix).all():
        notes.append("elements of the gyro matrix that were not measured are written as 0")
    return Body(lines, notes)


def _matlab_triad(
    start: str,
    numbers: Numbers,
    triad: TriadNumbers,
    constant: tuple[FloatArray, FloatArray, float | None],
    thermal: list[tuple[str, str]],
) -> list[str]:
    bias, matrix, full_scale = constant
    rule = numbers.settings.axes
    skew = PERCENT * (np.eye(3) + known(matrix))
    pairs = [
        ("ConstantBias", _row(known(bias))),
        ("AxesMisalignment", "[" + "; ".join(_row(row)[1:-1] for row in skew) + "]"),
        ("NoiseType", "'double-sided'"),
        ("NoiseDensity", _row(per_axis(triad, triad.white, rule))),
        ("BiasInstability", _row(per_axis(triad, triad.flicker, rule))),
        ("RandomWalk", _row(per_axis(triad, triad.walk, rule))),
        *thermal,
    ]
    if full_scale is not None:
        pairs.insert(0, ("MeasurementRange", _n(full_scale)))
    lines = [f"    '{name}', {value}, ..." for name, value in pairs]
    lines[-1] = lines[-1].removesuffix(", ...") + ");"
    return [start, *lines]


def _matlab_constant(bias: FloatArray, thermal: Thermal | None, kind: str) -> FloatArray:
    """Return the bias at MATLAB's reference temperature where a temperature model is known."""
    powers = None if thermal is None else (thermal.gyro if kind == "gyro" else thermal.accel)
    if thermal is None or powers is None:
        return bias
    at_centre = recentre(powers, thermal.reference, MATLAB_CENTRE)[:, 0]
    return np.where(np.isfinite(at_centre), at_centre, bias)


def _matlab_thermal(thermal: Thermal | None, notes: list[str]) -> list[tuple[str, str]]:
    if thermal is None:
        return []
    notes.append("TemperatureBias and TemperatureScaleFactor are the slopes at 25 degC only")
    pairs = _matlab_bias(thermal, thermal.gyro)
    if thermal.scale is not None:
        slope = PERCENT * recentre(thermal.scale, thermal.reference, MATLAB_CENTRE)[:, 1]
        pairs.append(("TemperatureScaleFactor", _row(known(slope))))
    return pairs


def _matlab_bias(thermal: Thermal, powers: FloatArray | None) -> list[tuple[str, str]]:
    if powers is None or powers.shape[1] < 2:
        return []
    slope = recentre(powers, thermal.reference, MATLAB_CENTRE)[:, 1]
    return [("TemperatureBias", _row(known(slope)))]


def gnss_ins_sim(numbers: Numbers) -> Body:
    """Return the imu_err dictionary of gnss-ins-sim for this sample rate."""
    figures, (gyro, accel) = numbers.figures, numbers.noise()
    rule, root_hour = numbers.settings.axes, units.DEG_PER_ROOT_HOUR
    gyro_drift, gyro_time = _drift(gyro, numbers)
    accel_drift, accel_time = _drift(accel, numbers)
    pairs = [
        ("gyro_b", known(figures.gyro_bias) / units.DEG_PER_HOUR, "deg/h"),
        ("gyro_arw", per_axis(gyro, gyro.white, rule) / root_hour, "deg/sqrt(h)"),
        ("gyro_b_stability", gyro_drift / units.DEG_PER_HOUR, "deg/h"),
        ("gyro_b_corr", gyro_time, "s"),
        ("accel_b", known(figures.accel_bias), "m/s^2"),
        (
            "accel_vrw",
            per_axis(accel, accel.white, rule) / units.METRE_PER_SECOND_PER_ROOT_HOUR,
            "m/s/sqrt(h)",
        ),
        ("accel_b_stability", accel_drift, "m/s^2"),
        ("accel_b_corr", accel_time, "s"),
    ]
    lines = ["import numpy as np", "", "imu_err = {"]
    lines += [f"    '{name}': np.array({_row(v)}),  # {unit}" for name, v, unit in pairs]
    notes = [
        f"b_stability belongs to {numbers.rate:.10g} Hz: another rate needs another export",
        "b_corr must not be removed: without it the drift becomes white noise",
    ]
    return Body([*lines, "}"], notes)


def _drift(triad: TriadNumbers, numbers: Numbers) -> tuple[FloatArray, FloatArray]:
    """Return drift (3,), K sqrt(f) or sigma sqrt(2 f/T), and correlation time (3,), s."""
    f = numbers.rate
    drift = walk_rate_per_step(per_axis(triad, triad.walk, numbers.settings.axes), f)
    time = np.full(3, INFINITE_TIME)
    for k, process in enumerate(triad.slow):
        if process is not None:
            sigma, time[k] = process
            drift[k] = sigma * math.sqrt(2.0 * f / time[k])
    return drift, time


def gazebo(numbers: Numbers) -> Body:
    """Return the imu element of an SDF sensor."""
    figures, (gyro, accel) = numbers.figures, numbers.noise()
    lines = [
        '<sensor name="imu" type="imu">',
        f"  <update_rate>{_n(numbers.rate)}</update_rate>",
        "  <imu>",
    ]
    for name, triad, bias in (
        ("angular_velocity", gyro, figures.gyro_bias),
        ("linear_acceleration", accel, figures.accel_bias),
    ):
        lines.append(f"    <{name}>")
        lines += _gazebo_triad(numbers, triad, known(bias))
        lines.append(f"    </{name}>")
    notes = ["Gazebo draws the sign of bias_mean at random"]
    return Body([*lines, "  </imu>", "</sensor>"], notes)


def _gazebo_triad(numbers: Numbers, triad: TriadNumbers, bias: FloatArray) -> list[str]:
    rule = numbers.settings.axes
    white = per_sample(per_axis(triad, triad.white, rule), numbers.rate)
    density, time = per_axis(triad, triad.walk, rule), np.full(3, GAZEBO_TIME)
    for k, process in enumerate(triad.slow):
        if process is not None:
            sigma, time[k] = process
            density[k] = sigma * math.sqrt(2.0 / time[k])
    lines = []
    for k, axis in enumerate("xyz"):
        lines += [f"      <{axis}>", '        <noise type="gaussian">']
        for tag, value in (
            ("mean", 0.0),
            ("stddev", white[k]),
            ("bias_mean", bias[k]),
            ("bias_stddev", 0.0),
            ("dynamic_bias_stddev", density[k]),
            ("dynamic_bias_correlation_time", time[k]),
        ):
            lines.append(f"          <{tag}>{_n(float(value))}</{tag}>")
        lines += ["        </noise>", f"      </{axis}>"]
    return lines


_NOISE = frozenset({"white", "walk", "axes", "gyro_bias", "accel_bias"})
_MATRICES = frozenset({"gyro_scale", "gyro_installation", "accel_scale", "accel_installation"})
FORMATS = (
    Format(
        "matlab",
        "MATLAB imuSensor (gyroparams, accelparams)",
        "imu_sensor.m",
        _NOISE | _MATRICES | {"flicker"},
        matlab,
        comment=("% ", ""),
    ),
    Format("gnss-ins-sim", "gnss-ins-sim imu_err", "imu_err.py", _NOISE | {"markov"}, gnss_ins_sim),
    Format(
        "gazebo",
        "Gazebo SDF imu sensor",
        "imu.sdf",
        _NOISE | {"markov"},
        gazebo,
        comment=("<!-- ", " -->"),
    ),
)
