"""What is kept of a log that is filtered part by part, and what its innovations say of it."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rotcli.models import kalman
from rotcli.models.running import RunningErrors
from rotcli.observe.zupt.filter import Estimates
from rotcli.observe.zupt.model import Settings
from rotcli.observe.zupt.run import ZuptRun

Array = NDArray[np.float64]

HISTORY_POINTS = 301  # updates whose estimates are kept, for plots
MAX_INITIAL_SIGMAS = 5.0  # initial sigmas
NIS_REJECT_FACTOR = 2.0  # times the upper bound of mean NIS: sigmas 1.4 times too small, and more


@dataclass(frozen=True, eq=False)
class ZuptResult:
    """One log filtered.

    settings: of the filter. estimates: HISTORY_POINTS of its updates, evenly spaced, with the first
    and the last, times on the log's clock; biases are those of the sensors, calibration included.
    rms: (m,) root mean square of every update's values; rms_attitude: (3,) rad, of the
    errors of pitch, roll, azimuth. update_interval: s. rate: rad/s, the table's main one, 0 when
    still; angle: rad, at the start. nis: mean and its 95 % bounds. start, end: s. calibrated:
    whether gyro scale factor and installation were removed first.
    """

    settings: Settings
    estimates: Estimates
    rms: Array
    rms_attitude: Array
    update_interval: float
    rate: float
    angle: float
    start: float
    end: float
    nis: float
    nis_bounds: tuple[float, float]
    calibrated: bool
    prior_violations: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    def nis_verdict(self) -> str:
        """What the innovations say of the sigmas.

        consistent, cautious, optimistic, or inconsistent: so far above that nothing is to be used.
        """
        low, high = self.nis_bounds
        if self.nis > NIS_REJECT_FACTOR * high:
            return "inconsistent"
        return "cautious" if self.nis < low else "optimistic" if self.nis > high else "consistent"


class ZuptHistory:
    """The figures of a run whose estimates come part by part."""

    def __init__(self, run: ZuptRun) -> None:
        self.run = run
        self._keep = np.unique(np.linspace(0, run.count - 1, HISTORY_POINTS).round().astype(int))
        self._done = 0
        self._errors = RunningErrors()
        self._nis = 0.0
        self._kept: list[Estimates] = []
        self._last: Estimates | None = None

    def watch(self, parts: Iterable[Estimates]) -> Iterator[Estimates]:
        """Take the parts of `estimate_parts` and pass them on, calibration included."""
        for part in parts:
            self._last = part
            whole = self.run.total_estimates(part)
            self._errors.add(np.column_stack([whole.values, whole.attitude_errors]))
            self._nis += float(part.nis.sum())
            n = len(part.time)
            first, stop = np.searchsorted(self._keep, [self._done, self._done + n])
            at = self._keep[first:stop] - self._done
            names = ("time", "values", "sigma", "nis")
            self._kept.append(replace(whole, **{name: getattr(whole, name)[at] for name in names}))
            self._done += n
            yield whole

    def result(self) -> ZuptResult:
        """Return what was found, once all parts have gone through."""
        if self._last is None:
            raise ValueError("no part has gone through")
        run, rms, count = self.run, self._errors.rms, self._done
        beyond = _beyond_prior(self._last.values[-1], run.settings)

        def joined(name: str) -> Array:
            return np.concatenate([getattr(part, name) for part in self._kept])

        estimates = replace(
            self._kept[-1],
            time=joined("time"),
            values=joined("values"),
            sigma=joined("sigma"),
            nis=joined("nis"),
        )
        done = ZuptResult(
            settings=run.settings,
            estimates=estimates,
            rms=rms[:-3],
            rms_attitude=rms[-3:],
            update_interval=run.settings.samples * run.imu.interval,
            rate=run.rate,
            angle=run.angle,
            start=run.start,
            end=run.end,
            nis=self._nis / count,
            nis_bounds=kalman.mean_bounds(3, count),
            calibrated=run.calibrated,
            prior_violations=tuple(beyond),
            warnings=(*run.warnings, *(f"{text}; no estimate is to be used" for text in beyond)),
        )
        if done.nis_verdict in ("optimistic", "inconsistent"):
            what = (
                f"the innovations are larger than the sigmas say (mean NIS {done.nis:.2f}, up to "
                f"{done.nis_bounds[1]:.2f} expected): look for a moving table, uncalibrated "
                "sensors, a wrong lever arm or time offset, or too small noise figures"
                + ("; no estimate is to be used" if done.nis_verdict == "inconsistent" else "")
            )
            done = replace(done, warnings=(*done.warnings, what))
        return done


def _beyond_prior(values: Array, settings: Settings) -> list[str]:
    """Tell of biases among values (m,) that their initial sigma made all but impossible.

    The filter then holds back what it should have corrected: of a bias that nothing shows, a tilt
    makes a false one across it.
    """
    distance = np.abs(values) / settings.initial_sigma
    return [
        f"the {sensor} biases end {distance[k : k + 3].max():.2g} initial sigmas from where they "
        f"started: raise --sigma-{sensor} to at least a third of the greatest"
        for sensor, k in (("accel", 6), ("gyro", 9))
        if distance[k : k + 3].max() > MAX_INITIAL_SIGMAS
    ]
