"""Motion of a table of one to three axes: steps of constant acceleration, one after the other."""

from collections.abc import Sequence
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.units import DEG, FloatArray

IntArray = NDArray[np.int64]

ACCELERATION = 20.0 * DEG  # rad/s^2, of ramps and slews
SLEW_RATE = 20.0 * DEG  # rad/s, largest rate between positions


@dataclass(frozen=True)
class Go:
    """Go to an attitude (rad), one axis at a time, outermost first."""

    attitude: tuple[float, ...]


@dataclass(frozen=True)
class Hold:
    """Keep the table still for some seconds."""

    duration: float


@dataclass(frozen=True)
class Spin:
    """Turn one axis (0 = outermost) at a rate (rad/s), forward and, with `both`, backward."""

    axis: int
    rate: float
    turns: float
    both: bool = True


@dataclass(frozen=True)
class Mount:
    """Mount the IMU in another way (index of the mounting)."""

    mounting: int


Step = Go | Hold | Spin | Mount


@dataclass(frozen=True, eq=False)
class TableMotion:
    """Steps of constant acceleration.

    start: (P + 1,), s, with the end of the last step; angle, rate, acceleration: (P, K) at the
    start of each step, rad and s; mounting: (P,) index of the IMU's mounting.
    """

    start: FloatArray
    angle: FloatArray
    rate: FloatArray
    acceleration: FloatArray
    mounting: IntArray

    @property
    def duration(self) -> float:
        """Time from the first to the last step, s."""
        return float(self.start[-1] - self.start[0])

    def step(self, time: FloatArray) -> IntArray:
        """Return the index of the step at each time (n,), s; the first and last go on for ever."""
        at = np.searchsorted(self.start, time, side="right") - 1
        return np.clip(at, 0, len(self.angle) - 1)

    def at(
        self, time: FloatArray, step: IntArray | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return angles, rates and accelerations (K, n) at times (n,), s."""
        step = self.step(time) if step is None else step
        since = (time - self.start[step])[:, None]
        rate, change = self.rate[step], self.acceleration[step]
        angle = self.angle[step] + rate * since + 0.5 * change * since**2
        return angle.T, (rate + change * since).T, change.T.copy()


@dataclass
class MotionBuilder:
    """Steps added one by one; angles of the arguments are in rad, rates in rad/s."""

    axes: int
    acceleration: float = ACCELERATION
    slew_rate: float = SLEW_RATE
    mounting: int = 0
    angles: FloatArray = field(init=False)
    steps: list[Step] = field(init=False)
    _steps: list[tuple[float, FloatArray, FloatArray, FloatArray, int]] = field(init=False)

    def __post_init__(self) -> None:
        self.angles = np.zeros(self.axes)
        self._steps = []
        self.steps = []

    @property
    def has_motion(self) -> bool:
        """Whether any step lasts."""
        return bool(self._steps)

    def play(self, steps: Sequence[Step]) -> None:
        """Add some steps."""
        for step in steps:
            if isinstance(step, Go):
                self.go(step.attitude)
            elif isinstance(step, Hold):
                self.hold(step.duration)
            elif isinstance(step, Spin):
                self.spin(step.axis, step.rate, step.turns, both=step.both)
            else:
                self.mount(step.mounting)

    def mount(self, mounting: int) -> None:
        """Mount the IMU in another way; the time that it takes is no part of the motion."""
        self.mounting = mounting
        self.steps.append(Mount(mounting))

    def _add(self, duration: float, axis: int, rate: float, acceleration: float) -> None:
        rates, changes = np.zeros(self.axes), np.zeros(self.axes)
        rates[axis], changes[axis] = rate, acceleration
        self._steps.append((duration, self.angles.copy(), rates, changes, self.mounting))
        self.angles[axis] += rate * duration + 0.5 * acceleration * duration**2

    def hold(self, duration: float) -> None:
        """Keep the table still for some seconds."""
        if duration > 0.0:
            self.steps.append(Hold(duration))
            self._add(duration, 0, 0.0, 0.0)

    def turn(self, axis: int, angle: float, rate: float) -> None:
        """Turn one axis by an angle from rest to rest: ramp, constant rate, ramp."""
        size, sign = abs(angle), np.sign(angle)
        if size < 1e-12:
            return
        a = self.acceleration
        peak = min(rate, float(np.sqrt(a * size)))
        ramp, steady = peak / a, size / peak - peak / a
        target = self.angles[axis] + angle
        self._add(ramp, axis, 0.0, sign * a)
        if steady > 1e-9:
            self._add(steady, axis, sign * peak, 0.0)
        self._add(ramp, axis, sign * peak, -sign * a)
        self.angles[axis] = target

    def go(self, attitude: Sequence[float] | FloatArray, rate: float | None = None) -> None:
        """Go to an attitude (K,), one axis at a time, outermost first."""
        self.steps.append(Go(tuple(float(angle) for angle in attitude)))
        for axis, target in enumerate(attitude):
            self.turn(axis, target - self.angles[axis], self.slew_rate if rate is None else rate)

    def spin(self, axis: int, rate: float, turns: float, *, both: bool = True) -> None:
        """Ramp up, make some turns at the rate, ramp down; with `both` backwards at once, too."""
        self.steps.append(Spin(axis, rate, turns, both))
        angle = 2.0 * np.pi * turns + rate**2 / self.acceleration
        for sign in (1.0, -1.0) if both else (1.0,):
            self.turn(axis, sign * angle, rate)

    def motion(self, start: float = 0.0) -> TableMotion:
        """Return the steps so far, the first at a time (s)."""
        durations = np.array([s[0] for s in self._steps])
        return TableMotion(
            start=start + np.concatenate([[0.0], np.cumsum(durations)]),
            angle=np.array([s[1] for s in self._steps]),
            rate=np.array([s[2] for s in self._steps]),
            acceleration=np.array([s[3] for s in self._steps]),
            mounting=np.array([s[4] for s in self._steps], dtype=np.int64),
        )
