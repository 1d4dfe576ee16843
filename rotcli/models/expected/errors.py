"""Expected errors of a navigation run: mean and covariance over the window, mean squares.

For every error that a navigation on a still table reports, the covariance Z(t, t') and the mean
mu(t) follow from the noise figures, the correction's contrast, the accelerometer biases, the
uncertain attitude of the table and its motion (models/expected: sources, motion, response).
The expected mean square over the window is `sum_m v_m (Z(t_m, t_m) + mu(t_m)^2)`, v the weights
of the trapezoid rule: zero error at the start, half a weight at the end.
`rotcli.models.expected.distribution` turns Z and mu into quantiles and p values.

Height and up velocity have a part of second order: a tilted frame measures `g (1 - eps^2/2)`.
Its mean and covariance (Isserlis, Biometrika 12 (1918) 134) are integrated twice and added.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.expected.covariance import sensor_covariance
from rotcli.models.expected.distribution import PrincipalAxes, principal_axes
from rotcli.models.expected.motion import (
    ATTITUDE,
    VELOCITY,
    Blocks,
    ErrorName,
    StillTable,
    euler_rows,
)
from rotcli.models.expected.response import ResponseFrame, nominal_mean, response_frame
from rotcli.models.expected.sources import AccelSource, GyroSource, slow_covariances, whites
from rotcli.models.numerics.remembered import remembered
from rotcli.units import FloatArray

SECOND_ORDER = "second order"
# Errors whose root sum of squares is reported as well: horizontal position and velocity.
PAIRS = ((ErrorName.LATITUDE, ErrorName.LONGITUDE), (ErrorName.V_NORTH, ErrorName.V_EAST))
_TILTS = (9, 10)  # rows of the outputs
SOURCES = ("white", "drift", "column", "accelerometer", "attitude", SECOND_ORDER)


@dataclass(frozen=True, eq=False)
class RandomErrors:
    """What noise and priors make of the nine reported errors, whatever is known of their mean.

    covariance: (9, M, M) of each error with itself, order of ErrorName; m, m/s, rad; cross: (M, M)
    of each pair of PAIRS, first with second. first_order: (M, 9), the variances without the second
    order; shift: (M, 9), mean of the second order. parts: mean squares (11,) per source.
    """

    frame: ResponseFrame
    covariance: FloatArray
    cross: tuple[FloatArray, ...]
    first_order: FloatArray
    shift: FloatArray
    parts: dict[str, FloatArray]

    @cached_property
    def variance(self) -> FloatArray:
        """Return the variances (M, 9) at the coarse times."""
        return np.asarray(np.einsum("kmm->mk", self.covariance))

    @cached_property
    def axes(self) -> PrincipalAxes:
        """Return the principal axes of the errors and of PAIRS over the window."""
        weights = trapezoid_weights(self.frame.blocks.coarse)
        return principal_axes(self.covariance, weights, PAIRS, self.cross)


@dataclass(frozen=True, eq=False)
class ExpectedErrors:
    """Mean and covariance of the nine reported errors at the coarse times t_1 ... t_M.

    time: (M,) s from the window's start; mean: (M, 9), order of ErrorName; m, m/s, rad.
    parts: mean squares (9,) per source of SOURCES, which add up to `mean_square`; that of the
    second order contains its product with the other means.
    second_order: (9,) mean square of the second-order part alone.
    """

    time: FloatArray
    mean: FloatArray
    random: RandomErrors
    parts: dict[str, FloatArray]
    second_order: FloatArray

    @property
    def covariance(self) -> FloatArray:
        """Return the covariance (9, M, M) of each error with itself."""
        return self.random.covariance

    @property
    def tilt(self) -> float:
        """Return the largest tilt of the nominal attitude, rad."""
        return self.random.frame.nominal.tilt

    @property
    def weights(self) -> FloatArray:
        """Return the trapezoid weights v (M,) of a mean over the window."""
        return trapezoid_weights(len(self.time))

    @property
    def variance(self) -> FloatArray:
        """Return the variances (M, 9) at the coarse times."""
        return self.random.variance

    @property
    def envelope(self) -> FloatArray:
        """Return the expected root mean square (M, 9) at each coarse time."""
        return np.asarray(np.sqrt(self.variance + self.mean**2))

    @property
    def mean_square(self) -> FloatArray:
        """Return the expected mean squares (9,) over the window."""
        return np.asarray(self.weights @ (self.variance + self.mean**2))

    @property
    def rms(self) -> FloatArray:
        """Return the expected RMS (11,): the nine errors, horizontal position and velocity."""
        square = self.mean_square
        pairs = [square[0] + square[1], square[3] + square[4]]
        return np.asarray(np.sqrt(np.concatenate([square, pairs])))


def trapezoid_weights(count: int) -> FloatArray:
    """Return the weights (M,) of the time mean over t_1 ... t_M; the error at t_0 is zero.

    >>> trapezoid_weights(2)
    array([0.5 , 0.25])
    """
    weights = np.full(count, 1.0 / count)
    weights[-1] *= 0.5
    return weights


def expected_errors(
    table: StillTable,
    blocks: Blocks,
    gyro: GyroSource,
    accel: AccelSource,
    attitude_sigma: FloatArray | None = None,
) -> ExpectedErrors:
    """Return mean and covariance of the errors of a navigation run over a window.

    attitude_sigma: (3,) rad, of the rig's pitch, roll and azimuth. The reported attitude error
    starts at zero all the same: the wrong rig is its reference as well.
    """
    unbiased = replace(accel, bias=np.zeros(3))
    random = _random_errors(table, blocks, gyro, unbiased, attitude_sigma)
    frame = random.frame
    means = {"accelerometer": frame.integrate(frame.accel @ accel.bias)}
    if np.any(gyro.column):
        means["column"] = nominal_mean(frame)
    return _with_means(random, means)


# The runs of a batch follow one plan; each of its modes has covariances of its own.
@remembered(3)
def _random_errors(
    table: StillTable,
    blocks: Blocks,
    gyro: GyroSource,
    accel: AccelSource,
    attitude_sigma: FloatArray | None,
) -> RandomErrors:
    """Return what all sources but the known errors add; the arguments of `expected_errors`."""
    frame = response_frame(table, blocks, gyro.column)
    total = _Total(frame)
    total.add_noise("drift", "white", gyro, frame.gyro, ATTITUDE)
    total.add_noise("accelerometer", "accelerometer", accel, frame.accel, VELOCITY)
    per_rate = frame.gyro * blocks.rate[:, None, None]
    total.add_constants("drift", frame.gyro, gyro.turn_on_sigma)
    total.add_constants("column", per_rate, gyro.column_sigma)
    total.add_constants("column", per_rate, gyro.column_turn_on_sigma)
    total.add_constants("accelerometer", frame.accel, accel.bias_sigma)
    if attitude_sigma is not None:
        total.add_attitude(attitude_sigma)
    return total.result()


def _with_means(random: RandomErrors, means: dict[str, FloatArray]) -> ExpectedErrors:
    """Return the expected errors with known ones (M, 11) by source, second order included.

    The part of a source with a known error is the product of that with the sum of them.
    """
    frame = random.frame
    M = frame.blocks.coarse
    weights = trapezoid_weights(M)
    parts = dict(random.parts)
    total: FloatArray = np.sum(list(means.values()), axis=0)
    for name, one in means.items():
        parts[name] = parts[name] + weights @ (one * total)
    first = total[:, :9]
    mean, alone = first + random.shift, np.zeros(9)
    parts = {name: part[:9] for name, part in parts.items()}
    if not frame.table.hold_height:
        before = weights @ (random.first_order + first**2)
        change = weights @ (random.variance + mean**2) - before
        parts[SECOND_ORDER] = change
        # Of the change the product of the means, 2 mu_1 mu_2, belongs to both.
        alone = change - 2.0 * weights @ (first * random.shift)
    step = frame.blocks.length * frame.blocks.fine
    time = step * np.arange(1, M + 1, dtype=float)
    return ExpectedErrors(time, mean, random, parts, alone)


class _Total:
    """Sum of the sources: covariance of carried states, and mean squares by source."""

    def __init__(self, frame: ResponseFrame) -> None:
        M = frame.blocks.coarse
        self.frame = frame
        self.weights = trapezoid_weights(M)
        # Covariance (M, 9, M, 9) of the carried states at t_m with the increment of each step.
        self.states: FloatArray | None = None
        self.responses: list[FloatArray] = []
        self.parts = {name: np.zeros(11) for name in SOURCES}

    def add_noise(
        self,
        slow_name: str,
        white_name: str,
        source: GyroSource | AccelSource,
        W: FloatArray,
        states: slice,
    ) -> None:
        """Add slow and white noise of a triad; states: those its white noise drives."""
        blocks = self.frame.blocks
        M, r, h = blocks.coarse, blocks.fine, blocks.length
        white = self._white(source, states)
        self._count(white_name, np.cumsum(white, axis=0))
        found = slow_covariances(blocks.start, h, blocks.rate, source.axes)
        estimated = {k: E for k, E in enumerate(found) if E is not None}
        if estimated:
            own = W if len(source.axes) == 1 else W[:, :, list(estimated)]
            slow = sensor_covariance(own, list(estimated.values()), M, r)
        else:
            slow = np.zeros((M, 9, M, 9))
        steps = np.arange(M)
        added = slow[steps, :, steps, :]
        slow[steps, :, steps, :] += white
        _accumulate(slow)
        # The variance of a sum grows by its covariance with the new term, twice, less the term's.
        with_sum = slow[steps, :, steps, :] - white
        self._count(slow_name, np.cumsum(with_sum + with_sum.swapaxes(1, 2) - added, axis=0))
        self.states = slow if self.states is None else np.add(self.states, slow, out=slow)

    def _white(self, source: GyroSource | AccelSource, states: slice) -> FloatArray:
        """Return the covariance (M, 9, 9) that the white noise of a triad adds in each step."""
        blocks, frame = self.frame.blocks, self.frame
        M, r = blocks.coarse, blocks.fine
        middle = frame.nominal.C_ns[1::2] * whites(source)
        driven = frame.transition.to_start[:, :, states] @ middle
        if frame.table.hold_height:
            driven[:, [2, 5]] = 0.0
        by_step = driven.reshape(M, r, 9, 3).transpose(0, 2, 1, 3).reshape(M, 9, 3 * r)
        return np.asarray(blocks.length * (by_step @ by_step.swapaxes(1, 2)))

    def _count(self, name: str, carried: FloatArray) -> None:
        """Add to a source's mean squares the variances of carried states (M, 9, 9)."""
        R = self.frame.outputs
        self.parts[name] += self.weights @ np.einsum("mij,mij->mi", R @ carried, R)

    def add_constants(self, name: str, responses: FloatArray, sigma: FloatArray) -> None:
        """Add errors that are constant factors of per-block responses (n, 9, 3), one a sensor."""
        if np.any(sigma):
            self._add_responses(name, self.frame.integrate(responses * sigma))

    def add_attitude(self, sigma: FloatArray) -> None:
        """Add an attitude of the rig that is wrong by sigma (3,) rad in pitch, roll, azimuth."""
        if not np.any(sigma):
            return
        table = self.frame.table
        at_start = euler_rows(np.array([table.pitch]), np.array([table.azimuth]))[0]
        eps = np.linalg.inv(at_start) * sigma
        states = np.zeros((9, 3))
        states[ATTITUDE] = eps
        responses = self.frame.outputs @ states
        nominal = self.frame.nominal
        responses[:, 6:9] -= euler_rows(nominal.pitch[1:], nominal.azimuth[1:]) @ eps
        self._add_responses("attitude", responses)

    def _add_responses(self, name: str, responses: FloatArray) -> None:
        self.responses.append(responses)
        self.parts[name] += self.weights @ np.einsum("mks,mks->mk", responses, responses)

    def _covariance(self) -> tuple[FloatArray, list[FloatArray]]:
        """Return the covariance (11, M, M) of each output with itself, and that of each pair.

        Pairs: PAIRS, then the tilts eps_E and eps_N.
        """
        if self.states is None:
            raise ValueError("no source was added")
        M, R = self.frame.blocks.coarse, self.frame.outputs
        _accumulate(self.states.transpose(2, 3, 0, 1))
        left = (R @ self.states.reshape(M, 9, 9 * M)).reshape(M, 11, M, 9)
        alone: FloatArray = np.einsum("mknj,nkj->kmn", left, R)
        pairs = [np.einsum("mnj,nj->mn", left[:, i], R[:, j]) for i, j in (*PAIRS, _TILTS)]
        if self.responses:
            of = np.concatenate(self.responses, axis=2).swapaxes(0, 1)
            alone += of @ of.swapaxes(1, 2)
            pairs = [Z + of[i] @ of[j].T for Z, (i, j) in zip(pairs, (*PAIRS, _TILTS), strict=True)]
        return alone, pairs

    def result(self) -> RandomErrors:
        """Return the sum, second order included."""
        frame = self.frame
        both, (*cross, of_tilts) = self._covariance()
        covariance = both[:9]
        first_order = np.einsum("kmm->mk", covariance).copy()
        shift = np.zeros((frame.blocks.coarse, 9))
        if not frame.table.hold_height:
            squares = both[9] ** 2 + both[10] ** 2 + of_tilts**2 + of_tilts.T**2
            variance = np.einsum("kmm->m", both[9:])
            step = frame.blocks.length * frame.blocks.fine
            _add_second_order(covariance, shift, variance, squares, frame.table.gravity, step)
        return RandomErrors(frame, covariance, tuple(cross), first_order, shift, self.parts)


def _accumulate(terms: FloatArray) -> None:
    """Replace terms (M, ...) by their running sums, in place (faster than cumsum over axis 0)."""
    for m in range(1, len(terms)):
        terms[m] += terms[m - 1]


def _add_second_order(
    covariance: FloatArray,
    mean: FloatArray,
    variance: FloatArray,
    squares: FloatArray,
    gravity: float,
    step: float,
) -> None:
    """Add to height and up velocity, in place, the second order of the tilt.

    variance: (M,), C_EE + C_NN of the tilts eps_E, eps_N; squares: (M, M), sum of their squared
    covariances. The vertical acceleration `-g (eps_E^2 + eps_N^2)/2` has mean
    `-g (C_EE + C_NN)/2` and, for Gaussian tilts, covariance
    `g^2/2 (C_EE^2 + C_NN^2 + C_EN^2 + C_NE^2)`; both are integrated by the trapezoid rule.
    """
    once = step * np.tri(len(mean))
    once[np.diag_indices(len(mean))] *= 0.5  # zero tilt at t_0
    for row, integral in ((ErrorName.HEIGHT, once @ once), (ErrorName.V_UP, once)):
        mean[:, row] += integral @ (-0.5 * gravity * variance)
        covariance[row] += integral @ (0.5 * gravity**2 * squares) @ integral.T
