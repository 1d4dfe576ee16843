"""The errors of the sensors from several sources: columns, units, what is unknown."""

import numpy as np
import pytest

from rotcli.budget.sensors import Sensors
from rotcli.models.sensors import TriadErrors
from rotcli.rig.rig import default_rig
from rotcli.run.correction import Correction


def test_the_column_of_a_calibration_replaces_that_of_the_matrix():
    u = np.array([0.6, 0.0, 0.8])
    matrix = np.arange(9.0).reshape(3, 3) * 1e-3
    column = np.array([1e-4, -2e-4, 3e-4])
    bias = np.array([1e-5, 0.0, -1e-5])
    found = Sensors(gyro=TriadErrors(matrix, np.zeros(3))).with_correction(
        Correction("c.json", u, (0.5,), bias, column, np.zeros(3))
    )
    np.testing.assert_allclose(found.gyro.matrix @ u, column, atol=1e-18)
    across = np.array([[0.8, 0.0, -0.6], [0.0, 1.0, 0.0]])
    np.testing.assert_allclose(found.gyro.matrix @ across.T, matrix @ across.T, atol=1e-17)
    np.testing.assert_array_equal(found.gyro.bias, bias)
    assert {"Kgx", "Kgxz", "Kgz", "Kgyx"} <= found.known
    assert "Kgxy" not in found.known


def test_noise_figures_are_converted_to_si():
    given = {"angle_random_walk": 3.0, "bias_instability": 10.0, "rate_random_walk": 2.0}
    found = Sensors().with_noise(default_rig().imu, given)
    degree = np.pi / 180.0
    assert found.noise.white == pytest.approx(3.0 * degree / 60.0)
    assert found.noise.bias_instability == pytest.approx(10.0 * degree / 3600.0)
    assert found.noise.rate_random_walk == pytest.approx(2.0 * degree / 3600.0)


def test_the_ranking_is_incomplete_where_the_columns_of_some_axes_are_unknown():
    column_z = frozenset({"Kgz", "Kgxz", "Kgyz"})
    assert "about x, y are unknown" in Sensors(known=column_z).ranking_caveat()
    assert Sensors().ranking_caveat() == ""
    every = {f"Kg{a}{b}" if a != b else f"Kg{a}" for a in "xyz" for b in "xyz"}
    assert Sensors(known=frozenset(every)).ranking_caveat() == ""
