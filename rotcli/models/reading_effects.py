"""What a sensor's electronics do to its readings: a sinusoid, a low-pass filter, repeated samples.

The order is that of the signal: the sinusoid (a fan, a building, dithering) joins the motion and
the noise; the low-pass filter (a DLPF, an AHRS filter profile) smooths the sum; the logger reads
the output register several times before the sensor renews it.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.lazy import lazily
from rotcli.units import FloatArray

with lazily():
    import scipy.signal

_PHASES = 2.0 * np.pi * np.array([0.0, 1.0, 2.0]) / 3.0  # of the sinusoid on x, y, z, rad


@dataclass(frozen=True)
class ReadingEffects:
    """Effects on the readings of one triad; the defaults have none.

    low_pass: Hz, cut-off of a second-order Butterworth filter, 0 for none. line_frequency: Hz,
    line_amplitude: unit of the readings. repeats: how often each reading is logged.
    """

    low_pass: float = 0.0
    line_frequency: float = 0.0
    line_amplitude: float = 0.0
    repeats: int = 1

    def apply(self, readings: FloatArray, interval: float) -> FloatArray:
        """Return readings (n, 3) at an interval (s) as the logger gets them.

        The filter starts in the steady state of the first reading. A constant stays constant.
        Raises ValueError for a cut-off or a line at half the sample rate and beyond.
        """
        nyquist = 0.5 / interval
        for name, value in (("low_pass", self.low_pass), ("line_frequency", self.line_frequency)):
            if value >= nyquist:
                raise ValueError(f"{name} {value:g} Hz: must be below {nyquist:g} Hz")
        result = readings
        if self.line_amplitude:
            time = interval * np.arange(len(readings), dtype=float)[:, None]
            phase = 2.0 * np.pi * self.line_frequency * time + _PHASES
            result = result + self.line_amplitude * np.sin(phase)
        if self.low_pass:
            b, a = scipy.signal.butter(2, self.low_pass / nyquist)
            start = scipy.signal.lfilter_zi(b, a)[:, None] * result[0]
            result = scipy.signal.lfilter(b, a, result, axis=0, zi=start)[0]
        if self.repeats > 1:
            result = result[np.arange(len(result)) // self.repeats * self.repeats]
        return result


NO_EFFECTS = ReadingEffects()
