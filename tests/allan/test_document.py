import json
import math
import tomllib

import numpy as np
import pytest

from rotcli.allan.document import KIND, coefficient_units, fields
from rotcli.allan.estimate import AllanResult, allan
from rotcli.allan.plot import allan_figure, plot
from rotcli.allan.rig_file import rig_figures, write_to_rig
from rotcli.allan.tables import curve_table, noise_table
from rotcli.errors import ResultError, RigError
from rotcli.files.results.documents import document, read_result, write_result
from rotcli.files.tables.text import to_text
from rotcli.logs.record import ImuLog
from rotcli.models.sensors import NoiseFigures, noise
from rotcli.rig.rig import read_rig
from rotcli.units import DEG_PER_HOUR, DEG_PER_ROOT_HOUR

GYRO = NoiseFigures(white=0.4 * DEG_PER_ROOT_HOUR, markov_sigma=24 * DEG_PER_HOUR, markov_time=60.0)
ACCEL = NoiseFigures(white=0.002, bias_instability=2e-3)
# What a figure takes from the document for its names.
DOC = {
    "rig": {"imu": {"name": "NAV440"}},
    "inputs": [{"path": "still/imu.csv"}],
    "window": {"start_s": 0.0, "end_s": 60.0},
}


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    n, interval = 36_000, 0.2
    columns = [
        noise(np.random.default_rng(k), n, interval, GYRO if k < 3 else ACCEL) for k in range(6)
    ]
    values = np.array(columns)
    path = tmp_path_factory.mktemp("allan") / "imu.csv"
    path.write_text("is in for the log\n")
    return ImuLog(
        path=str(path),
        time=interval * np.arange(n),
        gyro=values[:3].T,
        accel=values[3:].T,
        interval=interval,
        rows=n,
    )


@pytest.fixture(scope="module")
def result(log) -> AllanResult:
    return allan(log)


@pytest.fixture(scope="module")
def doc(log, result):
    return json.loads(json.dumps(document(KIND, [log], {}, fields(result)), allow_nan=False))


def test_the_document_has_the_fields_of_the_contract(doc):
    assert doc["kind"] == "allan"
    assert list(doc["axes"]) == ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    axis = doc["axes"]["gyro_x"]
    k = len(axis["tau_s"])
    assert all(len(axis[name]) == k for name in ("deviation", "lower", "upper"))
    assert axis["unit"] == "deg/h"
    assert list(axis["coefficients"]) == [
        "quantization",
        "random_walk",
        "bias_instability",
        "rate_random_walk",
        "rate_ramp",
    ]
    assert {"tau_s", "deviation"} <= set(axis["minimum"])
    assert {"sigma", "correlation_time_s"} <= set(axis["gauss_markov"])
    assert doc["warnings"] == []


def test_values_carry_the_datasheets_unit_with_si_next_to_it(doc, result):
    found = doc["axes"]["gyro_x"]["coefficients"]["random_walk"]
    assert found["unit"] == "deg/sqrt(h)"
    assert found["value"] == pytest.approx(0.4, abs=5 * found["sigma"])
    assert found["si"]["unit"] == "rad/s/sqrt(Hz)"
    # 1 deg/sqrt(h) is pi/180/60 rad/s/sqrt(Hz).
    assert found["si"]["value"] == pytest.approx(found["value"] * math.pi / 180 / 60, rel=1e-12)
    accel = doc["axes"]["accel_z"]
    assert accel["unit"] == "ug"
    si = result.axes["accel_z"].deviation
    assert np.allclose(np.array(accel["deviation"]) * 9.80665e-6, si, rtol=1e-12)
    # 1 m/s/sqrt(h) is 1/60 m/s^2/sqrt(Hz): a velocity per root second is a density per root hertz.
    walk = accel["coefficients"]["random_walk"]
    assert walk["si"]["value"] == pytest.approx(walk["value"] / 60, rel=1e-12)


def test_the_units_of_the_other_coefficients_are_the_published_ones():
    gyro = coefficient_units("gyro_x")
    assert gyro["quantization"][:2] == ("arcsec", pytest.approx(math.pi / 648_000))
    assert gyro["rate_random_walk"][:2] == ("deg/h/sqrt(s)", pytest.approx(math.pi / 648_000))
    assert gyro["rate_ramp"][1] == pytest.approx(math.pi / 648_000 / 3600)


def test_an_accelerometers_coefficients_are_in_micro_g():
    ug = 9.80665e-6  # m/s^2, of the standard gravity
    size = {name: figures[1] for name, figures in coefficient_units("accel_x").items()}
    assert size["bias_instability"] == pytest.approx(ug)
    assert size["rate_random_walk"] == pytest.approx(ug)  # per sqrt(s)
    assert size["rate_ramp"] == pytest.approx(ug / 3600.0)  # per h
    assert size["random_walk"] == pytest.approx(1.0 / 60.0)  # m/s per sqrt(h)
    assert size["quantization"] == 1.0


def test_what_is_not_significant_is_null_with_a_reason(doc):
    found = doc["axes"]["gyro_x"]["coefficients"]["quantization"]
    assert found["value"] is None
    assert found["sigma"] is None
    assert found["si"]["value"] is None
    assert found["upper"] > 0
    assert found["reason"] == "not significant in a record of 7200 s"


def test_the_gauss_markov_figures_are_quantities(doc):
    found = doc["axes"]["gyro_y"]["gauss_markov"]
    assert found["sigma"]["unit"] == "deg/h"
    assert found["sigma"]["value"] == pytest.approx(24.0, abs=5 * found["sigma"]["sigma"])
    low, high = found["correlation_time_limits_s"]
    assert low < found["correlation_time_s"] < high
    assert found["reason"] is None
    refused = doc["axes"]["accel_x"]["gauss_markov"]
    assert refused["sigma"] is None
    assert refused["correlation_time_s"] is None
    assert "no exponential part" in refused["reason"]


def test_the_document_is_written_and_read_back(doc, tmp_path):
    path = str(tmp_path / "allan.json")
    write_result(path, doc)
    assert read_result(path, KIND) == doc


def test_the_table_names_every_figure_with_its_unit(doc):
    text = to_text(noise_table(doc), 200) + to_text(curve_table(doc), 120)
    assert "gyro_x   N random walk" in text
    assert "deg/sqrt(h)" in text
    assert "not significant" in text
    assert "correlation time" in text
    assert "gyro_z [deg/h]" in text
    assert len(text.splitlines()) == 6 * 7 + 4 + 3 + len(curve_table(doc).rows)


RIG = """# my rig
[site]
latitude = 51.08   # deg

[imu]
name = "mine"      # the blue one
angle_random_walk = 99.0   # from the datasheet
bias_instability = 7.0     # deg/h, kept

[table]
axis = "z"
"""


def test_the_rig_gets_the_figures_and_keeps_its_comments(result, tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(RIG)
    written = write_to_rig(str(path), result)
    text = path.read_text()
    for kept in (
        "# my rig",
        "latitude = 51.08   # deg",
        "# the blue one",
        "# from the datasheet",
        "bias_instability = 7.0     # deg/h, kept",
    ):
        assert kept in text
    assert "gauss_markov_gyro_sigma" in written
    assert text.index("gauss_markov_gyro_sigma") < text.index("[table]")
    imu = read_rig(path).imu
    walks = imu.figure("angle_random_walk")
    truth = [result.axes[f"gyro_{a}"].fit.coefficients["random_walk"].value for a in "xyz"]
    # Four digits are written.
    assert np.allclose(walks, truth, rtol=1e-3)
    times = [result.axes[f"gyro_{a}"].gauss_markov.time for a in "xyz"]
    assert np.allclose(imu.figure("gauss_markov_gyro_time"), times, rtol=1e-3)
    assert imu.gauss_markov_accel_sigma is None


def test_writing_the_rig_twice_changes_nothing(result, tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(RIG)
    write_to_rig(str(path), result)
    first = path.read_bytes()
    write_to_rig(str(path), result)
    assert path.read_bytes() == first


def test_a_rig_that_is_not_there_is_made(result, tmp_path):
    path = tmp_path / "new.toml"
    write_to_rig(str(path), result)
    assert read_rig(path).imu.velocity_random_walk is not None


def test_some_axes_give_their_root_mean_square_as_one_number(log):
    figures = rig_figures(allan(log, axes=["gyro_x", "gyro_y"]))
    assert isinstance(figures["angle_random_walk"], float)
    assert figures["angle_random_walk"] == pytest.approx(0.4, rel=0.1)
    assert "velocity_random_walk" not in figures


def test_a_rig_that_cannot_hold_the_figures_stays_as_it_was(result, tmp_path):
    path = tmp_path / "rig.toml"
    for text, message in (
        ("[imu\n", "rig.toml: not TOML"),
        ("imu = 3\n", "rig.toml: imu: 3 is not a table"),
        ("[imu]\nnoise = 3\n", "rig.toml: imu.noise|rig.toml:.*noise"),
    ):
        path.write_text(text)
        with pytest.raises(RigError, match=message):
            write_to_rig(str(path), result)
        assert path.read_text() == text
        assert [p.name for p in tmp_path.iterdir()] == ["rig.toml"]
    with pytest.raises(RigError, match="cannot be written"):
        write_to_rig(str(tmp_path / "missing" / "rig.toml"), result)
    assert tomllib.loads(path.read_text()) == {"imu": {"noise": 3}}


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_the_same_result_draws_the_same_bytes(result, tmp_path, suffix):
    first, second = tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
    plot(result, str(first), DOC)
    plot(result, str(second), DOC)
    assert first.read_bytes() == second.read_bytes()
    assert len(first.read_bytes()) > 10_000


def test_the_figure_names_units_axes_and_minima(result):
    figure = allan_figure(result, DOC)
    gyro, accel = figure.axes
    assert figure.get_suptitle() == "NAV440, overlapping Allan deviation"
    assert figure.get_supxlabel() == "still/imu.csv, 0 to 60 s"
    assert (gyro.get_ylabel(), accel.get_ylabel()) == (
        "gyro deviation, deg/h",
        "accel deviation, ug",
    )
    assert accel.get_xlabel().startswith("cluster time, s")
    labels = [text.get_text() for text in accel.get_legend().get_texts()]
    assert any(label.startswith("accel_z, minimum at ") for label in labels)
    figure.canvas.draw()
    for panel in (gyro, accel):  # the legends are above their panels
        assert panel.get_legend().get_window_extent().y0 >= panel.get_window_extent().y1 - 1.0


def test_one_panel_is_drawn_for_gyros_alone(log, tmp_path):
    path = tmp_path / "g.png"
    plot(allan(log, axes=["gyro_x"], estimator="mdev"), str(path), DOC)
    assert path.stat().st_size > 5000


def test_a_plot_elsewhere_or_of_another_kind_is_refused(result, tmp_path):
    with pytest.raises(
        ResultError, match=r"a\.gif: unknown kind of picture '\.gif'; name it \.png"
    ):
        plot(result, str(tmp_path / "a.gif"), DOC)
    with pytest.raises(ResultError, match="cannot be written"):
        plot(result, str(tmp_path / "missing" / "a.png"), DOC)
