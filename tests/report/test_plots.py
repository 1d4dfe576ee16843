import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from rotcli.errors import ResultError
from rotcli.files.figures import (
    arranged,
    figure_bytes,
    legend_above,
    save_figure,
    use_style,
)
from rotcli.navigate.plot import ERROR_COLUMNS, navigation_errors
from rotcli.navigate.solution import read_solution
from rotcli.report.plots_campaign import allan_figures, calibration_figures, navigation_figures


@pytest.fixture(scope="module")
def solution():
    time = np.linspace(1e9, 1e9 + 300.0, 500)
    columns = {name: np.sin(k * time / 50.0) for k, name in enumerate(ERROR_COLUMNS)}
    return {**columns, "time [s]": time}


@pytest.fixture(scope="module")
def figure(solution):
    return navigation_errors(solution, "NAV440, $full$")


def lines(axes):
    return {line.get_label(): line for line in axes.get_lines() if line.get_label()[0] != "_"}


def test_the_panels_show_the_columns_named_with_units_height_apart(figure, solution):
    attitude, velocity, position, height = figure.axes
    assert [panel.get_ylabel() for panel in figure.axes] == [
        "attitude error, deg",
        "velocity error, m/s",
        "horizontal position\nerror, m",
        "height error, m",
    ]
    assert list(lines(attitude)) == ["pitch", "roll", "azimuth"]
    assert np.array_equal(lines(attitude)["roll"].get_ydata(), solution["err_roll [deg]"])
    assert np.array_equal(lines(velocity)["north"].get_ydata(), solution["err_v_north [m/s]"])
    assert list(lines(position)) == ["north", "east"]
    assert np.array_equal(lines(height)["up"].get_ydata(), solution["err_up [m]"])
    assert height.get_xlabel().endswith(", s")
    assert lines(height)["up"].get_xdata()[[0, -1]].tolist() == [0.0, 300.0]


@pytest.fixture
def paper():
    use_style("paper")
    yield
    use_style("screen")


@pytest.mark.usefixtures("paper")
def test_a_figure_for_a_paper_has_the_width_of_a_column_no_title_and_text_as_text(solution):
    figure = navigation_errors(solution, "NAV440, full", "run/imu.csv, 0 to 300 s")
    assert figure.get_size_inches()[0] == 3.5
    svg = figure_bytes(figure, "svg").decode()
    assert "NAV440" not in svg
    assert "run/imu.csv" not in svg
    assert ">azimuth</text>" in svg
    pdf = figure_bytes(figure, "pdf")
    assert b"/FontFile2" in pdf  # TrueType: letters that can be selected and searched
    assert b"/Type3" not in pdf


def test_a_figure_for_a_screen_names_its_subject_and_log(solution):
    svg = figure_bytes(navigation_errors(solution, "NAV440, full", "run/imu.csv"), "svg").decode()
    assert ">NAV440, full</text>" in svg
    assert ">run/imu.csv</text>" in svg


@pytest.mark.usefixtures("paper")
def test_a_legend_that_is_too_wide_gets_fewer_columns(solution):
    figure = navigation_errors(solution, "")
    axes = figure.axes[0]
    for k, line in enumerate(lines(axes).values()):
        line.set_label(f"a rather long name of line {k}")
    legend_above(axes, 3)
    assert axes.get_legend().get_window_extent().width > figure.bbox.width
    arranged(figure)
    box = axes.get_legend().get_window_extent()
    assert box.x1 <= figure.bbox.x1 + 1.0


def test_lines_differ_in_grey_by_their_dashes(figure):
    for panel in figure.axes:
        styles = [line.get_linestyle() for line in lines(panel).values()]
        assert len(set(styles)) == len(styles)


def test_legends_cover_no_data(figure):
    figure.canvas.draw()
    for panel in arranged(figure).axes:
        legend = panel.get_legend().get_window_extent()
        assert legend.y0 >= panel.get_window_extent().y1 - 1.0  # a pixel
        assert legend.x1 <= figure.bbox.x1


@pytest.mark.parametrize(
    ("name", "start"), [("a.png", b"\x89PNG"), ("a.SVG", b"<?xml"), ("a.pdf", b"%PDF")]
)
def test_the_suffix_says_the_format_and_the_bytes_are_the_same_twice(
    solution, tmp_path, name, start
):
    few = {column: values[:50] for column, values in solution.items()}
    written = []
    for _ in range(2):
        save_figure(navigation_errors(few, "t"), str(tmp_path / name))
        written.append((tmp_path / name).read_bytes())
    assert written[0].startswith(start)
    assert written[0] == written[1]
    assert b"Date" not in written[0]
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_an_unknown_suffix_names_the_known_ones_and_leaves_nothing(figure, tmp_path):
    with pytest.raises(ResultError, match=r"a\.bmp: .*'\.bmp'; name it \.png, \.svg or \.pdf"):
        save_figure(figure, str(tmp_path / "a.bmp"))
    with pytest.raises(ResultError, match=r"cannot be written: No such file"):
        save_figure(figure, str(tmp_path / "none" / "a.png"))
    assert list(tmp_path.iterdir()) == []


def test_the_users_matplotlib_settings_do_not_matter(solution):
    import matplotlib

    before = figure_bytes(navigation_errors(solution, "t"), "svg")
    with matplotlib.rc_context({"font.size": 20.0, "lines.linewidth": 9.0, "axes.grid": False}):
        assert figure_bytes(navigation_errors(solution, "t"), "svg") == before


def test_names_in_other_scripts_and_with_signs_are_drawn_without_a_warning(solution):
    svg = figure_bytes(navigation_errors(solution, "惯导 $a_b$ \\frac{<&>}"), "svg")
    assert ET.fromstring(svg).tag.endswith("svg")


def test_rms_against_rate_shows_both_modes_and_the_conventional_level(documents):
    docs = [doc for doc in documents.small_campaign() if doc["kind"] == "navigation"]
    docs.append(documents.navigation("NAV440", "full", 10.0, 0.0, 350.0))
    sources = documents.sources(*docs)
    assert [title for title, _ in navigation_figures(sources)] == [
        "NAV440: RMS errors against the table rate"
    ]
    drawn = [(title, draw()) for title, draw in navigation_figures(sources, published=True)]
    (title, figure), *kinds = drawn
    assert title == "NAV440: RMS errors against the table rate"
    assert [title for title, _ in kinds] == [
        f"NAV440: RMS errors of {kind} against the table rate"
        for kind in ("position", "velocity", "attitude")
    ]
    labels = [[panel.get_ylabel() for panel in figure.axes] for _, figure in kinds]
    assert labels == [
        ["latitude, m", "longitude, m", "height, m"],
        ["v north, m/s", "v east, m/s", "v up, m/s"],
        ["pitch, deg", "roll, deg", "azimuth, deg"],
    ]
    # 3-4-5: 300 m and 400 m partial, 150 m and 200 m full.
    east = {
        bar.get_label(): bar for bar in kinds[0][1].axes[1].containers if hasattr(bar, "patches")
    }
    assert [bar.get_height() for bar in east["partial"]] == [400.0] * 3
    position = figure.axes[0]
    level = lines(position)["conventional: mean"]
    assert set(level.get_ydata()) == {1000.0}
    bars = {bar.get_label(): bar for bar in position.containers if hasattr(bar, "patches")}
    heights = {name: [bar.get_height() for bar in bars[name]] for name in ("partial", "full")}
    assert heights == {"partial": [500.0, 500.0, 500.0], "full": [300.0, 250.0, 250.0]}
    assert [tick.get_text() for tick in figure.axes[-1].get_xticklabels()] == ["10", "20", "30"]
    low, high = bars["full"].errorbar.lines[2][0].get_segments()[0][:, 1]
    assert (low, high) == (250.0, 350.0)
    assert bars["partial"][0].get_hatch() != bars["full"][0].get_hatch()
    assert position.get_ylim()[0] == 0.0


def test_calibration_against_rate_shows_deviations_with_one_sigma_bars(documents):
    docs = [documents.calibration("B", rate, shift=rate) for rate in (10.0, 30.0)]
    ((_, draw),) = calibration_figures(documents.sources(*docs))
    figure = draw()
    biases, column = figure.axes
    first = biases.containers[0]
    assert first.get_label() == "bias_x, mean 20.0 deg/h"
    assert first.lines[0].get_ydata().tolist() == [-10.0, 10.0]
    segments = first.lines[2][0].get_segments()
    assert segments[0][:, 1].tolist() == [-12.0, -8.0]
    assert [bar.get_label().split(",")[0] for bar in column.containers] == ["Kgxz", "Kgyz", "Kgz"]


def test_one_rate_alone_has_no_figure_against_rate(documents):
    docs = [documents.navigation("B", "full", 10.0, 3.0, 4.0)]
    assert navigation_figures(documents.sources(*docs)) == []
    assert calibration_figures(documents.sources(documents.calibration("B", 10.0))) == []


def test_allan_curves_have_a_panel_for_each_sensor_and_its_unit(documents):
    ((_, draw),) = allan_figures(documents.sources(documents.allan("B")))
    figure = draw()
    gyro, accel = figure.axes
    assert (gyro.get_ylabel(), accel.get_ylabel()) == (
        "gyro deviation, deg/h",
        "accel deviation, m/s^2",
    )
    assert (gyro.get_xscale(), gyro.get_yscale()) == ("log", "log")
    assert lines(gyro)["gyro_y"].get_ydata().tolist() == [10.0, 3.0, 1.0]
    assert len(gyro.collections) == 3
    assert figure_bytes(figure, "svg")


def test_a_solution_comes_back_and_another_file_is_refused(solution, tmp_path):
    from rotcli.files.columns import write_columns

    for name in ("a.parquet", "a.csv"):
        write_columns(tmp_path / name, solution)
        back = read_solution(str(tmp_path / name))
        assert all(np.array_equal(back[column], solution[column]) for column in ERROR_COLUMNS)
    write_columns(tmp_path / "b.csv", {"time [s]": solution["time [s]"]})
    with pytest.raises(ResultError, match=r"b\.csv: not a solution .*: no column err_pitch \[deg"):
        read_solution(str(tmp_path / "b.csv"))
    (tmp_path / "c.parquet").write_text("rubbish")
    with pytest.raises(ResultError, match=r"c\.parquet: not a solution file"):
        read_solution(str(tmp_path / "c.parquet"))
    with pytest.raises(ResultError, match=r"none\.csv: cannot be read"):
        read_solution(str(tmp_path / "none.csv"))


def test_importing_the_figures_loads_no_matplotlib_and_drawing_no_pyplot(tmp_path):
    program = (
        "import sys, numpy as np\n"
        "import rotcli.report.plots_campaign\n"
        "from rotcli.files.figures import save_figure\n"
        "from rotcli.navigate.plot import ERROR_COLUMNS, navigation_errors\n"
        "assert 'matplotlib' not in sys.modules\n"
        "columns = {name: np.arange(5.0) for name in ERROR_COLUMNS}\n"
        f"save_figure(navigation_errors(columns, 't'), {str(tmp_path / 'a.png')!r})\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", program], cwd=root, check=False)
    assert done.returncode == 0
