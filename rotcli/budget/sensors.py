"""The sensors of an error budget: from a profile, a calibration and single figures."""

from collections.abc import Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from rotcli import units
from rotcli.dataclass import dataclass
from rotcli.errors import CodedText
from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.sensors import AXIS_COLUMN_NAMES, NoiseFigures, TriadErrors
from rotcli.models.triad import parameters as p
from rotcli.rig.profile import Profile
from rotcli.rig.rig import ImuSettings
from rotcli.run.correction import Correction
from rotcli.units import FloatArray

_PAIRS = ("xy", "xz", "yx", "yz", "zx", "zy")
_ACCEL = tuple(f"accel_bias_{axis}" for axis in "xyz")
_BIAS = tuple(f"bias_{axis}" for axis in "xyz")
_SCALE = tuple(f"Kg{axis}" for axis in "xyz")
_INSTALLATION = tuple(f"Kg{pair}" for pair in _PAIRS)
_NOISE = {
    "angle_random_walk": ("white", units.DEG_PER_ROOT_HOUR),
    "bias_instability": ("bias_instability", units.DEG_PER_HOUR),
    "rate_random_walk": ("rate_random_walk", units.DEG_PER_HOUR),
}

_ACCEL_NOISE = ("velocity_random_walk", "accel_bias_instability")


@dataclass(frozen=True, eq=False)
class Sensors:
    """Gyro errors (SI), accelerometer bias (3,) m/s^2, noise; `known`: parameters with a value.

    noise: of the gyros; accel: of the accelerometers, None where unknown.

    Each `with_...` returns the sensors with the values of another source in place of these.
    """

    gyro: TriadErrors = field(default_factory=TriadErrors)
    accel_bias: FloatArray = field(default_factory=lambda: np.zeros(3))
    noise: NoiseFigures = field(default_factory=NoiseFigures)
    noise_known: frozenset[str] = frozenset()
    accel: NoiseFigures | None = None
    known: frozenset[str] = frozenset()

    def with_profile(self, profile: Profile) -> "Sensors":
        """Take all constant errors and the noise of a profile."""
        return Sensors(
            gyro=TriadErrors(profile.gyro.matrix, profile.gyro.bias),
            accel_bias=profile.accel.bias,
            noise=NoiseFigures(**profile.gyro.noise),
            noise_known=frozenset(name for name, _ in _NOISE.values()),
            accel=NoiseFigures(**profile.accel.noise),
            known=frozenset((*_ACCEL, *_BIAS, *_SCALE, *_INSTALLATION)),
        )

    def with_correction(self, correction: Correction) -> "Sensors":
        """Take the biases of a calibration, and its axis column."""
        u, matrix = correction.axis, self.gyro.matrix
        known = set(_BIAS)
        if correction.gyro_column is not None:
            matrix = matrix + np.outer(correction.gyro_column - matrix @ u, u)
            known |= {
                f"Kg{row}" if row == column else f"Kg{row}{column}"
                for column, part in zip("xyz", u, strict=True)
                if part
                for row in "xyz"
            }
        has_accel = bool(np.any(correction.accel_bias))
        return replace(
            self,
            gyro=TriadErrors(matrix, correction.gyro_bias),
            accel_bias=correction.accel_bias if has_accel else self.accel_bias,
            known=self.known | known | (set(_ACCEL) if has_accel else set()),
        )

    def with_triad(self, x: FloatArray, absent: Sequence[str]) -> "Sensors":
        """Take a full calibration: x (60,) SI; absent: parameters that it does not have."""
        known = {n for n in (*_BIAS, *_SCALE, *_INSTALLATION, *_ACCEL) if n not in absent}
        return replace(
            self,
            gyro=TriadErrors(x[p.N].reshape(3, 3), x[p.GYRO_BIAS]),
            accel_bias=x[p.ACCEL_BIAS],
            known=self.known | known,
        )

    def with_figures(
        self,
        *,
        accel_bias: Sequence[float] | None,
        gyro_bias: Sequence[float] | None,
        gyro_scale: Sequence[float] | None,
        gyro_installation: Sequence[float] | None,
    ) -> "Sensors":
        """Take single figures: m/s^2, deg/h, ppm, ppm (xy, xz, yx, yz, zx, zy)."""
        matrix, bias, known = self.gyro.matrix.copy(), self.gyro.bias, set(self.known)
        if gyro_scale is not None:
            matrix[np.diag_indices(3)] = units.PPM * np.array(gyro_scale)
            known |= set(_SCALE)
        if gyro_installation is not None:
            for pair, value in zip(_PAIRS, gyro_installation, strict=True):
                matrix["xyz".index(pair[0]), "xyz".index(pair[1])] = units.PPM * value
            known |= set(_INSTALLATION)
        if gyro_bias is not None:
            bias = units.DEG_PER_HOUR * np.array(gyro_bias)
            known |= set(_BIAS)
        if accel_bias is not None:
            known |= set(_ACCEL)
        return replace(
            self,
            gyro=TriadErrors(matrix, bias),
            accel_bias=self.accel_bias if accel_bias is None else np.array(accel_bias),
            known=frozenset(known),
        )

    def with_noise(self, imu: ImuSettings, given: Mapping[str, float | None]) -> "Sensors":
        """Take the noise figures `given` (deg/sqrt(h), deg/h, deg/h/sqrt(s)).

        Figures that are neither in a profile nor in `given` come from the rig, the root mean
        square of its axes.
        """
        figures, known = {}, set(self.noise_known)
        for key, (name, unit) in _NOISE.items():
            value, settings = given.get(key), imu.figure(key)
            if value is not None:
                figures[name] = unit * value
            elif name not in self.noise_known and settings is not None:
                figures[name] = float(np.sqrt(np.mean(settings**2)))
            known |= {name} if name in figures else set()
        accel = self.accel
        white, flicker = (imu.figure(key) for key in _ACCEL_NOISE)
        if accel is None and white is not None and flicker is not None:
            mean = [float(np.sqrt(np.mean(value**2))) for value in (white, flicker)]
            accel = NoiseFigures(white=mean[0], bias_instability=mean[1])
        noise = replace(self.noise, **figures)
        return replace(self, noise=noise, noise_known=frozenset(known), accel=accel)

    def missing_noise(self) -> list[str]:
        """Return the rig keys of the unknown noise figures that expected errors need."""
        missing = [key for key, (name, _) in _NOISE.items() if name not in self.noise_known]
        return missing + ([] if self.accel is not None else list(_ACCEL_NOISE))

    def gyro_noise(self) -> tuple[float, SlowNoise]:
        """Return N (rad/sqrt(s)) and the slow noise of a gyro."""
        return self.noise.white, SlowNoise.from_figures(self.noise)

    def accel_noise(self) -> tuple[float, SlowNoise]:
        """Return N (m/s/sqrt(s)) and the slow noise of an accelerometer."""
        figures = self.accel or NoiseFigures()
        return figures.white, SlowNoise.from_figures(figures)

    def assumed(self) -> list[str]:
        """Return warnings for figures without a value."""
        missing = [
            name for name in (*_ACCEL, *_BIAS, *_SCALE, *_INSTALLATION) if name not in self.known
        ]
        warnings: list[str] = []
        if missing:
            text = f"assumed zero, no value given: {', '.join(missing)}"
            warnings.append(CodedText("sensor-errors-assumed", text))
        if "white" not in self.noise_known:
            text = "no angle random walk: the calibration's sigmas contain no white noise"
            warnings.append(CodedText("no-angle-random-walk", text))
        return warnings

    def ranking_caveat(self) -> str:
        """Return a sentence where the scale factor and installation of some axes alone are known.

        A scheme about another axis then looks better than it is. Empty where all are known.
        """
        columns = {axis: set(AXIS_COLUMN_NAMES[axis]) for axis in "xyz"}
        unknown = [axis for axis, column in columns.items() if not column <= self.known]
        if not unknown or not any(column & self.known for column in columns.values()):
            return ""
        return (
            f" The ranking is incomplete: scale factor and installation about {', '.join(unknown)} "
            "are unknown (assumed 0); calibrate about each axis."
        )
