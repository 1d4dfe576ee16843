"""Figures of a large report: all units at once, values against those put into the documents."""

import numpy as np
import pytest

from rotcli.report import plots_overview
from rotcli.report.page import MANY_RESULTS, as_html
from rotcli.report.plots_campaign import navigation_figures
from rotcli.report.report import gather

RATES = (10.0, 20.0, 40.0)


def _draw(drawings):
    ((title, draw),) = drawings
    return title, draw()


def _campaign(documents, imu, scale):
    return [
        *(documents.navigation(imu, "conventional", 0.0, 300.0 * scale, 0.0) for _ in range(2)),
        *(documents.navigation(imu, "partial", r, 3.0 * r * scale, 4.0 * r * scale) for r in RATES),
        *(documents.navigation(imu, "full", r, scale * r, 0.0) for r in RATES),
    ]


def test_the_position_of_each_unit_has_a_panel_of_bars(documents):
    docs = [*_campaign(documents, "A", 1.0), *_campaign(documents, "B", 2.0)]
    title, figure = _draw(plots_overview.navigation_overview(documents.sources(*docs)))
    assert title == "Horizontal position RMS against the table rate: A, B"
    for panel, scale, name in zip(figure.axes, (1.0, 2.0), "AB", strict=True):
        assert panel.get_ylabel() == f"{name}\nposition, m"
        partial, full = ([bar.get_height() for bar in group] for group in panel.containers)
        assert partial == pytest.approx([5.0 * scale * r for r in RATES])  # a 3, 4, 5 triangle
        assert full == pytest.approx([scale * r for r in RATES])
        assert panel.get_lines()[0].get_ydata()[0] == pytest.approx(300.0 * scale)


def test_equal_runs_have_error_bars_of_no_length(documents):
    # The mean of three equal numbers may be below them by rounding: no error bar is negative.
    docs = [documents.navigation("A", "full", r, 0.1, 0.0) for r in RATES for _ in range(3)]
    (_, draw), *_ = navigation_figures(documents.sources(*docs))
    draw()
    _draw(plots_overview.navigation_overview(documents.sources(*docs)))


def test_parameters_are_shown_in_their_own_sigma(documents):
    docs = [documents.calibration("A", r, sigma_bias=2.0, shift=r) for r in RATES]
    title, figure = _draw(plots_overview.calibration_overview(documents.sources(*docs)))
    assert title.endswith("in sigma, against the table rate: A")
    (panel,) = figure.axes
    bias = panel.get_lines()[0]
    assert bias.get_label() == "bias_x"
    expected = (np.array(RATES) - np.mean(RATES)) / 2.0  # the bias is 0 + shift, its sigma 2 deg/h
    np.testing.assert_allclose(bias.get_ydata(), expected)
    looks = {(line.get_marker(), line.get_color()) for line in panel.get_lines()[:6]}
    assert len(looks) == 6


def test_the_allan_deviations_of_units_share_a_figure(documents):
    docs = [documents.allan("B"), documents.allan("A"), documents.allan("A")]
    title, figure = _draw(plots_overview.allan_overview(documents.sources(*docs)))
    assert title == "Allan deviation: A, B"
    gyro, accel = figure.axes
    assert [len(panel.get_lines()) for panel in (gyro, accel)] == [9, 9]  # three axes of three logs
    assert [line.get_label() for line in gyro.get_lines() if line.get_label()[0] != "_"] == [*"AB"]
    np.testing.assert_allclose(gyro.get_lines()[0].get_xydata()[:, 1], [10.0, 3.0, 1.0])


def test_many_units_are_shown_some_in_a_figure(documents):
    docs = [documents.allan(f"unit {k}") for k in range(9)]
    assert len(plots_overview.allan_overview(documents.sources(*docs))) == 3


def test_a_large_report_shows_the_overview_and_names_the_figures_that_it_leaves_out(
    documents, tmp_path
):
    docs = []
    for imu in ("A", "B"):
        docs += [
            documents.navigation(imu, mode, r, 3.0 + k, 4.0)
            for k in range(9)
            for mode in ("partial", "full")
            for r in RATES
        ]
    assert len(docs) >= MANY_RESULTS
    html = as_html(gather(documents.write(tmp_path, *docs), "t"))
    assert html.count('<svg class="plot"') == 1
    assert "Horizontal position RMS against the table rate: A, B" in html
    assert "2 further figures are not in this page" in html
    few = as_html(gather(documents.write(tmp_path, *docs[:60]), "t"))
    assert "A: RMS errors against the table rate" in few
