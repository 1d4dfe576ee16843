"""A plot says whose it is when it is found alone, and text of files stays text in it."""

import shutil

import pytest
from matplotlib.cbook import is_math_text
from matplotlib.text import Text

import rotcli as rotcli_api
from rotcli.files import figures as plots

ODD = "b_1$x_2$^{3}%\\frac.csv"


@pytest.fixture
def drawn(rotcli, monkeypatch, tmp_path):
    """Return a function that runs a command with --plot and returns title and source as shown."""
    figures = []
    original = plots.figure_bytes
    monkeypatch.setattr(
        plots, "figure_bytes", lambda f, kind: figures.append(f) or original(f, kind)
    )

    def run(*args):
        done = rotcli(*args, "--plot", tmp_path / "plot.png")
        assert done.status == 0, done.err
        assert (tmp_path / "plot.png").stat().st_size > 5000
        (figure,) = figures
        figures.clear()
        texts = [text.get_text() for text in figure.findobj(Text)]
        ticks = {t.get_text() for axes in figure.axes for t in axes.findobj(Text)}
        assert not [text for text in texts if text not in ticks and is_math_text(text)]
        shown = (figure.get_suptitle(), figure.get_supxlabel())
        return tuple(text.replace("\n", " ").replace(r"\$", "$") for text in shown)

    return run


@pytest.fixture
def odd(still):
    """The still log under a name that a formula or a shell would trip over."""
    return shutil.copy(still / "imu.csv", still / ODD)


def test_navigation_says_imu_mode_motion_and_log(drawn, turning):
    logs = (turning / "imu.parquet", turning / "table.parquet")
    title, source = drawn("navigate", *logs, "--mode", "conventional", "--static", "0:9")
    assert title == "NAV440, conventional, about z at 60 deg/s"
    assert source.endswith("turning/imu.parquet, 21 to 31 s")


def test_a_name_that_looks_like_a_formula_stays_as_it_is(drawn, odd, still):
    for command, title in (
        (("navigate", odd, "--static", "0:8"), "NAV440, conventional, still"),
        (("allan", odd), "NAV440, overlapping Allan deviation"),
        (("observe", odd), "NAV440, zupt filter estimates, still"),
    ):
        shown, source = drawn(*command)
        assert shown == title
        assert f"/{ODD}, " in source.replace(" /", "/")
        assert source.endswith(" s")


def test_an_imu_of_odd_name_is_drawn_letter_by_letter(drawn, still):
    rig = still / "rig.toml"
    rig.write_text(rig.read_text().replace('"NAV440"', "'$x$_\\y'"))
    assert drawn("allan", still / "imu.csv")[0] == "$x$_\\y, overlapping Allan deviation"


def test_what_has_no_log_says_what_it_is_about(drawn):
    title, source = drawn("observe", "--axis", "y", "--sweep", "rate", "1:9:4")
    assert (title, source) == ("Observability along rate, simplified model, about y", "")
    title, _ = drawn("observe", "--axis", "none", "--sweep", "pitch", "0:20:10")
    assert title == "Observability along pitch, simplified model, still"
    title, source = drawn("budget", "--imu", "nav440", "--rate", "20")
    assert (title, source) == ("NAV440, error budget at 20 deg/s", "sensor errors: nav440")


def test_a_line_feed_in_a_name_is_a_sign_that_is_not_printed():
    assert plots.plain("a\nb\x07$") == r"a?b?\$"


def test_the_residuals_of_a_calibration_are_drawn(drawn, turning):
    logs = (turning / "imu.parquet", turning / "table.parquet")
    title, source = drawn("calibrate", *logs)
    assert title == "NAV440, residuals of the calibration, about z at 60 deg/s"
    assert source.endswith("turning/imu.parquet")


@pytest.mark.parametrize("command", ["allan", "calibrate", "navigate", "observe", "scale", "triad"])
def test_a_wrong_suffix_is_refused_before_the_work(rotcli, command):
    done = rotcli(command, "no-such-log.csv", "no-such-table.csv", "--plot", "a.bmp")
    assert done.status == 2
    assert "a.bmp: not the name of a picture; name it .png, .svg or .pdf" in done.err


@pytest.mark.parametrize(
    "command", [("plan", "--table", "1", "--minutes", "4"), ("srins", "observe"), ("budget",)]
)
def test_a_wrong_suffix_is_refused_by_commands_without_a_log(rotcli, command):
    done = rotcli(*command, "--plot", "a.wrong")
    assert done.status == 2
    assert "a.wrong: not the name of a picture" in done.err


def test_a_figure_for_a_paper_contains_no_name_and_no_file(rotcli, still, tmp_path):
    for style, named in (("screen", True), ("paper", False)):
        path = tmp_path / f"{style}.svg"
        assert rotcli("allan", still / "imu.csv", "--plot", path, "--style", style).status == 0
        text = path.read_text()
        assert ("NAV440" in text) == named
        assert ("imu.csv" in text) == named
        assert ">cluster time, s</text>" in text
    assert 'width="252pt"' in text  # 3.5 inch


def test_letters_of_allan_terms_are_inside_their_panel_and_free_of_each_other(rotcli, tmp_path):
    run = tmp_path / "run"
    simulated = (
        "simulate",
        "--imu",
        "mti-g",
        "--rate",
        "0",
        "--static",
        "600",
        "--navigation",
        "0",
    )
    assert rotcli(*simulated, "--seed", "1", "-o", run).status == 0
    imu, rig = rotcli_api.read_imu(run / "imu.parquet"), rotcli_api.read_rig(run / "rig.toml")
    figure = rotcli_api.allan(imu, rig).plot()
    renderer = figure.canvas.get_renderer()
    for panel in figure.axes:
        frame = panel.get_window_extent(renderer)
        letters = [text for text in panel.texts if text.get_text()[:1] in "QNBKR"]
        assert letters
        boxes = [text.get_window_extent(renderer) for text in letters]
        for k, box in enumerate(boxes):
            assert frame.x0 <= box.x0 <= box.x1 <= frame.x1
            assert frame.y0 <= box.y0 <= box.y1 <= frame.y1
            assert not any(box.overlaps(other) for other in boxes[k + 1 :])
