"""Observability of the error states under a motion of the table: rank, combinations, advice.

The system of `rotcli.observe.errors_ins` with velocity measured (zero-velocity updates) is scaled
to natural units, its observability matrix decomposed into singular values, and the nullspace
described: observable states, observable combinations of states, unobservable states. Several
segments of different acceleration are stacked (piecewise
constant systems: Goshen-Meskin and Bar-Itzhack, IEEE Trans. AES 28 (1992)).
Source: O17, "Improving Observability of an Inertial System by Rotary Motions of an IMU", Sensors
2017, 17, 698, sections 3 and 4.
Results over full turns do not depend on the table angle; the sensor frame is that at angle 0.
"""

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.errors import RotcliError
from rotcli.models.rotation import attitude_matrix
from rotcli.observe import errors_ins
from rotcli.observe.errors_ins import ACCEL_BIAS, GYRO_BIAS, STATES_IN_N, STATES_IN_S, ErrorModel
from rotcli.observe.observability_matrix import (
    RANK_TOLERANCE,
    ROW_TOLERANCE,
    WEAK,
    natural_units,
    observability_degrees,
    scaled_observability_matrix,
    smallest_combinations,
)
from rotcli.rig.rig import DEFAULT_SITE
from rotcli.units import DEG, FloatArray

Parameter = Literal["roll", "pitch", "rate"]

MAX_SWEEP = 20_000


@dataclass(frozen=True)
class TableMotion:
    """A still or turning table, and accelerations of its vehicle.

    axis: unit vector of the rotation axis in b; None when still. rate: rad/s.
    pitch, roll, azimuth, latitude: rad. gravity: m/s^2. accelerations: E, N, U in m/s^2, one
    segment each; none means one segment at rest.
    """

    axis: tuple[float, float, float] | None = None
    rate: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    azimuth: float = 0.0
    latitude: float = DEFAULT_SITE.latitude
    gravity: float = 9.81
    model: ErrorModel = "simplified"
    accelerations: tuple[tuple[float, float, float], ...] = ()

    @property
    def C_nb(self) -> FloatArray:
        """Attitude of the body (3, 3)."""
        return attitude_matrix(self.pitch, self.roll, self.azimuth)

    @property
    def turning(self) -> bool:
        """Whether the table turns."""
        return self.axis is not None and self.rate != 0.0

    @property
    def w_ns_n(self) -> FloatArray:
        """Rate of the table against n (3,), rad/s, in n."""
        w_ns_b = self.rate * np.array(self.axis) if self.turning else np.zeros(3)
        return np.asarray(self.C_nb @ w_ns_b)

    @property
    def forces_n(self) -> FloatArray:
        """Specific force of each segment (segments, 3), m/s^2, in n."""
        rest = np.array([0.0, 0.0, self.gravity])
        return np.asarray(rest + np.array(self.accelerations or ((0.0, 0.0, 0.0),)))


@dataclass(frozen=True)
class Combination:
    """A sum of states that is observable although its terms are not; coefficients in SI."""

    text: str
    coefficients: dict[str, float]


@dataclass(frozen=True, eq=False)
class FrameObservability:
    """Observability of the states of one frame.

    states: names. observable, unobservable: names of such states. combinations: observable only
    together. degrees: per state, 0 = unobservable to 1 = fully observable. nullspace:
    (12, 12 - rank) in SI.
    """

    states: tuple[str, ...]
    observable: tuple[str, ...]
    combinations: tuple[Combination, ...]
    unobservable: tuple[str, ...]
    degrees: dict[str, float]
    nullspace: FloatArray


@dataclass(frozen=True, eq=False)
class Observability:
    """The analysis of one motion.

    singular_values: (12,), of the largest, in natural units. weak: some observable states are
    only weakly observable. n, s: the navigation and the sensor frame.
    """

    motion: TableMotion
    rank: int
    singular_values: FloatArray
    weak: bool
    n: FrameObservability
    s: FrameObservability
    advice: str


def validate_motion(motion: TableMotion) -> TableMotion:
    """Return the motion with a unit axis; raise RotcliError where it is impossible."""
    numbers = (motion.rate, motion.pitch, motion.roll, motion.azimuth, motion.latitude)
    if not np.isfinite(numbers).all():
        raise RotcliError("motion: a rate or an angle is not a finite number; set numbers")
    if not abs(motion.latitude) <= 90.0 * DEG:
        raise RotcliError(
            f"latitude {motion.latitude / DEG:g} deg: outside -90 to 90 deg; set that of the site"
        )
    if not (np.linalg.norm(motion.forces_n, axis=1) > 0.01 * motion.gravity).all():
        raise RotcliError(
            "acceleration: in free fall no tilt is observable; set another acceleration"
        )
    if motion.axis is None:
        return replace(motion, rate=0.0)
    length = float(np.linalg.norm(motion.axis))
    if not 0.0 < length < np.inf:
        raise RotcliError(f"axis {motion.axis}: no direction; set x, y, z, none or a vector")
    x, y, z = (float(a) / length for a in motion.axis)
    return replace(motion, axis=(x, y, z))


def analyse(motion: TableMotion) -> Observability:
    """Return the observability of the error states under a motion.

    Level rotation about z makes 8 of 12 combinations observable, as many as a still table; tilted
    it makes 11. Raises RotcliError for an impossible motion.
    """
    motion = validate_motion(motion)
    units, singular, Vt = _decompose(motion)
    rank = int((singular > RANK_TOLERANCE * singular[0]).sum())
    relative = singular / singular[0]
    weak = bool(relative[rank - 1] < WEAK)
    # The sensor biases are those in n rotated by C_sn; natural units are equal on all axes.
    T_sn = np.eye(len(STATES_IN_N))
    T_sn[ACCEL_BIAS, ACCEL_BIAS] = T_sn[GYRO_BIAS, GYRO_BIAS] = motion.C_nb.T
    n = _view(STATES_IN_N, relative, Vt, rank, units, motion.turning)
    s = _view(STATES_IN_S, relative, Vt @ T_sn.T, rank, units, motion.turning)
    advice = _advise(motion, rank, relative, n)
    return Observability(motion, rank, relative, weak, n, s, advice)


@dataclass(frozen=True, eq=False)
class Sweep:
    """Rank and degrees along one parameter.

    values: (k,) SI. rank: (k,). smallest: (k,) smallest regular singular value, of the largest.
    weak: (k,). degrees: (k, 12) of the states in n.
    """

    parameter: Parameter
    values: FloatArray
    rank: NDArray[np.int64]
    smallest: FloatArray
    weak: NDArray[np.bool_]
    degrees: FloatArray


def sweep(
    motion: TableMotion, parameter: Parameter, start: float, stop: float, step: float
) -> Sweep:
    """Return rank and degrees for `parameter` from start to stop (SI), both included.

    Raises RotcliError for a step in the wrong direction, and for the rate of a still table.
    """
    if step == 0.0 or not np.isfinite((start, stop, step)).all() or (stop - start) / step < 0:
        raise RotcliError(f"sweep of {parameter}: the step does not lead from start to end")
    count = int(np.floor((stop - start) / step * (1.0 + 1e-9) + 1e-9)) + 1
    if count > MAX_SWEEP:
        raise RotcliError(f"sweep of {parameter}: {count} points; the limit is {MAX_SWEEP}")
    if parameter == "rate" and motion.axis is None:
        raise RotcliError("sweep of rate: the table is still; set a rotation axis")
    values: FloatArray = start + step * np.arange(count, dtype=np.float64)
    ranks, smallest = np.empty(count, dtype=np.int64), np.empty(count)
    table = np.empty((count, 12))
    for k, value in enumerate(values):
        _, singular, Vt = _decompose(validate_motion(_with(motion, parameter, float(value))))
        relative = singular / singular[0]
        ranks[k] = (relative > RANK_TOLERANCE).sum()
        smallest[k] = relative[ranks[k] - 1]
        table[k] = observability_degrees(relative, Vt)
    return Sweep(parameter, values, ranks, smallest, smallest < WEAK, table)


def _with(motion: TableMotion, parameter: Parameter, value: float) -> TableMotion:
    if parameter == "roll":
        return replace(motion, roll=value)
    return replace(motion, pitch=value) if parameter == "pitch" else replace(motion, rate=value)


def _decompose(motion: TableMotion) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return natural units (12,), singular values (12,) and Vt (12, 12) of the scaled system."""
    units, T = natural_units(motion.gravity, motion.rate if motion.turning else 0.0)
    H = errors_ins.velocity_measurement()
    Q = [
        scaled_observability_matrix(
            errors_ins.zupt_error_dynamics(motion.latitude, f_n, motion.w_ns_n, motion.model),
            H,
            units,
            T,
        )
        for f_n in motion.forces_n
    ]
    _, singular, Vt = np.linalg.svd(np.concatenate(Q), full_matrices=False)
    return units, singular, Vt


def _view(
    states: tuple[str, ...],
    relative: FloatArray,
    Vt: FloatArray,
    rank: int,
    units: FloatArray,
    turning: bool,
) -> FrameObservability:
    nullspace = Vt[rank:].T
    row_space = Vt[:rank].T
    observable = np.linalg.norm(nullspace, axis=1) < ROW_TOLERANCE
    unobservable = np.linalg.norm(row_space, axis=1) < ROW_TOLERANCE
    joint = smallest_combinations(nullspace, np.flatnonzero(~observable & ~unobservable))
    return FrameObservability(
        states=states,
        observable=tuple(np.array(states)[observable].tolist()),
        combinations=tuple(_format_combination(c, states, units, turning) for c in joint),
        unobservable=tuple(np.array(states)[unobservable].tolist()),
        degrees=dict(zip(states, observability_degrees(relative, Vt).tolist(), strict=True)),
        nullspace=nullspace * units[:, None],
    )


def _format_combination(
    scaled: FloatArray, states: tuple[str, ...], units: FloatArray, turning: bool
) -> Combination:
    """Write a combination with the coefficient 1 at its largest bias or, without one, state.

    A coefficient is a number times its natural unit: g and w (the rate) when turning.
    """
    index = np.arange(len(STATES_IN_N))
    inertial = index[: ACCEL_BIAS.start]
    order = [i for i in (*index[ACCEL_BIAS], *inertial, *index[GYRO_BIAS]) if scaled[i] != 0.0]
    accel = [i for i in order if i in index[ACCEL_BIAS]]
    lead = max(accel or order, key=lambda i: round(abs(float(scaled[i])), 9))
    order.remove(lead)
    order.insert(0, lead)
    ratios = scaled / scaled[lead]
    text = ""
    for i in order:
        symbol = _unit_symbol(lead, i, turning)
        number = abs(float(ratios[i]))
        if not symbol:
            number *= float(units[lead] / units[i])
        factor = [] if abs(number - 1.0) < 1e-6 else [f"{number:.4g}"]
        factor += [symbol] if symbol else []
        sign = "" if i == lead else (" + " if ratios[i] > 0.0 else " - ")
        text += sign + "*".join([*factor, states[i]])
    coefficients = ratios * units[lead] / units
    return Combination(text, {states[i]: float(coefficients[i]) for i in order})


def _unit_symbol(lead: int, i: int, turning: bool) -> str:
    """Return the ratio of the natural units of two states, in g and w, "" when it is a number."""
    # Powers of g and of T = 1/w in the units of dv, eps, gamma, d.
    powers = ((1, 1), (0, 0), (1, 0), (0, -1))
    g, T = (a - b for a, b in zip(powers[lead // 3], powers[i // 3], strict=True))
    if T and not turning:
        return ""
    names = {(0, 0): "", (1, 0): "g", (1, 1): "(g/w)", (0, 1): "(1/w)", (0, -1): "w"}
    return names.get((g, T), f"g^{g}*w^{-T}")


def _advise(motion: TableMotion, rank: int, relative: FloatArray, n: FrameObservability) -> str:
    """Return advice about the motion."""
    f = motion.forces_n / np.linalg.norm(motion.forces_n, axis=1)[:, None]
    one_direction = np.linalg.matrix_rank(f, tol=1e-3) == 1
    along = "azimuth error" if abs(f[0, 2]) > 1.0 - 1e-6 else "attitude error about the force"
    weak = bool(relative[rank - 1] < WEAK)
    if rank == 12 and not weak:
        return f"All {len(STATES_IN_N)} error states are observable."
    formal = ""
    if weak:
        weak_states = [name for name in n.observable if n.degrees[name] < 0.5]
        formal = (
            f"{rank} states are observable, but weakly (smallest singular value "
            f"{relative[rank - 1]:.1g} of the largest)"
            + (f"; do not rely on {', '.join(weak_states)}. " if weak_states else ". ")
        )
    if not motion.turning:
        if one_direction:
            return formal + (
                "Turn the table about an axis tilted by at least 10 deg from both level and "
                "vertical: a still table does not separate the tilts from the level accelerometer "
                "biases, and azimuth error and vertical gyro bias are unobservable."
            )
        return formal + (
            "Accelerate in one more direction, not in one plane of forces with the others, or "
            "turn the table: on a still table all states are observable only with three forces."
        )
    if not one_direction:
        return formal + "Accelerate in a direction further from the others."
    if (
        motion.model == "full"
    ):  # with Earth rate the last ranks are weak; the paper's model gives the cause
        _, singular, _ = _decompose(replace(motion, model="simplified"))
        rank = int((singular > RANK_TOLERANCE * singular[0]).sum())
        weak = bool(singular[rank - 1] < WEAK * singular[0])
    if rank == 11 and not weak:
        return formal + (
            f"Only the {along} is unobservable; provide its initial value, or accelerate in a "
            "second direction."
        )
    if abs(motion.w_ns_n @ f[0]) > np.sqrt(0.5) * abs(motion.rate):
        return formal + (
            "Tilt the axis by at least 10 deg: this separates vertical gyro bias and both tilts."
        )
    return formal + (
        "Tilt the axis by at least 10 deg out of level: this separates the accelerometer bias "
        "parallel to it and the tilt perpendicular to it."
    )
