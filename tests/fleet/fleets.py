"""Simulated fleets of one parameter: y = 60 + U + D + R + eps with known s per value."""

import numpy as np

from rotcli.fleet.variance.nested import NestedRows, nest


def fleet(
    seed: int,
    units: int = 40,
    days: int = 5,
    turns: int = 4,
    sigmas: tuple[float, float, float] = (30.0, 8.0, 5.0),
    s_range: tuple[float, float] = (2.0, 12.0),
    shift: dict[int, float] | None = None,
) -> tuple[NestedRows, np.ndarray]:
    """Return the rows and the true means of the units; s is log-uniform."""
    rng = np.random.default_rng(seed)
    n = units * days * turns
    truth = 60.0 + sigmas[0] * rng.standard_normal(units)
    for unit, amount in (shift or {}).items():
        truth[unit] += amount
    s = np.exp(rng.uniform(*np.log(s_range), n))
    y = np.repeat(truth, days * turns) + s * rng.standard_normal(n)
    y += np.repeat(sigmas[1] * rng.standard_normal(units * days), turns)
    y += sigmas[2] * rng.standard_normal(n)
    unit = np.repeat(np.arange(units), days * turns)
    day = np.tile(np.repeat(np.arange(days), turns), units)
    return nest(y, s, unit, day), truth


def dense_covariance(rows: NestedRows, variances) -> np.ndarray:
    """Return the covariance (n, n) of the rows by its definition."""
    day = rows.day_of_row()
    unit = rows.unit_of_day()[day]
    v_unit, v_day, v_turn = variances
    same_unit = unit[:, None] == unit[None, :]
    same_day = day[:, None] == day[None, :]
    return v_unit * same_unit + v_day * same_day + np.diag(rows.s2 + v_turn)


def dense_criterion(rows: NestedRows, variances) -> float:
    """Return ln|V| + residuals V^-1 residuals + ln 1'V^-1 1 by dense algebra."""
    V = dense_covariance(rows, variances)
    one = np.ones(len(rows.y))
    inverse = np.linalg.inv(V)
    A = one @ inverse @ one
    mu = one @ inverse @ rows.y / A
    r = rows.y - mu
    return float(np.linalg.slogdet(V)[1] + r @ inverse @ r + np.log(A))
