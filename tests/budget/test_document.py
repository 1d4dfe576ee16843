"""The error budget as a document, as tables and as advice."""

import io
import json
import math

import numpy as np
import pandas as pd
import pytest

from rotcli.budget import document as results
from rotcli.budget.advice import recommendation
from rotcli.budget.estimate import budget
from rotcli.budget.plot import budget_figure, budget_figures
from rotcli.budget.plot_within import within_figure
from rotcli.budget.within import contradiction
from rotcli.cli.main import main
from rotcli.errors import ResultError
from rotcli.files.figures import figure_bytes
from rotcli.files.results.documents import document
from rotcli.files.results.groups import Source
from rotcli.files.tables.tidy import COLUMNS
from rotcli.files.tables.writers import WRITERS
from rotcli.models.base import FixedBase
from rotcli.models.sensors import NoiseFigures, TriadErrors
from rotcli.report.kinds import KINDS
from rotcli.report.report import Section
from rotcli.rig.profile import read_profile

DEG = np.pi / 180
PPM = 1e-6
LEVEL = FixedBase(51.08 * DEG, 9.81, np.eye(3))


def made(gyro=None, accel=(0.0, 0.0, 0.0), noise=None, base=LEVEL, **given):
    given = {"rate": 10 * DEG, **given}
    return budget(gyro or TriadErrors(), np.array(accel), noise or NoiseFigures(), base, **given)


def doc_of(result):
    return document("budget", [], {}, {**results.fields(result), "warnings": []})


@pytest.fixture(scope="module")
def by_hand():
    """A case for pencil and paper: 30 deg N, 10 deg/s (36 s a turn), round figures."""
    N = PPM * np.array([[1000.0, 100.0, 300.0], [-100.0, 2000.0, 500.0], [-200.0, 100.0, 3000.0]])
    d = np.array([10.0, 20.0, 30.0]) * DEG / 3600
    noise = NoiseFigures(white=0.3 * DEG / 60, rate_random_walk=0.36 * DEG / 3600)
    base = FixedBase(30 * DEG, 9.8, np.eye(3))
    return doc_of(made(TriadErrors(N, d), (0.01, 0.02, 0.03), noise, base, duration=100.0))


# Earth rate 7.292115e-5 rad/s = 4.178075e-3 deg/s: north (cos 30) 3.618319e-3, up 2.089037e-3.
# b T = 0.01 x 36; d T = 10/3600 x 36; x: 36 x 1e-3 x 10, 18 x (2e-3 + 3e-3) x 3.618319e-3 ...;
# installation, x: 18 x (500 - 100)e-6 x 2.089037e-3, 18 x (100 - 500)e-6 x 3.618319e-3; ...
BY_HAND = """\
x,accelerometer bias,velocity,m/s,0.36,0,0
x,gyro bias,attitude,deg,0.1,0,0
x,gyro scale factor,attitude,deg,0.36,0.0003256,0.000188
x,gyro installation,attitude,deg,0,1.504e-05,-2.605e-05
y,accelerometer bias,velocity,m/s,0,0.72,0
y,gyro bias,attitude,deg,0,0.2,0
y,gyro scale factor,attitude,deg,0,0.7203,0.0001504
y,gyro installation,attitude,deg,1.88e-05,0,0
z,accelerometer bias,velocity,m/s,0,0,1.08
z,gyro bias,attitude,deg,0,0,0.3
z,gyro scale factor,attitude,deg,0,0.0001954,1.08
z,gyro installation,attitude,deg,1.303e-05,0,0
"""


def test_one_turn_is_the_table_computed_by_hand_in_formula_and_integral(by_hand):
    table = results.tables(by_hand)[0]
    assert table.title == "Error after one turn at 10 deg/s (36 s)"
    assert [",".join(row[:7]) for row in table.shown] == BY_HAND.splitlines()
    assert [row[7:] for row in table.shown] == [row[4:7] for row in table.shown]


def test_growth_and_calibration_are_those_computed_by_hand(by_hand):
    _, _, growth, calibration = results.tables(by_hand)
    rows = {(row[0], row[1]): row for row in growth.shown}
    # d t = 10/3600 x 100 deg = 0.004848 mrad: g d t^2/2, g d t^3/6 with d = 4.848e-5 rad/s.
    assert rows["x", "gyro bias"][2:7] == ["0.2778", "0", "2.376", "79.19", "0"]
    assert rows["z", "accelerometer bias"][2:7] == ["0", "0", "0", "0", "150"]
    # 0.3 deg/sqrt(h) = 18 deg/h sqrt(s): 18 / sqrt(30) = 3.29; / 10 deg/s = 91.3 ppm;
    # with 0.36^2 x 30 / 3: 3.478. Best: sqrt(3) x 18 / 0.36 = 86.6 s.
    shown = {row[0]: row[1:] for row in calibration.shown}
    # What calibrate prints: still [0, 30], turning [34, 64], bias of [64, 364] s. White noise and
    # the walk between the means, 0.36^2 (30/3 + 34 + 300/3): sqrt(10.8 + 18.66) = 5.43; column:
    # sqrt(2 x 10.8 + 0.36^2 (30/3 + 4 + 30/3)) = 4.971 deg/h, over 10 deg/s 138.08 ppm.
    assert shown["30"] == ["5.43", "3.48", "3.29", "138.08", "96.61", "91.29"]
    assert "86.6" in shown
    assert calibration.note.startswith("Best: 86.6 s; beyond it, rate random walk")


def test_the_document_is_plain_json_and_names_every_unit(by_hand):
    assert json.loads(json.dumps(by_hand, allow_nan=False)) == by_hand
    assert list(by_hand["axes"]) == ["x", "y", "z"]
    z = by_hand["axes"]["z"]["gyro_bias"]
    assert z["error"] == "attitude"
    assert z["closed_form"]["up_deg"] == pytest.approx(0.3, rel=1e-12)
    assert z["integrated"]["up_deg"] == pytest.approx(0.3, rel=1e-12)
    assert by_hand["parameters"]["Kgxz"] == {
        "value": pytest.approx(300.0),
        "sigma": None,
        "unit": "ppm",
    }
    assert list(by_hand["growth"]) == ["x", "y", "z", "still"]
    assert by_hand["calibration"]["best"]["time_s"] == pytest.approx(86.6025, rel=1e-5)


@pytest.mark.parametrize(
    ("noise", "note"),
    [
        (NoiseFigures(white=1e-4, bias_instability=1e-5), "equals the floor"),
        (NoiseFigures(white=1e-4), "No best time"),
    ],
)
def test_the_calibration_table_says_what_bounds_the_time(noise, note):
    assert note in results.tables(doc_of(made(noise=noise)))[-1].note


def test_without_noise_there_is_no_calibration_table():
    assert len(results.tables(doc_of(made(accel=(0.01, 0.0, 0.0))))) == 3


def test_what_rounding_leaves_is_shown_as_nothing():
    profile = read_profile("mti-g")
    doc = doc_of(made(TriadErrors(profile.gyro.matrix, profile.gyro.bias), profile.accel.bias))
    assert "e-1" not in WRITERS[".txt"](results.tables(doc))


def test_tables_become_markdown_latex_and_csv(by_hand):
    tables = results.tables(by_hand)
    markdown, latex = (WRITERS[suffix](tables) for suffix in (".md", ".tex"))
    assert "| x | accelerometer bias | velocity | m/s | 0.36 |" in markdown
    assert latex.count(r"\begin{tabular}") == latex.count(r"\end{tabular}") == 4
    body = latex[latex.index(r"\midrule") : latex.index(r"\bottomrule")]
    assert {line.count("&") for line in body.splitlines()[1:-1]} == {9}
    frame = pd.read_csv(io.StringIO(WRITERS[".csv"](tables)))
    assert list(frame.columns) == list(COLUMNS)
    assert frame["table"].nunique() == len(tables)
    assert set(frame["unit of measure"].dropna()) >= {"m", "m/s", "deg"}


def test_the_errors_within_the_turn_are_drawn_and_the_contradiction_is_computed():
    d = np.array([120.0, 0.0, 0.0]) * DEG / 3600
    result = made(TriadErrors(bias=d), axes=("x", "z"))
    doc = document("budget", [], {}, {**results.fields(result, within_turn=True), "warnings": []})
    assert json.loads(json.dumps(doc, allow_nan=False)) == doc
    entry = doc["within_turn"]["z"]["gyro_bias"]
    assert entry["angle_deg"] == pytest.approx(np.arange(0.0, 361.0, 5.0))
    # d cos, d sin (R16 (22) to (24), right-handed).
    assert entry["error"]["east"][12] == pytest.approx(60.0)
    assert entry["error"]["north"][6] == pytest.approx(60.0)
    # The tilt of a modulated bias goes around its mean d / w: 2 d / w after half a turn.
    tilt = entry["attitude_deg"]
    across = np.hypot(tilt["east"][36], tilt["north"][36])
    assert across * DEG == pytest.approx(2.0 * 120.0 / 3600.0 / 10.0, rel=0.01)
    sensors, navigation = results.tables(doc)[1:3]
    assert len(sensors.rows) == len(navigation.rows) == 2 * 4 * 9
    # About x the bias is along the axis: nothing of it is modulated, so nothing contradicts.
    assert "contradicted: 1.18 m/s about z remain" in navigation.note
    figure = within_figure(doc)
    assert len(figure.axes) == 6 * 2
    last = figure.axes[-1].get_lines()[0]
    assert last.get_ydata()[-1] == entry["velocity_mps"]["east"][-1]
    drawn = [figure_bytes(within_figure(doc), "svg") for _ in range(2)]
    assert drawn[0] == drawn[1]
    titles = [title for title, _ in budget_figures([Source("b.json", doc)])]
    assert titles == ["b.json: error budget", "b.json: errors within one turn"]


def test_a_broken_budget_file_is_refused(by_hand):
    broken = {**by_hand, "axes": {"x": {"gyro_bias": {}}}}
    with pytest.raises(ResultError, match=r"b\.json: incomplete budget: .*create it again"):
        results.budget_tables([Source("b.json", broken)])


@pytest.mark.parametrize("name", ["mti-g", "nav440"])
@pytest.mark.parametrize("rate", [10.0, 100.0])
def test_turning_about_z_is_recommended_for_the_papers_sensors(name, rate):
    # R16 section 2.2: rotation about the vertical.
    profile = read_profile(name)
    gyro = TriadErrors(profile.gyro.matrix, profile.gyro.bias)
    found = recommendation(made(gyro, profile.accel.bias, rate=rate * DEG))
    assert found.startswith(f"Recommended axis: z at {rate:g} deg/s. Horizontal position error")
    assert "\n" not in found
    assert found.endswith(" deg.")


def test_the_recommendation_is_computed_from_the_numbers():
    # 0.01 m/s^2 east stays about x and without rotation, b t^2 / 2 = 58.3 m in 108 s, and becomes a
    # mean velocity of b / w = 0.0573 m/s northwards about z: 6.19 m in three full turns
    # (0.2 % less for the Earth turns).
    found = recommendation(made(accel=(0.01, 0.0, 0.0), duration=108.0, axes=("x", "z")))
    assert found.startswith(
        "Recommended axis: z at 10 deg/s. Horizontal position error after 108 s: 6.17 m "
        "(x: 58.2 m, no rotation: 58.2 m). Height error "
    ), found


def test_axes_that_do_equally_well_are_named_together():
    # On the pole x and y are alike in everything.
    pole = FixedBase(np.pi / 2 - 1e-9, 9.8, np.eye(3))
    found = recommendation(made(TriadErrors(np.diag([1e-3, 1e-3, 0.0])), base=pole))
    assert found.startswith("Recommended axis: z at 10 deg/s.")
    alike = recommendation(
        made(TriadErrors(np.diag([1e-3, 1e-3, 0.0])), base=pole, axes=("x", "y"))
    )
    assert alike.startswith("Recommended axis: x or y at 10 deg/s.")


def test_a_rotation_that_makes_it_worse_is_reported():
    # A scale factor alone: rotation excites it.
    found = recommendation(made(TriadErrors(np.diag([1e-3, 0.0, 0.0])), axes=("x",)))
    assert found.startswith("Recommended axis: x at 10 deg/s.")
    assert found.endswith(" No rotation is better: there is little bias to modulate.")


def test_no_horizontal_error_makes_no_axis_better():
    assert recommendation(made()) == (
        "None of these sensor errors makes a horizontal position error: no axis is better."
    )


def test_the_figure_shows_every_axis_and_source_and_the_best_time(rotcli_budget):
    figure = budget_figure(rotcli_budget)
    growth, _over_time, _over_rate, calibration = figure.axes
    assert [tick.get_text() for tick in growth.get_xticklabels()] == [
        "about x",
        "about y",
        "about z",
        "still",
    ]
    bars = {bar.get_label(): [patch.get_height() for patch in bar] for bar in growth.containers}
    assert list(bars) == [
        "accelerometer bias",
        "gyro bias",
        "gyro scale factor",
        "gyro installation",
    ]
    seen = rotcli_budget["growth"]["y"]["gyro_bias"]["navigated"]
    assert bars["gyro bias"][1] == pytest.approx(math.hypot(seen["east_m"], seen["north_m"]))
    assert len({patch[0].get_facecolor() for patch in growth.containers}) == 4
    line = next(line for line in calibration.get_lines() if line.get_label() == "all noise")
    times = rotcli_budget["calibration"]["times"]
    assert line.get_ydata()[0] == times[0]["bias_dph"]
    figure.canvas.draw()
    for panel in figure.axes:
        legend = panel.get_legend().get_window_extent()
        assert legend.y0 >= panel.get_window_extent().y1 - 1.0
        assert legend.x1 <= figure.bbox.x1
    drawn = [figure_bytes(budget_figure(rotcli_budget), "svg") for _ in range(2)]
    assert drawn[0] == drawn[1]


@pytest.fixture(scope="module")
def rotcli_budget(tmp_path_factory):
    path = tmp_path_factory.mktemp("budget") / "b.json"
    with pytest.raises(SystemExit) as stop:
        main(["budget", "--imu", "nav440", "--rate", "10", "-o", str(path), "--quiet"])
    assert stop.value.code == 0
    return json.loads(path.read_text())


def test_a_broken_budget_has_no_figure(rotcli_budget):
    broken = {**rotcli_budget, "growth": {}}
    section = Section(KINDS["budget"], (Source("b.json", broken),), ())
    ((_, draw),) = section.figures()
    with pytest.raises(ResultError, match=r"b\.json: not a valid Error budget result"):
        draw()


def test_the_unmodulated_part_of_a_bias_does_not_count_as_a_contradiction():
    # Half of g times the period times the tilt of the turn, in radians, plus 3 and 4 cm/s.
    half = 0.5 * 10.0 * 36.0 * DEG
    velocity = {"east": [0.0, half * 0.5 + 0.03], "north": [0.0, half * 0.25 + 0.04]}
    doc = {
        "gravity": {"value": 10.0},
        "period_s": 36.0,
        "within_turn": {"z": {"gyro_bias": {"velocity_mps": velocity}}},
        "axes": {"z": {"gyro_bias": {"closed_form": {"east_deg": -0.25, "north_deg": 0.5}}}},
    }
    assert "contradicted: 0.05 m/s about z remain" in contradiction(doc)
