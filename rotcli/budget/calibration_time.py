"""Predicted sigmas of a calibration against the time it takes, and the best time.

Source: R16, "MEMS IMU Error Mitigation Using Rotation Modulation Technique", Sensors 2016, 16,
2017, (35), (36) and section 4; IEEE Std 952 for the Allan variance of the noise.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.mean_covariance import IntervalNoise, SlowNoise, fit_gls, predict
from rotcli.models.sensors import FLICKER_FLOOR, NoiseFigures

_PAUSE = 4.0  # s between the segments, in which the table starts to turn (R16 section 3)
_HORIZON = 300.0  # s for which a bias is predicted, as R16 navigates
_REGULAR = 1e-12  # of the largest variance: two segments without white noise

TIMES = (10.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0)  # s


@dataclass(frozen=True)
class CalibrationTime:
    """Predicted sigmas of a calibration whose still and turning segments last `time` (s) each.

    bias (rad/s), column (fraction): of the mean over a segment, by its Allan deviation (R16
    section 4); bias_white, column_white: of white noise alone, R16 (35), (36). bias_predicted,
    column_predicted: what `rotcli calibrate` prints: the bias of the 300 s that follow, and the
    column from the difference of both segments, of which (36) leaves out the still one.
    """

    time: float
    bias: float
    bias_white: float
    column: float
    column_white: float
    bias_predicted: float
    column_predicted: float


def calibration_sigmas(noise: NoiseFigures, time: float, rate: float) -> CalibrationTime:
    """Predict the sigmas of a calibration with `time` (s) for each of its two segments.

    The sigma of the mean rate is the Allan deviation at that time. White noise falls as
    N / sqrt(T) (R16 (35)); flicker stays at 0.664 B; a rate random walk makes the mean of the
    segment differ from the value at its end by K sqrt(T / 3), exactly, and so the sigma rises
    again: the trade of R16 section 4. Over the rate it is the sigma of a matrix element (36).
    """
    bias = float(np.sqrt(noise.allan_variance(np.array([time]))[0]))
    white = noise.white / float(np.sqrt(time))
    predicted = _predicted(noise, time, rate)
    return CalibrationTime(time, bias, white, bias / abs(rate), white / abs(rate), *predicted)


def _predicted(noise: NoiseFigures, time: float, rate: float) -> tuple[float, float]:
    """Return the sigmas of bias (rad/s) and column (fraction) by generalised least squares.

    A still segment, a pause, a turning segment; the bias is that of the window that follows.
    """
    turns = time + _PAUSE
    start, end = np.array([0.0, turns]), np.array([time, turns + time])
    interval_noise = IntervalNoise(start, end, SlowNoise.from_figures(noise), noise.white)
    S = interval_noise.covariance()
    if not np.any(S):
        return 0.0, 0.0
    S = S + _REGULAR * float(np.abs(S).max()) * np.eye(2)
    fit = fit_gls(np.array([[1.0, 0.0], [1.0, rate]]), np.zeros(2), S)
    window = interval_noise.horizon(float(end[-1]), float(end[-1]) + _HORIZON)
    sigma = predict(fit, np.eye(2), np.array([1.0, 0.0]), window).sigma
    return float(sigma[0]), float(sigma[1])


def best_calibration_time(noise: NoiseFigures) -> tuple[float | None, bool]:
    """Return the best segment length (s), and whether the sigma rises again past it.

    With a rate random walk K the minimum lies at sqrt(3) N / K. Without, nothing rises; the time
    at which white noise has fallen to the flicker's floor is returned: the sigma is then sqrt(2)
    of the floor. None without white noise or with nothing against it.
    """
    N, K, floor = noise.white, noise.rate_random_walk, FLICKER_FLOOR * noise.bias_instability
    if N and K:
        return float(np.sqrt(3.0)) * N / K, True
    return ((N / floor) ** 2, False) if N and floor else (None, False)
