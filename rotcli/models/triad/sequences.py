"""Named sequences of positions and turns: S1, S2, M5, the naive faces, single-axis schemes.

Each function returns a builder, which has the steps and the motion.
Angles of attitudes are in deg, outermost axis first. S1 is the long reference sequence, S2 the
short one after a D-optimal plan, M5 the shortest one, without any still segment.
"""

from collections.abc import Callable

import numpy as np

from rotcli.models.triad.motion import MotionBuilder
from rotcli.units import DEG

OUTER, MIDDLE, INNER = 0, 1, 2
# (middle, inner), deg, for z, -z, x, -x, y, -y up on a table of axes z, x, y.
FACES = ((0, 0), (0, 180), (0, -90), (0, 90), (90, 0), (-90, 0))
DIAGONAL = float(np.rad2deg(np.arctan(1.0 / np.sqrt(2.0))))  # 35.264 deg


def _go(b: MotionBuilder, *attitude: float) -> None:
    b.go(np.array(attitude, dtype=float) * DEG)


def _spin(b: MotionBuilder, axis: int, rate: float, turns: float) -> None:
    b.spin(axis, rate * DEG, turns)


def faces(b: MotionBuilder, hold: float = 60.0, rate: float = 60.0, turns: float = 10.0) -> None:
    """Add the naive sequence: six faces, still at outer 0 and 180, turns of the outer axis."""
    for face in FACES:
        _go(b, 0, *face)
        b.hold(hold)
        _spin(b, OUTER, rate, turns)
        _go(b, 180, *face)
        b.hold(hold)


def s1(n: float = 10.0, hold: float = 60.0) -> MotionBuilder:
    """Return S1: faces, three tumbles, four body diagonals. n: turns per spin at a face."""
    b = MotionBuilder(3)
    faces(b, hold, 60.0, n)
    _tumbles(b, n)
    _diagonals(b, 0.5 * n)
    return b


def _tumbles(b: MotionBuilder, turns: float) -> None:
    _go(b, 0, 0, 0)
    _spin(b, INNER, 60, turns)
    _spin(b, MIDDLE, 60, turns)
    _go(b, 0, 0, 90)
    _spin(b, MIDDLE, 60, turns)


def _diagonals(b: MotionBuilder, turns: float) -> None:
    for middle, inner in ((1, 45), (-1, 45), (1, -45), (-1, -45)):
        _go(b, 0, middle * DIAGONAL, inner)
        b.hold(30.0)
        _spin(b, OUTER, 100, turns)


def s2(length: float = 1.0) -> MotionBuilder:
    """Return S2 (920 s): six short faces, fast spins in skew attitudes.

    length: factor of all still times and turns.
    """
    b = MotionBuilder(3)
    for face in FACES:
        _go(b, 0, *face)
        b.hold(20.0 * length)
    skew = ((45, 45), (45, 135), (45, -135), (-45, 0), (-45, 180), (-45, -90))
    for middle, inner in (*skew, (DIAGONAL, -45), (0, 90)):
        _go(b, 0, middle, inner)
        _spin(b, OUTER, 100, 4 * length)
    for inner in (0, 45, 90, 135):
        _go(b, 0, 0, inner)
        _spin(b, MIDDLE, 100, 4 * length)
    _go(b, 0, 0, 0)
    _spin(b, INNER, 100, 4 * length)
    return b


def m5(rate: float = 60.0, turns: float = 5.0) -> MotionBuilder:
    """Return M5 (378 s): five pairs of spins without any still segment."""
    b = MotionBuilder(3)
    _spin(b, INNER, rate, turns)
    _spin(b, MIDDLE, rate, turns)
    _go(b, 0, 0, 90)
    _spin(b, MIDDLE, rate, turns)
    for middle in (45, -45):
        _go(b, 0, middle, 45)
        _spin(b, OUTER, rate, turns)
    return b


def faces_only() -> MotionBuilder:
    """Return the naive sequence alone."""
    b = MotionBuilder(3)
    faces(b)
    return b


def tumbles(*, still: bool = False) -> MotionBuilder:
    """Return the three tumbles of S1 with short turns; with `still` also outer 0 and 180."""
    b = MotionBuilder(3)
    if still:
        b.hold(20.0)
        _go(b, 180, 0, 0)
        b.hold(20.0)
    _tumbles(b, 5)
    return b


def still_faces() -> MotionBuilder:
    """Return twelve still segments on the faces, without any spin."""
    b = MotionBuilder(3)
    for face in FACES:
        for outer in (0, 180):
            _go(b, outer, *face)
            b.hold(60.0)
    return b


def one_axis(
    mountings: int,
    still_angles: tuple[float, ...],
    hold: float,
    *,
    rate: float = 60.0,
    turns: float = 10,
) -> MotionBuilder:
    """Return a single-axis sequence: per mounting still at some angles (deg), then turns."""
    b = MotionBuilder(1)
    for m in range(mountings):
        b.mount(m)
        for angle in still_angles:
            _go(b, angle)
            b.hold(hold)
        _go(b, 0)
        _spin(b, OUTER, rate, turns)
    return b


NAMED: dict[str, Callable[[], MotionBuilder]] = {"S1": s1, "S2": s2, "M5": m5, "faces": faces_only}
