"""The errors of one run in several modes in one figure."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.errors import ResultError
from rotcli.files.figures import figure_bytes
from rotcli.navigate.api import NavigationResult
from rotcli.navigate.plot import ERROR_COLUMNS, modes_figure


def result(mode, scale):
    time = np.linspace(100.0, 400.0, 31)
    series = {name: scale * k * time for k, name in enumerate(ERROR_COLUMNS)}
    doc = {"mode": mode, "rate": {"value": 10.0}, "axis": "z", "inputs": [{"path": "imu.csv"}]}
    return NavigationResult(doc, {**series, "time [s]": time})


def test_nine_panels_show_each_mode_from_the_start_of_the_window():
    results = [result("conventional", 3.0), result("partial", 2.0), result("full", 1.0)]
    figure = modes_figure(results)
    assert [panel.get_ylabel().split(",")[0] for panel in figure.axes] == [
        *("latitude", "longitude", "height"),
        *("v north", "v east", "v up"),
        *("pitch", "roll", "azimuth"),
    ]
    lines = {line.get_label(): line for line in figure.axes[-1].get_lines()}
    assert {"conventional", "partial", "full"} < set(lines)
    azimuth = results[1].series["err_azimuth [deg]"]
    np.testing.assert_array_equal(lines["partial"].get_ydata(), azimuth)
    assert lines["partial"].get_xdata()[0] == 0.0
    # A dashed line on a solid one shows both where they agree.
    assert lines["partial"].get_zorder() > lines["full"].get_zorder()
    drawn = [figure_bytes(modes_figure(results), "svg") for _ in range(2)]
    assert drawn[0] == drawn[1]


def test_without_the_series_there_is_no_figure():
    with pytest.raises(ResultError, match="without its time series"):
        modes_figure([result("full", 1.0), replace(result("partial", 1.0), series=None)])
