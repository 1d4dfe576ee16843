"""Samples between the starts of cells, at 1 Hz, where a cell lasts 32 s."""

import numpy as np
from scipy.integrate import solve_ivp

from rotcli.models import earth, strapdown

LATITUDE, HEIGHT = 0.9, 500.0


def test_every_sample_at_1_hz_agrees_with_an_integration_in_the_axes_of_the_earth():
    start = earth.position_e(LATITUDE, 0.0, HEIGHT)
    C_ne = earth.C_ne(LATITUDE, 0.0)
    force = np.array([0.0, 0.0, float(earth.normal_gravity(LATITUDE, HEIGHT))])
    rate = np.array([0.0, 0.0, earth.EARTH_RATE])

    def derivative(_, y):
        normal, sin_latitude, height = earth.ellipsoid_normal(y[:3, None])
        gravity = -normal[:, 0] * earth.normal_gravity_sin(sin_latitude, height)[0]
        f = C_ne.T @ force
        return [*y[3:], *(f + gravity - 2.0 * np.cross(rate, y[3:]))]

    v_n = np.array([0.0, 3.0, 0.0])
    t = np.arange(201.0)
    reference = solve_ivp(
        derivative,
        (0.0, t[-1]),
        [*start, *(C_ne.T @ v_n)],
        t_eval=t,
        method="DOP853",
        rtol=1e-13,
        atol=1e-8,
        max_step=5.0,
    ).y
    state = strapdown.InitialState(LATITUDE, 0.0, HEIGHT, v_n, np.eye(3))
    w, f = np.tile(earth.earth_rate_n(LATITUDE), (201, 1)), np.tile(force, (201, 1))
    path = strapdown.mechanize_log(w, f, 1.0, state)
    found = np.stack(
        [
            earth.position_e(*place)
            for place in zip(path.latitude, path.longitude, path.height, strict=True)
        ]
    )
    # The mean of gravity in a cell of 32 s differs from gravity at the mean: 1e-9 m/s^2.
    np.testing.assert_allclose(found, reference[:3].T, rtol=0.0, atol=5e-5)
