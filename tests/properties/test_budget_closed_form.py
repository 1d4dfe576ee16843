"""The error budget's closed forms: R16 table 1, and the integral of the exact model."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rotcli.budget.estimate import SOURCES, closed_form, integrated, period, split
from rotcli.models import rotation
from rotcli.models.base import FixedBase
from rotcli.models.earth import EARTH_RATE
from rotcli.models.sensors import TriadErrors

DEG = np.pi / 180


def numbers(size, greatest):
    return st.lists(
        st.floats(-greatest, greatest, allow_subnormal=False), min_size=size, max_size=size
    ).map(np.array)


LATITUDE = st.floats(-90.0, 90.0).map(lambda value: value * DEG)
# From a rate at which a turn takes six hours to the fastest of turntables.
RATE = st.tuples(st.sampled_from([-1.0, 1.0]), st.floats(1 / 60, 1000.0)).map(
    lambda pair: pair[0] * pair[1] * DEG
)
MATRIX = numbers(9, 0.05).map(lambda values: values.reshape(3, 3))
BIAS = numbers(3, 10000 * DEG / 3600)
ACCEL = numbers(3, 0.5)
LEVEL = np.eye(3)


@given(LATITUDE, RATE, MATRIX, BIAS, ACCEL, st.sampled_from("xyz"))
def test_the_closed_form_is_the_table_of_the_paper(latitude, w, N, d, b, axis):
    T, c, s = 2 * np.pi / abs(w), EARTH_RATE * np.cos(latitude), EARTH_RATE * np.sin(latitude)
    (Kgx, Kgxy, Kgxz), (Kgyx, Kgy, Kgyz), (Kgzx, Kgzy, Kgz) = N
    # Transcribed cell by cell from R16 table 1.
    table = {
        "x": [
            (T * b[0], 0, 0),
            (T * d[0], 0, 0),
            (T * Kgx * w, T / 2 * (Kgy + Kgz) * c, T / 2 * (Kgy + Kgz) * s),
            (0, T / 2 * (Kgyz - Kgzy) * s, T / 2 * (Kgzy - Kgyz) * c),
        ],
        "y": [
            (0, T * b[1], 0),
            (0, T * d[1], 0),
            (0, T * Kgy * (c + w), T / 2 * (Kgx + Kgz) * s),
            (T / 2 * (Kgxz - Kgzx) * s, 0, 0),
        ],
        "z": [
            (0, 0, T * b[2]),
            (0, 0, T * d[2]),
            (0, T / 2 * (Kgx + Kgy) * c, T * Kgz * (s + w)),
            (T / 2 * (Kgxy - Kgyx) * c, 0, 0),
        ],
    }[axis]
    base, u = FixedBase(latitude, 9.81, LEVEL), np.array(rotation.UNIT_VECTORS[axis])
    for (bias, matrix), expected in zip(split(TriadErrors(N, d), b).values(), table, strict=True):
        found = closed_form(bias, matrix, base, u, w)
        # Rounding of sums of the matrix's elements, where they cancel, times T and the rates.
        size = T * np.abs(matrix).max(initial=0) * (abs(w) + EARTH_RATE)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14 * size)


@given(
    LATITUDE,
    RATE,
    MATRIX,
    BIAS,
    ACCEL,
    numbers(3, 1.0).filter(lambda v: np.linalg.norm(v) > 0.1) | st.sampled_from(list(np.eye(3))),
    st.tuples(*[st.floats(-3.0, 3.0)] * 3) | st.just((0.0, 0.0, 0.0)),
)
def test_the_closed_form_is_the_integral_about_any_axis_in_any_attitude(
    latitude, w, N, d, b, axis, attitude
):
    base = FixedBase(latitude, 9.81, rotation.attitude_matrix(*attitude))
    u = axis / np.linalg.norm(axis)
    parts = split(TriadErrors(N, d), b)
    assert tuple(parts) == SOURCES
    for bias, matrix in parts.values():
        formula = closed_form(bias, matrix, base, u, w)
        integral = integrated(bias, matrix, base, u, w)
        # What the integral adds up before it cancels: its own rounding, and no more.
        summed = period(w) * (np.abs(bias).max() + 3 * np.abs(matrix).max() * (abs(w) + EARTH_RATE))
        largest = np.abs(formula).max()
        np.testing.assert_allclose(
            integral, formula, rtol=1e-6, atol=max(1e-9 * largest, 1e-14 * summed)
        )
