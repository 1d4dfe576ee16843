"""Several logs in one table and one figure, and the panels next to the Allan deviation."""

import json

import numpy as np
import pytest

from rotcli.allan.api import AllanOptions, allan_log, comparison_figure
from rotcli.allan.compare import labelled
from rotcli.allan.plot import allan_figure
from rotcli.files.published import published
from rotcli.files.tables.text import to_text
from rotcli.logs.record import ImuLog
from rotcli.models.sensors import NoiseFigures, noise
from rotcli.rig.rig import rig_from_dict
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR

INTERVAL = 0.1


def analysed(tmp_path, name, white, seed, **changes):
    folder = tmp_path / f"run{seed}"
    folder.mkdir()
    path = folder / "imu.csv"
    path.write_text("fingerprint")
    n = 12_000
    rng = np.random.default_rng(seed)
    figures = NoiseFigures(white=white * DEG_PER_ROOT_HOUR)
    gyro = np.stack([noise(rng, n, INTERVAL, figures) for _ in range(3)], axis=1)
    for axis, extra in changes.items():
        gyro[:, "xyz".index(axis)] += extra(INTERVAL * np.arange(n))
    log = ImuLog(
        path=str(path),
        time=INTERVAL * np.arange(n),
        gyro=gyro,
        accel=0.01 * rng.standard_normal((n, 3)) + [0.0, 0.0, 9.81],
        interval=INTERVAL,
    )
    rig = rig_from_dict({"imu": {"name": name}})
    return allan_log(log, rig, AllanOptions(axes=("gyro_x", "accel_z")))


def texts(figure):
    found = []
    for axes in figure.axes:
        legend = axes.get_legend()
        found += [text.get_text() for text in legend.get_texts()] if legend else []
    return found


def test_a_table_has_a_column_for_each_log(tmp_path):
    first = analysed(tmp_path, "MTi-G", 3.0, 1)
    second = analysed(tmp_path, "NAV440", 0.4, 2)
    (table,) = first.tables_of([first, second])
    assert table.headings[3:] == ["MTi-G", "NAV440"]
    row = next(r for r in table.rows if r[:2] == ("gyro_x", "N random walk"))
    for cell, result in zip(row[3:], (first, second), strict=True):
        value = result.document["axes"]["gyro_x"]["coefficients"]["random_walk"]["value"]
        assert cell.startswith(f"{value:.4g} +- ")
    flicker = next(r for r in table.rows if r[:2] == ("gyro_x", "B bias instability"))
    assert flicker[3].startswith("<")
    assert "not significant" in to_text(table)
    assert len(first.tables_of([first])) > 2


def test_logs_of_one_imu_are_labelled_by_their_path(tmp_path):
    first = analysed(tmp_path, "NAV440", 0.4, 1)
    second = analysed(tmp_path, "NAV440", 0.4, 2)
    labels = [log.label for log in labelled([(r.estimate, r.document) for r in (first, second)])]
    assert labels == ["1: NAV440, run1/imu.csv", "2: NAV440, run2/imu.csv"]


def test_one_figure_has_a_curve_for_each_log_and_the_published_marks(tmp_path):
    results = [analysed(tmp_path, "MTi-G", 3.0, 1), analysed(tmp_path, "nav 440", 0.4, 2)]
    figure = comparison_figure(results, marks=True)
    assert len(figure.axes) == 2
    legend = texts(figure)
    assert "R16 figure 6, MTi-G: 24 deg/h at 120 s" in legend
    assert "R16 figure 6, nav 440: 11 deg/h at 120 s" in legend
    marks = [line for line in figure.axes[0].lines if line.get_marker() == "x"]
    assert [(m.get_xdata()[0], m.get_ydata()[0]) for m in marks] == [(120.0, 24.0), (120.0, 11.0)]
    curve = results[0].document["axes"]["gyro_x"]["deviation"]
    assert any(
        len(line.get_ydata()) == len(curve) and np.allclose(line.get_ydata(), curve)
        for line in figure.axes[0].lines
    )
    plain = comparison_figure(results)
    assert not [text for text in texts(plain) if "R16" in text]


def test_the_published_lowest_deviations_are_those_of_figure_6():
    assert published("MTi-G").lowest == (120.0, 24.0)
    assert published("NAV440").lowest == (120.0, 11.0)


def test_the_density_panel_shows_the_line_and_2_n_squared(tmp_path):
    line = {"x": lambda time: 0.05 * DEG * np.sin(2 * np.pi * 1.25 * time)}
    result = analysed(tmp_path, "A", 0.3, 1, **line)
    figure = allan_figure(result.estimate, result.document, ("psd",))
    assert len(figure.axes) == 4
    (legend,) = [text for text in texts(figure) if "Hz" in text]
    frequency = float(legend.split(", ")[1].removesuffix(" Hz"))
    assert frequency == pytest.approx(1.25, abs=0.01)
    density = figure.axes[1]
    white = result.estimate.axes["gyro_x"].fit.coefficients["random_walk"].value
    levels = [line.get_ydata()[0] for line in density.lines if line.get_linestyle() == ":"]
    assert levels == pytest.approx([2.0 * (white / DEG) ** 2])
    curve = max(density.lines, key=lambda line: len(line.get_xdata()))
    beyond = curve.get_ydata()[curve.get_xdata() > 3.0]
    # 16 windows and 20 bins a point: 6 %; the mean of 13 points.
    assert np.mean(beyond) == pytest.approx(2.0 * (0.3 / 60.0) ** 2, rel=0.1)


def test_the_autocorrelation_panel_shows_the_fitted_exponential(tmp_path):
    def slow(time):
        figures = NoiseFigures(markov_sigma=60 * DEG_PER_HOUR, markov_time=15.0)
        return noise(np.random.default_rng(5), len(time), INTERVAL, figures)

    result = analysed(tmp_path, "A", 0.1, 1, x=slow)
    markov = result.estimate.axes["gyro_x"].gauss_markov
    figure = allan_figure(result.estimate, result.document, ("autocorrelation",))
    legend = texts(figure)
    assert f"gyro_x: {markov.sigma / DEG_PER_HOUR:.3g} deg/h, {markov.time:.3g} s" in legend
    assert "accel_z: no exponential" in legend
    points, expected = figure.axes[1].lines[:2]
    assert points.get_xdata()[0] == pytest.approx(1.0)
    first = points.get_ydata()[0], expected.get_ydata()[0]
    assert first[0] == pytest.approx(first[1], rel=0.2)


def test_a_document_with_all_fields_is_json(tmp_path):
    result = analysed(tmp_path, "A", 0.3, 1)
    again = json.loads(json.dumps(result.document))
    assert again["used"] == {
        "seconds": pytest.approx(1200.0),
        "percent": 100.0,
        "segments_s": [[0.0, pytest.approx(1199.9)]],
    }
    tau = again["axes"]["gyro_x"]["coefficients"]["random_walk"]["tau_s"]
    # White noise rests on short cluster times: from two to eight samples on.
    assert 0.2 <= tau[0] <= 0.8 < tau[1] < 20.0
