"""The zero-velocity filter on a turntable log: preparing the log, running, judging the estimates.

The filter itself is `rotcli.models.zero_velocity`. A calibration is applied to the readings
first: an uncalibrated gyro scale factor of 1e-3 at 10 deg/s shows as 36 deg/h of bias along the
axis, an installation error of 0.1 deg as 63 deg/h across it. Without a calibration the filter
carries both along as states.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError, RigError, RotcliError
from rotcli.logs import checks, segments
from rotcli.logs.motion import check_motion
from rotcli.logs.record import ImuLog, TableLog, own_clock
from rotcli.logs.rig import Rig
from rotcli.models import kalman
from rotcli.models.earth import normal_gravity
from rotcli.models.rotation import attitude_matrix, turn_about
from rotcli.models.sensors import TriadErrors, correct
from rotcli.models.zero_velocity import Initial, Noise, Settings, plan
from rotcli.models.zero_velocity_run import Estimates, as_it_stands, clear_tilt, run
from rotcli.units import DEG, DEG_PER_HOUR, PPM, show_span

Array = NDArray[np.float64]

WANDER_TIME = 120.0  # s, correlation time where no Gauss-Markov figures are known
# Sigma of the wander that stands for flicker noise of coefficient B, in B. Simulated flicker noise
# strays from its turn-on value by 2 to 3 B within ten minutes; with these factors the turn-on
# bias, too, stays within four sigma of the estimate at the end. (The gyros' rate random walk
# carries the rest.)
WANDER_OF_FLICKER = {"gyro": 3.0, "accel": 6.0}
TURNING = 0.05 * DEG  # rad/s: below it the table is still
UNLIKELY = 5.0  # initial sigmas
ONE_RATE = 0.1  # rates closer than this fraction are one rate
# Sigma of gyro scale factor and installation where neither a calibration nor the rig says
# anything: uncalibrated MEMS gyros are named to within 0.1 to 0.5 %.
UNCALIBRATED = 3000.0 * PPM
INCONSISTENT = 2.0  # times the upper bound of mean NIS: sigmas 1.4 times too small, and more


@dataclass(frozen=True)
class Options:
    """What the user may choose: SI. update_rate: Hz; window: s; the rest as in Settings.

    scale: stands for that of `initial`: sigma of what no calibration removes of the gyros' scale
    factor and installation; 0 leaves those states out, None is the rig's figure, else UNCALIBRATED
    (and 0 for a calibrated log).
    """

    noise: Noise | None = None
    initial: Initial = field(default_factory=Initial)
    scale: float | None = None
    update_rate: float = 10.0
    velocity_sigma: float = 2e-3
    estimate_lever_arm: bool = False
    slave_azimuth: bool = True
    smooth: bool = False
    window: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Filtered:
    """One log filtered.

    settings: what the filter was told. estimates: its history, one run, times on the log's clock;
    biases are those of the sensors, calibration included. rate: rad/s, the table's main one, 0
    when still; angle: rad, at the start. nis: mean and its 95 % bounds. start, end: s.
    calibrated: whether gyro scale factor and installation were removed first.
    """

    settings: Settings
    estimates: Estimates
    rate: float
    angle: float
    start: float
    end: float
    nis: float
    nis_bounds: tuple[float, float]
    calibrated: bool
    warnings: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """What the innovations say of the sigmas.

        consistent, cautious, optimistic, or inconsistent: so far above that nothing is to be used.
        """
        low, high = self.nis_bounds
        if self.nis > INCONSISTENT * high:
            return "inconsistent"
        return "cautious" if self.nis < low else "optimistic" if self.nis > high else "consistent"


def noise_of(rig: Rig, measured: Noise | None = None) -> tuple[Noise, tuple[str, ...]]:
    """Return the noise figures of a rig, with warnings about those that were assumed.

    measured: figures that come first, such as an Allan result's.
    Bias wander: the Gauss-Markov figures; else, of a noise analysis, rate random walk and flicker
    coefficient together; else the bias instability alone, as a datasheet names it, which is then
    the wander's sigma.
    """
    if measured is not None:
        return measured, ()
    imu, base, assumed = rig.imu, Noise(), []

    def rms(name: str) -> float | None:
        figure = imu.figure(name)
        return None if figure is None else float(np.sqrt(np.mean(figure**2)))

    def or_assume(name: str, default: float, text: str) -> float:
        value = rms(name)
        if not value:
            assumed.append(f"{name} {text}")
        return value or default

    arw = or_assume("angle_random_walk", base.angle_random_walk, "3 deg/sqrt(h)")
    vrw = or_assume("velocity_random_walk", base.velocity_random_walk, "0.12 m/s/sqrt(h)")

    def wander(sensor: str, instability: str, walk: str | None, default: float) -> float:
        sigma, time = rms(f"gauss_markov_{sensor}_sigma"), rms(f"gauss_markov_{sensor}_time")
        if sigma and time:
            return sigma * float(np.sqrt(WANDER_TIME / time))  # the same 2 sigma^2 / time
        B, K = rms(instability) or 0.0, (rms(walk) or 0.0) if walk else 0.0
        if K or (B and not walk):
            return float(np.hypot(WANDER_OF_FLICKER[sensor] * B, K * np.sqrt(0.5 * WANDER_TIME)))
        if B:
            return B
        text = f"{default / DEG_PER_HOUR:g} deg/h" if sensor == "gyro" else f"{default:g} m/s^2"
        assumed.append(f"{instability} {text}")
        return default

    noise = Noise(
        angle_random_walk=arw,
        velocity_random_walk=vrw,
        gyro_wander=wander("gyro", "bias_instability", "rate_random_walk", base.gyro_wander),
        gyro_time=WANDER_TIME,
        accel_wander=wander("accel", "accel_bias_instability", None, base.accel_wander),
        accel_time=WANDER_TIME,
    )
    if not assumed:
        return noise, ()
    what = f"noise figures assumed, as [imu] of the rig names none: {', '.join(assumed)}"
    return noise, (what,)


def filter_log(
    imu: ImuLog,
    table: TableLog | None,
    rig: Rig,
    options: Options,
    gyro_errors: TriadErrors | None = None,
    accel_errors: TriadErrors | None = None,
) -> Filtered:
    """Run the zero-velocity filter over a log; without a table log the IMU is taken as still.

    gyro_errors, accel_errors: a calibration, removed from the readings first.
    Raises RigError without a site, LogError when the window holds too little, RotcliError for
    options that do not go together.
    """
    if rig.site is None:
        raise RigError(
            f"{rig.path or 'rig'}: site: latitude is missing; give it in [site] or as --latitude"
        )
    if options.smooth and not options.slave_azimuth:
        raise RotcliError("--smooth: needs the slaved azimuth; leave out --free-azimuth")
    warnings = [*imu.warnings, *(table.warnings if table else ())]
    start, end = _window(imu, table, options.window)
    named = options.window or (float(imu.time[0]), float(imu.time[-1]))
    warnings += checks.check_covered(imu.path, named, (start, end))
    imu = imu.crop(start, end)
    theta = np.zeros(len(imu.time)) if table is None else segments.angle_at(table, imu.time)
    warnings += check_motion(imu, table, rig)
    noise, assumed = noise_of(rig, options.noise)
    step = max(1, round(1.0 / (options.update_rate * imu.interval)))
    if len(imu.time) < 2 * step + 1:
        raise LogError(
            imu.path,
            f"the window {show_span(start, end)} holds {len(imu.time)} samples, fewer than two "
            f"updates of {step}; name a longer --window or a higher --update-rate",
        )
    pitch, roll, azimuth = (
        angle or 0.0 for angle in (rig.attitude.pitch, rig.attitude.roll, rig.attitude.azimuth)
    )
    unnamed = [name for name in ("pitch", "roll", "azimuth") if getattr(rig.attitude, name) is None]
    if unnamed:
        warnings.append(
            f"the rig names no {', '.join(unnamed)} under [attitude]: taken as 0 deg; add it"
        )
    r = rig.lever_arm_s
    normal = float(normal_gravity(rig.site.latitude, rig.site.height))
    settings = Settings(
        latitude=rig.site.latitude,
        gravity=normal if rig.site.gravity is None else rig.site.gravity,
        C_nb=attitude_matrix(pitch, roll, azimuth),
        axis=rig.table.axis,
        samples=step,
        velocity_sigma=options.velocity_sigma,
        noise=noise,
        initial=_initial(options, rig, gyro_errors, turning=bool(np.ptp(theta))),
        lever_arm=(float(r[0]), float(r[1]), float(r[2])),
        estimate_lever_arm=options.estimate_lever_arm,
        slave_azimuth=options.slave_azimuth,
        smooth=options.smooth,
        averages=imu.sampling == "average",
    )
    f_b = turn_about(settings.axis, theta, imu.accel).mean(axis=0)
    expected = settings.gravity * settings.C_nb[2]
    strict = not {"pitch", "roll"} & set(unnamed)
    warnings += checks.check_gravity(imu, f_b, expected, strict=strict, level=False)
    rates = np.diff(theta[::step]) / (step * imu.interval)
    warnings += [
        *assumed,
        *_rate_warnings(rates, options, settings.initial.scale, rig, gyro_errors),
    ]
    gyro = imu.gyro if gyro_errors is None else correct(gyro_errors, imu.gyro)
    accel = imu.accel if accel_errors is None else correct(accel_errors, imu.accel)
    estimates = run(plan(theta, imu.interval, settings), gyro, accel)
    off = clear_tilt(estimates)
    if off is not None:
        warnings.append(
            f"the table stands {np.hypot(*off) / DEG:.2g} deg off the attitude given, and was "
            "filtered as it stands: correct [attitude]"
        )
        settings, estimates = as_it_stands(settings, off, theta, imu.interval, gyro, accel)
    warnings += _far_from_prior(estimates, settings)
    estimates = _whole_biases(estimates, settings, imu.time[0], gyro_errors, accel_errors)
    count = estimates.nis.shape[1]
    done = Filtered(
        settings=settings,
        estimates=estimates,
        rate=_main_rate(rates),
        angle=float(theta[0]),
        start=float(imu.time[0]),
        end=float(imu.time[-1]),
        nis=float(estimates.nis.mean()),
        nis_bounds=kalman.mean_bounds(3, count),
        calibrated=gyro_errors is not None and bool(np.any(gyro_errors.matrix)),
        warnings=tuple(warnings),
    )
    if done.verdict in ("optimistic", "inconsistent"):
        what = (
            f"the innovations are larger than the sigmas say (mean NIS {done.nis:.2f}, up to "
            f"{done.nis_bounds[1]:.2f} expected): look for a moving table, uncalibrated sensors, "
            "a wrong lever arm or time offset, or too small noise figures"
            + ("; no estimate is to be used" if done.verdict == "inconsistent" else "")
        )
        done = replace(done, warnings=(*done.warnings, what))
    return done


def _window(
    imu: ImuLog, table: TableLog | None, named: tuple[float, float] | None
) -> tuple[float, float]:
    """Return the window named, else all that both logs cover."""
    start, end = float(imu.time[0]), float(imu.time[-1])
    if table is not None:
        start, end = max(start, float(table.time[0])), min(end, float(table.time[-1]))
    if end <= start:
        raise LogError(imu.path, "shares no time with the table log; check [table] time_offset")
    if named is None:
        return start, end
    if named[0] < start - imu.interval or named[1] > end + imu.interval:
        raise LogError(
            imu.path,
            f"the window {show_span(*named)} lies outside what the logs cover, "
            f"{show_span(start, end)}{own_clock(named, (start, end))}; name another --window",
        )
    return named


def _initial(
    options: Options, rig: Rig, gyro_errors: TriadErrors | None, *, turning: bool
) -> Initial:
    """Return the initial sigmas; what no calibration removes of scale and installation is held.

    That is the given sigma, else the rig's `scale_sigma`, else UNCALIBRATED; a calibrated column is
    left out, and so is what a still table does not excite.
    """
    scale, figure = options.scale, rig.imu.figure("scale_sigma")
    if scale is None and not (gyro_errors is not None and np.any(gyro_errors.matrix)):
        scale = UNCALIBRATED if figure is None else float(np.sqrt(np.mean(figure**2)))
    return replace(options.initial, scale=(scale or 0.0) if turning else 0.0)


def _main_rate(rates: Array) -> float:
    """Return the median rate while turning, 0 for a table that turns in less than a tenth."""
    turning = np.abs(rates) > TURNING
    return float(np.median(rates[turning])) if turning.mean() > 0.1 else 0.0


def one_rate(rates: Array) -> bool:
    """Tell whether the table has one rate throughout, but for a twentieth of the time."""
    low, high = np.quantile(np.abs(rates), [0.05, 0.95])
    return bool(high - low <= max(ONE_RATE * high, TURNING))


def _rate_warnings(
    rates: Array, options: Options, scale: float, rig: Rig, gyro_errors: TriadErrors | None
) -> list[str]:
    found = []
    if options.estimate_lever_arm and one_rate(rates):
        found.append(
            f"the table keeps one rate ({_main_rate(rates) / DEG:.4g} deg/s): the lever arm "
            "cannot be told from the accelerometer biases across the axis (their estimates hold "
            "a share of it); log a second rate"
        )
    rate = _main_rate(rates)
    if scale and options.scale is None and rig.imu.scale_sigma is None:
        found.append(
            "no calibration of the gyros' scale factor and installation was given, and no "
            f"scale_sigma in the rig: {scale / PPM:g} ppm of either assumed and carried along, "
            "which widens the gyro biases; see rotcli calibrate, or --sigma-scale"
        )
    if rate and not scale and (gyro_errors is None or not np.any(gyro_errors.matrix)):
        found.append(
            "no calibration of the gyros' scale factor and installation was given: 1e-3 of either "
            f"would show as {abs(rate) * 1e-3 / DEG_PER_HOUR:.3g} deg/h in the gyro biases; see "
            "rotcli calibrate, or --sigma-scale"
        )
    return found


def _far_from_prior(estimates: Estimates, settings: Settings) -> list[str]:
    """Warn of biases that the initial sigma made all but impossible."""
    distance = np.abs(estimates.values[0, -1]) / settings.initial_sigma
    return [
        f"the {sensor} biases end {distance[k : k + 3].max():.2g} initial sigmas from where they "
        f"started: raise --sigma-{sensor} to at least a third of the greatest"
        for sensor, k in (("accel", 6), ("gyro", 9))
        if distance[k : k + 3].max() > UNLIKELY
    ]


def _whole_biases(
    estimates: Estimates,
    settings: Settings,
    start: float,
    gyro_errors: TriadErrors | None,
    accel_errors: TriadErrors | None,
) -> Estimates:
    """Add what the calibration removed to the estimates; put times on the log's clock."""
    values = estimates.values.copy()
    for errors, at in ((accel_errors, slice(6, 9)), (gyro_errors, slice(9, 12))):
        if errors is not None:
            values[..., at] = values[..., at] @ (np.eye(3) + errors.matrix).T + errors.bias
    at = settings.column_states
    if gyro_errors is not None and settings.initial.scale:
        values[..., at] = values[..., at] @ (np.eye(3) + gyro_errors.matrix).T
        values[..., at] += gyro_errors.matrix @ settings.axis
    return replace(estimates, values=values, time=estimates.time + start)
