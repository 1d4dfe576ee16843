"""The noise figures of a rig, as the tests of a log take them."""

from typing import TYPE_CHECKING

from rotcli.models.mean_covariance import SlowNoise

if TYPE_CHECKING:
    from rotcli.rig.rig import ImuSettings

# Rig keys of the slow noise of a gyro, by the field of SlowNoise.
_SLOW_NOISE_KEYS = {
    "bias_instability": "bias_instability",
    "rate_random_walk": "rate_random_walk",
    "markov_sigma": "gauss_markov_gyro_sigma",
    "markov_time": "gauss_markov_gyro_time",
}


def slow_noise_of(imu: "ImuSettings") -> list[SlowNoise] | None:
    """Return the slow noise of each gyro, None where the rig contains no such figure."""
    figures = {field: imu.figure(key) for field, key in _SLOW_NOISE_KEYS.items()}
    if figures["markov_sigma"] is None or figures["markov_time"] is None:
        figures["markov_sigma"] = figures["markov_time"] = None
    known = {field: figure for field, figure in figures.items() if figure is not None}
    if not known:
        return None
    return [SlowNoise(**{name: float(f[k]) for name, f in known.items()}) for k in range(3)]
