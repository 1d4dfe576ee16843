"""Series of the coordinates at the end of their range, high above the ground."""

import numpy as np

from rotcli.models import earth, strapdown
from rotcli.models.strapdown import geography


def test_the_latitude_of_a_long_cell_high_up_is_the_exact_one(monkeypatch):
    latitude, height, speed, interval = 0.9, 8000.0, 1000.0, 0.1  # a cell of 3.2 km
    t = interval * np.arange(1501)
    radius = float(earth.radii(latitude)[0]) + height
    g = float(earth.normal_gravity(latitude, height)) - speed**2 / radius
    angle = speed / radius * t
    force = g * np.stack([0.0 * t, -np.sin(angle), np.cos(angle)], axis=-1)
    start = strapdown.InitialState(latitude, 0.0, height, np.array([0.0, -speed, 0.0]), np.eye(3))
    w = np.zeros((len(t), 3))
    series = strapdown.mechanize_log(w, force, interval, start)
    monkeypatch.setattr(geography, "_MAX_REACH", 0.0)
    exact = strapdown.mechanize_log(w, force, interval, start)
    assert not np.array_equal(series.latitude, exact.latitude)
    # The fourth order at 1.6 km from the middle of the cell: 8e-8 m.
    assert np.abs(series.latitude - exact.latitude).max() * radius < 3e-7
