"""Merged single-axis calibrations, against stacked least squares and weighted means."""

import json

import numpy as np
import pytest

from rotcli.errors import ResultError
from rotcli.triad.merge import Column, merge, read_column
from rotcli.units import DEG_PER_HOUR, PPM

SIZES = np.repeat([100.0 * PPM, 2.0 * DEG_PER_HOUR], 3)


def values(result):
    """Return the merged parameters (12,), SI, and their covariance."""
    unit = np.repeat([PPM, DEG_PER_HOUR], [9, 3])
    return np.array([e.value for e in result.estimates]) * unit, result.covariance * np.outer(
        unit, unit
    )


def test_merged_calibrations_are_the_least_squares_of_all_their_values():
    rng = np.random.default_rng(4)
    axes = np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.28, 0.96], [0.0, 0.0, 1.0]])
    columns, rows, right = [], [], []
    for axis in axes:
        root = rng.standard_normal((6, 6)) + 3.0 * np.eye(6)
        measured = SIZES * rng.standard_normal(6)
        C = np.outer(SIZES, SIZES) * (root @ root.T)
        columns.append(Column("c.json", axis, measured, C))
        # Whitened rows: of N row by row and of the three biases.
        A = np.block([[np.kron(np.eye(3), axis), np.zeros((3, 3))], [np.zeros((3, 9)), np.eye(3)]])
        whiten = np.linalg.inv(np.linalg.cholesky(C))
        rows.append(whiten @ A)
        right.append(whiten @ measured)
    A, b = np.concatenate(rows), np.concatenate(right)
    expected, squares, *_ = np.linalg.lstsq(A, b, rcond=1e-30)
    result = merge(columns)
    found, covariance = values(result)
    np.testing.assert_allclose(found, expected, rtol=1e-7)
    np.testing.assert_allclose(covariance, np.linalg.inv(A.T @ A), rtol=1e-6)
    np.testing.assert_allclose(
        [e.sigma for e in result.estimates], np.sqrt(np.diag(result.covariance)), rtol=1e-12
    )
    assert result.chi2 == pytest.approx(float(squares[0]), rel=1e-7)
    assert result.dof == 12


@pytest.mark.parametrize(("chi2", "named"), [(22.0, False), (23.0, True)])
def test_square_axes_give_their_own_columns_and_the_weighted_mean_of_the_biases(chi2, named):
    columns = np.arange(1.0, 10.0).reshape(3, 3) * 1e-3
    weights = np.array([1.0, 4.0, 9.0])
    bias = np.array([1.0, 0.0, -1.0])[:, None] * np.array([1.0, 2.0, 3.0])
    mean = np.average(bias, axis=0, weights=weights)
    # Biases with sigmas of s / sqrt(weight) that make chi-squared what is asked for.
    s = np.sqrt(float((weights[:, None] * (bias - mean) ** 2).sum()) / chi2)
    given = [
        Column(
            f"{name}.json",
            axis,
            np.concatenate([columns[:, k], DEG_PER_HOUR * bias[k]]),
            np.diag(np.repeat([PPM, DEG_PER_HOUR * s / np.sqrt(weights[k])], 3) ** 2),
        )
        for k, (name, axis) in enumerate(zip("xyz", np.eye(3), strict=True))
    ]
    result = merge(given)
    found, covariance = values(result)
    np.testing.assert_allclose(found[:9].reshape(3, 3), columns, rtol=1e-12)
    np.testing.assert_allclose(found[9:], DEG_PER_HOUR * mean, rtol=1e-9)
    np.testing.assert_allclose(
        np.sqrt(np.diag(covariance)), np.repeat([PPM, DEG_PER_HOUR * s / np.sqrt(14.0)], [9, 3])
    )
    assert (result.chi2, result.dof) == (pytest.approx(chi2, rel=1e-6), 6)
    assert [f.code for f in result.findings] == ["biases-differ"] * named
    for finding in result.findings:
        assert (finding.value, finding.limit) == (result.chi2, pytest.approx(22.5))


def test_axes_in_a_plane_do_not_give_a_matrix():
    column = Column("c.json", np.eye(3)[0], np.zeros(6), np.eye(6))
    tilted = Column("d.json", np.array([0.0, 0.6, 0.8]), np.zeros(6), np.eye(6))
    for angle, ok in ((0.15, True), (0.05, False)):  # rad from the plane of the others
        near = np.array([np.cos(angle), np.sin(angle) * 0.8, -np.sin(angle) * 0.6])
        third = Column("e.json", near, np.zeros(6), np.eye(6))
        if ok:
            assert merge([column, tilted, third]).chi2 == 0.0
        else:
            with pytest.raises(ResultError, match="the axes do not span space"):
                merge([column, tilted, third])
    with pytest.raises(ResultError, match="the axes do not span space"):
        merge([column, tilted])


def test_a_column_is_read_with_its_covariance_in_si(tmp_path):
    names = ["bias_x", "bias_y", "bias_z", "Kgxz", "Kgyz", "Kgz"]
    root = np.random.default_rng(2).standard_normal((6, 6)) + 3.0 * np.eye(6)
    C = root @ root.T
    doc = {
        "kind": "calibration", "schema": 1, "rotcli": "0", "inputs": [], "rig": {}, "axis": "z",
        "rate": {"value": 20.0, "unit": "deg/s"},
        "parameters": {
            name: {"value": k + 1.0, "sigma": 1.0, "unit": "deg/h" if k < 3 else "ppm"}
            for k, name in enumerate(names)
        },
        "covariance": {"order": names, "matrix": C.tolist()},
    }  # fmt: skip
    path = tmp_path / "c.json"
    path.write_text(json.dumps(doc))
    found = read_column(str(path), doc)
    unit = np.repeat([PPM, DEG_PER_HOUR], 3)
    np.testing.assert_allclose(found.values, [4, 5, 6, 1, 2, 3] * unit, rtol=1e-12)
    order = [3, 4, 5, 0, 1, 2]
    np.testing.assert_allclose(
        found.covariance, C[np.ix_(order, order)] * np.outer(unit, unit), rtol=1e-12
    )
    doc["covariance"]["matrix"] = (C - 2.0 * np.linalg.eigvalsh(C)[0] * np.eye(6)).tolist()
    with pytest.raises(ResultError, match="not positive definite"):
        read_column(str(path), doc)
