"""A plot says whose it is when it is found alone, and text of files stays text in it."""

import shutil

import pytest
from matplotlib.cbook import is_math_text
from matplotlib.text import Text

from rotcli.files import figures as plots

ODD = "b_1$x_2$^{3}%\\frac.csv"


@pytest.fixture
def drawn(rotcli, monkeypatch, tmp_path):
    """Return a function that runs a command with --plot and returns title and source as shown."""
    figures = []
    whole = plots.figure_bytes
    monkeypatch.setattr(plots, "figure_bytes", lambda f, kind: figures.append(f) or whole(f, kind))

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
