"""Settings of the filter: options, noise figures and initial sigmas."""

from dataclasses import field, replace

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.sensors import TriadErrors
from rotcli.observe.zupt.model import InitialSigma, Noise
from rotcli.rig.rig import Rig
from rotcli.units import DEG_PER_HOUR, PPM

DEFAULT_CORRELATION_TIME = 120.0  # s, where no Gauss-Markov figures are known
# Sigma of a Gauss-Markov process in place of flicker noise of coefficient B, in B. Simulated
# flicker noise deviates from its turn-on value by 2 to 3 B within ten minutes; with these factors
# the turn-on bias, too, is within four sigma of the estimate at the end. (Rate random walk adds its
# part for the gyros.)
MARKOV_SIGMA_PER_FLICKER = {"gyro": 3.0, "accel": 6.0}
# Sigma of gyro scale factor and installation errors where neither a calibration nor the rig gives
# one: data sheets of uncalibrated MEMS gyros state 0.1 to 0.5 %.
DEFAULT_SCALE_SIGMA = 3000.0 * PPM


@dataclass(frozen=True)
class Options:
    """Options of the filter, SI. update_rate: Hz; window: s; the others as in Settings.

    velocity_sigma: None to estimate it from the log.
    scale: in place of that of `initial`, sigma of the uncalibrated gyro scale factor and
    installation errors; 0 omits those states, None is the figure of the rig, else
    DEFAULT_SCALE_SIGMA (and 0 for a calibrated log).
    """

    initial: InitialSigma = field(default_factory=InitialSigma)
    scale: float | None = None
    update_rate: float = 10.0
    velocity_sigma: float | None = None
    estimate_lever_arm: bool = False
    slave_azimuth: bool = True
    smooth: bool = False
    window: tuple[float, float] | None = None


def noise_from_rig(rig: Rig) -> tuple[Noise, tuple[str, ...]]:
    """Return the noise figures of a rig, with warnings about those that are assumed.

    In-run bias: the Gauss-Markov figures; else rate random walk and the flicker coefficient of a
    noise analysis together; else the bias instability of a data sheet alone, as the sigma.
    """
    default, assumed = Noise(), list[str]()
    arw, vrw = _rms(rig, "angle_random_walk"), _rms(rig, "velocity_random_walk")
    if not arw:
        assumed.append("angle_random_walk 3 deg/sqrt(h)")
    if not vrw:
        assumed.append("velocity_random_walk 0.12 m/s/sqrt(h)")
    gyro = _markov_sigma(rig, "gyro", "bias_instability", "rate_random_walk")
    if gyro is None:
        figure = default.gyro_markov_sigma / DEG_PER_HOUR
        assumed.append(f"bias_instability {figure:g} deg/h")
    accel = _markov_sigma(rig, "accel", "accel_bias_instability", None)
    if accel is None:
        assumed.append(f"accel_bias_instability {default.accel_markov_sigma:g} m/s^2")
    noise = Noise(
        angle_random_walk=arw or default.angle_random_walk,
        velocity_random_walk=vrw or default.velocity_random_walk,
        gyro_markov_sigma=default.gyro_markov_sigma if gyro is None else gyro,
        gyro_correlation_time=DEFAULT_CORRELATION_TIME,
        accel_markov_sigma=default.accel_markov_sigma if accel is None else accel,
        accel_correlation_time=DEFAULT_CORRELATION_TIME,
    )
    if not assumed:
        return noise, ()
    where = rig.path or "rig"
    return noise, (f"{where}: [imu] noise figures are missing; assumed: {', '.join(assumed)}",)


def _rms(rig: Rig, name: str) -> float | None:
    """Return a figure of the rig, the RMS of the three axes; None where it is missing."""
    figure = rig.imu.figure(name)
    return None if figure is None else float(np.sqrt(np.mean(figure**2)))


def _markov_sigma(rig: Rig, sensor: str, instability: str, walk: str | None) -> float | None:
    """Return the sigma of the in-run bias for DEFAULT_CORRELATION_TIME; None where unknown."""
    sigma, time = (
        _rms(rig, f"gauss_markov_{sensor}_sigma"),
        _rms(rig, f"gauss_markov_{sensor}_time"),
    )
    if sigma and time:  # the same noise density 2 sigma^2 / time
        return sigma * float(np.sqrt(DEFAULT_CORRELATION_TIME / time))
    B, K = _rms(rig, instability) or 0.0, (_rms(rig, walk) or 0.0) if walk else 0.0
    if K or (B and not walk):
        walked = K * np.sqrt(0.5 * DEFAULT_CORRELATION_TIME)
        return float(np.hypot(MARKOV_SIGMA_PER_FLICKER[sensor] * B, walked))
    return B or None


def initial_sigmas(
    options: Options, rig: Rig, gyro_errors: TriadErrors | None, *, turning: bool
) -> InitialSigma:
    """Return the initial sigmas, with that of uncalibrated scale and installation errors.

    It is that of the options, else the rig's `scale_sigma`, else DEFAULT_SCALE_SIGMA. The axis
    column is omitted if it is calibrated or the table is still.
    """
    scale, figure = options.scale, rig.imu.figure("scale_sigma")
    if scale is None and not (gyro_errors is not None and np.any(gyro_errors.matrix)):
        scale = DEFAULT_SCALE_SIGMA if figure is None else float(np.sqrt(np.mean(figure**2)))
    return replace(options.initial, scale=(scale or 0.0) if turning else 0.0)
