"""Noise drawn by each consumer's recursion from the exported numbers has the Allan deviation.

allantools is the judge. White noise must show N at 1 s, the slow part K at 3 s (both by the
definitions of IEEE Std 952). 4e5 samples at 100 Hz contain 4000 clusters of 1 s and 1333 of 3 s:
one sigma of the overlapping deviation is about 1 % and 2 %; tolerances are four sigma.
"""

import math
import re
import xml.etree.ElementTree as ET

import allantools
import numpy as np
import pytest
from scipy.signal import lfilter

from rotcli.export.figures import collect
from rotcli.export.formats import render
from rotcli.export.numbers import Settings
from tests.export import documents

F = 100.0
DT = 1.0 / F
SAMPLES = 400_000
N = 0.4 * math.pi / 180 / 60  # rad/s/sqrt(Hz)
K = 0.35 * math.pi / 180 / 3600  # rad/s^2/sqrt(Hz)
SIGMA, TIME = 8.0, 120.0  # deg/h, s: a Gauss-Markov process


def exported(name: str, *, markov: bool = False) -> str:
    source, doc = documents.allan()
    if markov:
        source, doc = documents.allan(gyro_walk=None, gyro_limit=0.5)
        for axis in documents.AXES[:3]:
            doc["axes"][axis]["gauss_markov"] = {
                "sigma": documents.quantity(SIGMA, 1.0, "deg/h"),
                "correlation_time_s": TIME,
            }
    return render(name, collect([(source, doc)]), Settings()).text


def number(text: str, pattern: str) -> float:
    return float(re.search(pattern + r"[=:]?\s*\[?(?:np\.array\(\[)?([-+.\de]+)", text)[1])


def deviation(rate: np.ndarray, tau: float) -> float:
    _, value, _, _ = allantools.oadev(rate, rate=F, data_type="freq", taus=[tau])
    return float(value[0])


def draws(seed: int) -> tuple[np.ndarray, np.ndarray]:
    return tuple(np.random.default_rng(seed).standard_normal((2, SAMPLES)))


def density_filter(white: float, walk: float) -> tuple[np.ndarray, np.ndarray]:
    """Kalibr, OpenVINS, ORB-SLAM3, LIO-SAM: sigma_d = n sqrt(f); the bias steps by w sqrt(dt)."""
    a, b = draws(1)
    return white * math.sqrt(F) * a, np.cumsum(walk * math.sqrt(DT) * b)


def kalibr() -> tuple[np.ndarray, np.ndarray]:
    text = exported("kalibr")
    return density_filter(
        number(text, "gyroscope_noise_density"), number(text, "gyroscope_random_walk")
    )


def openvins() -> tuple[np.ndarray, np.ndarray]:
    text = exported("openvins")
    return density_filter(
        number(text, "gyroscope_noise_density"), number(text, "gyroscope_random_walk")
    )


def orb_slam3() -> tuple[np.ndarray, np.ndarray]:
    text = exported("orb-slam3")
    return density_filter(number(text, r"IMU\.NoiseGyro"), number(text, r"IMU\.GyroWalk"))


def lio_sam() -> tuple[np.ndarray, np.ndarray]:
    text = exported("lio-sam")
    return density_filter(number(text, "imuGyrNoise"), number(text, "imuGyrBiasN"))


def vins() -> tuple[np.ndarray, np.ndarray]:
    """The midpoint step: two half steps of sample noise, drawn again at each step; gyr_w dt."""
    text = exported("vins")
    a, b = draws(2)
    first = np.random.default_rng(3).standard_normal(SAMPLES)
    rate = 0.5 * number(text, "gyr_n") * (a + first)
    return rate, np.cumsum(number(text, "gyr_w") * DT * b)


def ekf2() -> tuple[np.ndarray, np.ndarray]:
    """PX4, steps of 10 ms: angle variance (gyr_noise dt)^2, bias variance (gyr_b_noise dt)^2."""
    text = render("px4", collect([documents.allan(), documents.triad()]), Settings()).text
    a, b = draws(4)
    return number(text, "EKF2_GYR_NOISE ") * a, np.cumsum(
        number(text, "EKF2_GYR_B_NOISE ") * DT * b
    )


def matlab() -> tuple[np.ndarray, np.ndarray]:
    """imuSensor, double-sided: NoiseDensity sqrt(f) per sample, RandomWalk/sqrt(f) per step."""
    text = exported("matlab")
    a, b = draws(5)
    white = number(text, "'NoiseDensity', ") * math.sqrt(F) * a
    return white, np.cumsum(number(text, "'RandomWalk', ") / math.sqrt(F) * b)


def gnss_ins_sim(*, markov: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Drift b <- (1 - 1/(f T)) b + (drift/f) w; white noise arw sqrt(f) per sample."""
    space: dict = {}
    exec(exported("gnss-ins-sim", markov=markov), space)
    errors = space["imu_err"]
    a, b = draws(6)
    arw = errors["gyro_arw"][0] * math.pi / 180 / 60
    drift, time = errors["gyro_b_stability"][0] * math.pi / 180 / 3600, errors["gyro_b_corr"][0]
    slow = lfilter([1.0], [1.0, -(1.0 - 1.0 / (F * time))], drift / F * b)
    return arw * math.sqrt(F) * a, slow


def navego() -> tuple[np.ndarray, np.ndarray]:
    """arw in deg/sqrt(h), arrw in deg/sqrt(h)/s: rad/s/sqrt(s) after pi/180/60."""
    text = exported("navego")
    a, b = draws(7)
    unit = math.pi / 180 / 60
    white = number(text, r"imu\.arw = ") * unit * math.sqrt(F) * a
    return white, np.cumsum(number(text, r"imu\.arrw = ") * unit * math.sqrt(DT) * b)


def psins() -> tuple[np.ndarray, np.ndarray]:
    """imuadderr: web sqrt(ts) per angle increment; the bias of TauG = inf steps by sqg sqrt(ts)."""
    text = exported("psins")
    a, b = draws(8)
    web = number(text, r"web = ") * math.pi / 180 / 60
    sqg = number(text, r"sqrtR0G = ") * math.pi / 180 / 3600 / 60
    return web * math.sqrt(DT) * a / DT, np.cumsum(sqg * math.sqrt(DT) * b)


def gazebo(*, markov: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """gz-sensors: step variance sigma^2 T/2 (1 - exp(-2 dt/T)), decay exp(-dt/T)."""
    root = ET.fromstring("<r>" + exported("gazebo", markov=markov) + "</r>")
    noise = root.find("sensor/imu/angular_velocity/x/noise")
    sigma, time = (
        float(noise.findtext(tag))
        for tag in ("dynamic_bias_stddev", "dynamic_bias_correlation_time")
    )
    a, b = draws(9)
    step = math.sqrt(-(sigma**2) * time / 2.0 * math.expm1(-2.0 * DT / time))
    slow = lfilter([1.0], [1.0, -math.exp(-DT / time)], step * b)
    return float(noise.findtext("stddev")) * a, slow


@pytest.mark.parametrize(
    "draw",
    [kalibr, openvins, orb_slam3, lio_sam, vins, ekf2, matlab, gnss_ins_sim, navego, psins, gazebo],
)
def test_consumers_noise_has_the_allan_deviation(draw) -> None:
    white, slow = draw()
    assert deviation(white, 1.0) == pytest.approx(N, rel=0.04)
    assert deviation(slow, 3.0) == pytest.approx(K, rel=0.08)
    assert deviation(slow, 1.0) == pytest.approx(K / math.sqrt(3.0), rel=0.05)


@pytest.mark.parametrize("draw", [gnss_ins_sim, gazebo])
def test_a_gauss_markov_process_keeps_its_sigma_and_time(draw) -> None:
    """Standard deviation within 4 sigma: 4e5 samples are 33 T, so sigma/sqrt(33) is 17 %."""
    _, slow = draw(markov=True)
    unit = math.pi / 180 / 3600
    assert np.std(slow) == pytest.approx(SIGMA * unit, rel=0.5)
    # Steps of 1 s: variance 2 sigma^2 (1 - exp(-1/T)), 4000 of them, 4 sigma is 4.5 %.
    steps = np.diff(slow[:: int(F)])
    assert np.std(steps) == pytest.approx(
        SIGMA * unit * math.sqrt(2 * -math.expm1(-1 / TIME)), rel=0.05
    )


def test_navego_and_psins_contain_the_gauss_markov_process_once() -> None:
    text = exported("navego", markov=True)
    assert number(text, r"imu\.gb_dyn = ") == pytest.approx(SIGMA / 3600, rel=1e-9)
    assert number(text, r"imu\.gb_corr = ") == TIME
    assert number(text, r"imu\.arrw = ") == 0.0
    assert "lacks sqrt(2)" in text
    text = exported("psins", markov=True)
    assert number(text, r"sqrtR0G = ") == pytest.approx(SIGMA, rel=1e-9)
    assert number(text, r"TauG = ") == TIME
