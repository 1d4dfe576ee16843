"""The time series of a navigation: every column contains what its name says, in its unit."""

import numpy as np

from rotcli.navigate.document import solution
from rotcli.navigate.estimate import ERROR_NAMES, Navigation
from rotcli.units import DEG


def test_every_column_of_a_solution_contains_what_it_is_named_after():
    n = 3
    step = np.arange(n) / 10.0
    result = Navigation(
        mode="full",
        rate=0.1,
        time=1.0 + step,
        latitude=(2.0 + step) * DEG,
        longitude=(3.0 + step) * DEG,
        height=4.0 + step,
        v_n=np.stack([5.0 + step, 6.0 + step, 7.0 + step], axis=1),
        pitch=(8.0 + step) * DEG,
        roll=(9.0 + step) * DEG,
        azimuth=(10.0 + step) * DEG,
        errors=np.stack(
            [(20.0 + k + step) * (DEG if k > 5 else 1.0) for k in range(len(ERROR_NAMES))], axis=1
        ),
    )
    expected = {
        "time [s]": 1.0,
        "latitude [deg]": 2.0,
        "longitude [deg]": 3.0,
        "height [m]": 4.0,
        "v_east [m/s]": 5.0,
        "v_north [m/s]": 6.0,
        "v_up [m/s]": 7.0,
        "pitch [deg]": 8.0,
        "roll [deg]": 9.0,
        "azimuth [deg]": 10.0,
        **{
            f"err_{name} [{'m/s' if 'v_' in name else 'deg' if k > 5 else 'm'}]": 20.0 + k
            for k, name in enumerate(ERROR_NAMES)
        },
    }
    columns = solution(result)
    assert set(columns) == set(expected)
    for name, first in expected.items():
        np.testing.assert_allclose(columns[name], first + step, rtol=1e-12, err_msg=name)
