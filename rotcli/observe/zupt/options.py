"""What the filter is told: the user's options, noise figures and initial sigmas."""

from dataclasses import dataclass, field, replace

import numpy as np

from rotcli.models.sensors import TriadErrors
from rotcli.observe.zupt.model import InitialSigma, Noise
from rotcli.rig.rig import Rig
from rotcli.units import DEG_PER_HOUR, PPM

DEFAULT_CORRELATION_TIME = 120.0  # s, correlation time where no Gauss-Markov figures are known
# Sigma of the wander that stands for flicker noise of coefficient B, in B. Simulated flicker noise
# strays from its turn-on value by 2 to 3 B within ten minutes; with these factors the turn-on
# bias, too, stays within four sigma of the estimate at the end. (The gyros' rate random walk
# carries the rest.)
MARKOV_SIGMA_PER_FLICKER = {"gyro": 3.0, "accel": 6.0}
# Sigma of gyro scale factor and installation where neither a calibration nor the rig says
# anything: uncalibrated MEMS gyros are named to within 0.1 to 0.5 %.
DEFAULT_SCALE_SIGMA = 3000.0 * PPM


@dataclass(frozen=True)
class Options:
    """What the user may choose: SI. update_rate: Hz; window: s; the rest as in Settings.

    scale: in place of that of `initial`, sigma of the uncalibrated gyro scale factor and
    installation errors; 0 omits those states, None is the figure of the rig, else
    DEFAULT_SCALE_SIGMA (and 0 for a calibrated log).
    """

    initial: InitialSigma = field(default_factory=InitialSigma)
    scale: float | None = None
    update_rate: float = 10.0
    velocity_sigma: float = 2e-3
    estimate_lever_arm: bool = False
    slave_azimuth: bool = True
    smooth: bool = False
    window: tuple[float, float] | None = None


def noise_from_rig(rig: Rig) -> tuple[Noise, tuple[str, ...]]:
    """Return the noise figures of a rig, with warnings about those that were assumed.

    Bias wander: the Gauss-Markov figures; else, of a noise analysis, rate random walk and flicker
    coefficient together; else the bias instability alone, as a datasheet names it, which is then
    the wander's sigma.
    """
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
            return sigma * float(
                np.sqrt(DEFAULT_CORRELATION_TIME / time)
            )  # the same 2 sigma^2 / time
        B, K = rms(instability) or 0.0, (rms(walk) or 0.0) if walk else 0.0
        if K or (B and not walk):
            return float(
                np.hypot(
                    MARKOV_SIGMA_PER_FLICKER[sensor] * B,
                    K * np.sqrt(0.5 * DEFAULT_CORRELATION_TIME),
                )
            )
        if B:
            return B
        text = f"{default / DEG_PER_HOUR:g} deg/h" if sensor == "gyro" else f"{default:g} m/s^2"
        assumed.append(f"{instability} {text}")
        return default

    noise = Noise(
        angle_random_walk=arw,
        velocity_random_walk=vrw,
        gyro_markov_sigma=wander(
            "gyro", "bias_instability", "rate_random_walk", base.gyro_markov_sigma
        ),
        gyro_correlation_time=DEFAULT_CORRELATION_TIME,
        accel_markov_sigma=wander("accel", "accel_bias_instability", None, base.accel_markov_sigma),
        accel_correlation_time=DEFAULT_CORRELATION_TIME,
    )
    if not assumed:
        return noise, ()
    what = f"noise figures assumed, as [imu] of the rig names none: {', '.join(assumed)}"
    return noise, (what,)


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
