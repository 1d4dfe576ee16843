"""Filter results next to the published tables, and their figures."""

import copy

import numpy as np
import pytest

from rotcli.errors import ResultError
from rotcli.files.results.documents import document
from rotcli.files.results.groups import Source
from rotcli.files.tables import Estimate
from rotcli.files.tables.latex import to_latex
from rotcli.files.tables.markup import to_markdown
from rotcli.files.tables.writers import csv_document
from rotcli.observe import published_o17
from rotcli.observe.document import KIND, fields, sweep_fields
from rotcli.observe.observability import TableMotion, analyse, sweep
from rotcli.observe.plot import GROUPS, estimates_figure, run_name, sweep_figure
from rotcli.units import DEG

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
NAMES = [f"{sensor}_bias_{axis}" for sensor in ("accel", "gyro") for axis in "xyz"]


def result(axis=None, pitch=0.0, offset=0.0):
    """A document as `observe` writes it, with made-up estimates 1, 2, ... plus an offset."""
    motion = TableMotion(AXES.get(axis), 10.0 * DEG if axis else 0.0, pitch=pitch * DEG)
    own = fields(analyse(motion))
    time = np.linspace(0.0, 30.0, 31)
    units = {"accel": "m/s^2", "gyro": "deg/h", "tilt": "deg", "azimuth": "deg"}
    history = {"time_s": time}
    for name in [*NAMES, "tilt_east", "tilt_north", "azimuth"]:
        unit = units[name.split("_")[0]]
        history[name] = {"unit": unit, "value": np.sin(time) + offset, "sigma": 1.0 / (1.0 + time)}
    for angle in ("pitch", "roll", "azimuth"):
        history[f"{angle}_error_deg"] = 0.1 * np.cos(time)
    own["filter"] = {
        "estimates": {
            name: {"value": k + 1.0 + offset, "sigma": 0.1, "unit": units[name.split("_")[0]]}
            for k, name in enumerate(NAMES)
        },
        "rms": {"roll_deg": 0.1, "pitch_deg": 0.2, "azimuth_deg": 0.3},
        "not_to_be_used": {"azimuth": "nothing shows it", "gyro_bias_z": "nothing shows it"},
        "consistency": {"nis_mean": 1.0, "nis_bounds": [2.9, 3.1], "verdict": "conservative"},
        "history": history,
    }
    return document(KIND, [], {}, {**own, "warnings": []})


def test_published_rows_are_beneath_the_runs_they_belong_to():
    docs = [result("z", 30.0), result(), result("y"), result("z"), result("y", 30.0), result("x")]
    made = published_o17.tables(docs)
    assert [table.title for table in made] == [
        "Rotation about y (O17 table 1)",
        "Rotation about z (O17 table 2)",
        "ZUPT filter estimates, other runs",
    ]
    about_y, about_z, other = made
    assert [row[:2] for row in about_y.rows] == [
        ("still", "rotcli"),
        ("still", "published"),
        ("about y, level", "rotcli"),
        ("pitch 0", "published"),
        ("about y, pitch 30", "rotcli"),
        ("pitch 30", "published"),
    ]
    # The paper's own digits: table 1, pitch 30; table 2, still.
    assert about_y.rows[5][2:11] == (
        *(0.08, 0.08, 2.02, -0.011, -0.007, 0.008, 777.1, -1804.9, 1096.7),
    )
    assert about_z.rows[1][4] == 59.7
    assert about_y.rows[0][2:5] == (0.1, 0.2, 0.3)
    assert about_y.rows[0][5:11] == tuple(Estimate(float(k), 0.1) for k in range(1, 7))
    assert about_y.rows[0][11] == "gyro z, azimuth"
    assert [row[0] for row in other.rows] == ["about x, level"]
    for text in (to_markdown(about_y), to_latex(about_y), csv_document(made)):
        assert "-1804.9" in text


def test_a_run_at_an_unpublished_attitude_is_alone():
    (table,) = published_o17.tables([result("y", 15.0)])
    assert [row[1] for row in table.rows] == ["rotcli"]
    (table,) = published_o17.tables([result()])
    assert table.title == "ZUPT filter estimates"


def test_reports_show_analyses_without_a_filter_too():
    doc = document(KIND, [], {}, {**fields(analyse(TableMotion())), "warnings": []})
    made = published_o17.observability_tables(
        [Source("a.json", doc), Source("b.json", result("y"))],
        published=True,
    )
    assert [t.title for t in made] == [
        "Rotation about y (O17 table 1)",
        "Observability, still, simplified model: rank 8 of 12",
    ]


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        (("rank",), "rank: None is not a number"),
        (("filter", "rms", "roll_deg"), "filter.rms.roll_deg: None is not a number"),
        (("filter", "history"), "history: missing"),
        (("weak",), "weak: missing"),
    ],
)
def test_a_damaged_result_is_named_with_what_it_lacks(keys, text):
    doc = copy.deepcopy(result("y"))
    place = doc
    for key in keys[:-1]:
        place = place[key]
    del place[keys[-1]]
    with pytest.raises(ResultError, match=f"broken.json: {text}"):
        published_o17.observability_tables([Source("broken.json", doc)])


def test_still_and_turning_runs_are_drawn_together():
    sources = [
        Source("a", result()),
        Source("b", result("y", 30.0, offset=2.0)),
        Source("c", result("z")),
    ]
    figures = published_o17.observability_figures(sources)
    assert [title for title, _ in figures] == [
        f"{group}, rotation about {axis}" for axis in "yz" for group in GROUPS
    ]
    axes = figures[1][1]().axes
    assert len(axes) == 3
    labels = [text.get_text() for text in axes[0].get_legend().get_texts()]
    assert labels == ["still, 3 sigma shaded", "about y, pitch 30, 3 sigma shaded"]
    still, turning = (line for line in axes[0].get_lines() if line.get_label()[0] != "_")
    np.testing.assert_allclose(turning.get_ydata() - still.get_ydata(), 2.0)
    low, high = axes[0].get_ylim()
    assert low < -1.0
    assert high > 3.0
    # The band is three sigma either side.
    band = axes[0].collections[1].get_paths()[0].vertices
    at_end = band[np.isclose(band[:, 0], 30.0), 1]
    assert np.ptp(at_end) == pytest.approx(6.0 / 31.0)


def test_the_complete_figure_has_nine_panels_and_errors_are_about_zero():
    figure = estimates_figure([result("y")])
    assert len(figure.axes) == 9
    assert figure.axes[0].get_ylabel() == "pitch error, deg"
    band = figure.axes[0].collections[0].get_paths()[0].vertices[:, 1]
    assert band.max() == pytest.approx(-band.min())


def test_a_sweep_is_drawn_with_its_weak_points():
    found = sweep(TableMotion(AXES["z"], 10.0 * DEG), "pitch", -4 * DEG, 4 * DEG, 1 * DEG)
    own = fields(analyse(TableMotion(AXES["z"], 10.0 * DEG)))
    own["sweep"] = sweep_fields(found, own["states"])
    doc = document(KIND, [], {}, {**own, "warnings": []})
    top, below = sweep_figure(doc).axes
    np.testing.assert_allclose(top.get_lines()[1].get_xdata(), [-2, -1, 1, 2])
    assert len(below.get_lines()) == 9
    ((title, _),) = published_o17.observability_figures([Source("a", doc)])
    assert title == "Observability along pitch"


def test_runs_are_named_by_axis_and_tilt():
    assert run_name(result()) == "still"
    assert run_name(result("z")) == "about z, level"
    assert run_name(result("y", 30.0)) == "about y, pitch 30"
