"""The numbers of the table are those of the published example and those that export writes."""

import math

import numpy as np
import pytest

from rotcli.allan.api import allan_log
from rotcli.allan.numbers import numbers, numbers_table
from rotcli.allan.tables import goodness_table
from rotcli.export.figures import Source, collect
from rotcli.export.formats import render
from rotcli.export.numbers import Settings
from rotcli.files.tables.text import to_text
from rotcli.logs.record import ImuLog
from rotcli.models.noise_numbers import (
    midpoint_sample,
    per_sample,
    root_mean_square,
    sample_variance,
    walk_per_sample,
    walk_rate_per_step,
)
from rotcli.models.sensors import NoiseFigures, noise
from rotcli.rig.rig import default_rig
from rotcli.units import DEG_PER_HOUR, DEG_PER_ROOT_HOUR


def coefficient(value, upper=None):
    return {"value": value, "upper": upper, "si": {}}


def axis(white, flicker, walk):
    names = ("random_walk", "bias_instability", "rate_random_walk")
    return {"coefficients": dict(zip(names, (white, flicker, walk), strict=True))}


NAV440 = {
    "gyro_x": axis(coefficient(0.4), coefficient(15.66), coefficient(0.35)),
    "accel_z": axis(coefficient(0.048), coefficient(None, 45.9), coefficient(None, 2.0)),
}


def test_the_numbers_of_the_nav440_are_those_of_the_design():
    """The example of docs/explanation/which-number-goes-where.md, at 100 Hz, digit for digit."""
    found = [(row["unit"], row["axes"]) for row in numbers(NAV440, 100.0)]
    gyro = [(unit, axes["gyro_x"]["value"]) for unit, axes in found if "gyro_x" in axes]
    expected = [
        ("rad/s/sqrt(Hz)", 1.163553e-4),
        ("rad/s", 1.163553e-3),
        ("deg/sqrt(h)", 0.4),
        ("deg/s/sqrt(Hz)", 6.666667e-3),
        ("deg/h", 15.66),
        ("rad/s^2/sqrt(Hz)", 1.696848e-6),
        ("rad/s", 1.696848e-7),
        ("deg/h/sqrt(h)", 21.0),
    ]
    assert [unit for unit, _ in gyro] == [unit for unit, _ in expected]
    assert [v for _, v in gyro] == pytest.approx([v for _, v in expected], rel=1e-6)
    accel = [(unit, axes["accel_z"]["value"]) for unit, axes in found if "accel_z" in axes]
    assert dict(accel)["m/s^2/sqrt(Hz)"] == pytest.approx(8.0e-4)
    assert dict(accel)["ug/sqrt(Hz)"] == pytest.approx(81.577, rel=1e-5)
    assert dict(accel)["m/s/sqrt(h)"] == pytest.approx(0.048)
    # A limit stays a limit in every unit: 2 ug/sqrt(s) are 1.96133e-5 m/s^3/sqrt(Hz).
    walk = next(axes["accel_z"] for unit, axes in found if unit == "m/s^3/sqrt(Hz)")
    assert walk == {"value": pytest.approx(2.0 * 9.80665e-6), "is_limit": True}


def test_per_sample_numbers_are_those_of_simulated_samples():
    """The sampled white noise and the steps of the sampled bias have these scatters."""
    n, rate = 400_000, 50.0
    white, walk = 2.0, 3.0
    samples = noise(np.random.default_rng(1), n, 1.0 / rate, NoiseFigures(white=white))
    assert samples.std() == pytest.approx(per_sample(white, rate), rel=0.01)
    assert samples.var() == pytest.approx(sample_variance(white, rate), rel=0.02)
    figures = NoiseFigures(rate_random_walk=walk)
    bias = noise(np.random.default_rng(2), n, 1.0 / rate, figures)
    steps = np.diff(bias)
    assert steps.std() == pytest.approx(walk_per_sample(walk, rate), rel=0.01)
    # The same bias as a rate of change that acts over one interval.
    assert (steps * rate).std() == pytest.approx(walk_rate_per_step(walk, rate), rel=0.01)
    # Two half intervals with newly drawn noise each make N^2 a second.
    drawn = midpoint_sample(white, rate) * np.random.default_rng(3).standard_normal((n, 2))
    angle = drawn.sum(axis=1) * 0.5 / rate
    assert angle.var() * rate == pytest.approx(white**2, rel=0.02)


@pytest.fixture
def still(tmp_path):
    path = tmp_path / "still.csv"
    path.write_text("a log with a fingerprint")
    interval, seconds = 0.02, 1200.0
    n = round(seconds / interval)
    gyro = NoiseFigures(white=0.4 * DEG_PER_ROOT_HOUR, rate_random_walk=20 * DEG_PER_HOUR)
    rng = np.random.default_rng(4)
    return ImuLog(
        path=str(path),
        time=interval * np.arange(n),
        gyro=np.stack([noise(rng, n, interval, gyro) for _ in range(3)], axis=1),
        accel=8e-4 / math.sqrt(interval) * rng.standard_normal((n, 3)) + [0.0, 0.0, 9.81],
        interval=interval,
    )


def test_export_writes_the_numbers_of_the_table(still):
    doc = allan_log(still, default_rig()).document
    figures = collect([(Source("allan.json", "allan", ""), doc)])
    lines = render("kalibr", figures, Settings()).text.splitlines()
    written = {line.split(":")[0]: float(line.split()[1]) for line in lines if "_noise_" in line}
    written |= {line.split(":")[0]: float(line.split()[1]) for line in lines if "_walk:" in line}
    table = {row["use"].removeprefix("Kalibr "): row["all"] for row in doc["numbers"]}
    assert len(written) == 4
    for key, value in written.items():
        assert table[key]["value"] == pytest.approx(value, rel=1e-9)  # ten digits are written
    assert not table["gyroscope_random_walk"]["is_limit"]
    assert table["accelerometer_random_walk"]["is_limit"]


def test_the_table_shows_limits_and_says_what_f_is():
    doc = {"axes": NAV440, "interval_s": 0.01, "numbers": numbers(NAV440, 100.0)}
    text = " ".join(to_text(numbers_table(doc)).split())
    assert "gyro N 0.0001164" in text
    assert "<1.961e-05" in text
    assert "the rate of the log, 100 Hz" in text
    assert "Kalibr gyroscope_random_walk" in text
    assert "not significant, 95 % upper limit" in text
    one = {"gyro_x": NAV440["gyro_x"]}
    table = numbers_table({"axes": one, "interval_s": 0.01, "numbers": numbers(one, 100.0)})
    assert table.title == "Which number goes where"
    assert "<" not in table.note
    assert numbers_table({"axes": NAV440, "interval_s": 0.01}) is None


def test_an_axis_without_value_and_limit_leaves_the_mean_of_the_axes_open():
    unknown = {
        "gyro_x": NAV440["gyro_x"],
        "gyro_y": axis(coefficient(None), coefficient(None), coefficient(None)),
    }
    row = numbers(unknown, 100.0)[0]
    assert row["axes"]["gyro_y"] == {"value": None, "is_limit": False}
    assert row["all"]["value"] is None


def test_the_goodness_of_fit_is_printed_for_every_axis(still):
    result = allan_log(still, default_rig())
    table = goodness_table(result.document)
    assert [row[0] for row in table.rows] == list(result.document["axes"])
    good = result.document["axes"]["gyro_x"]["goodness"]
    assert table.rows[0][1] == good["chi2"] / good["dof"]
    assert any(t.title == "Goodness of fit" for t in result.tables())


def test_the_root_mean_square_survives_numbers_whose_squares_overflow():
    assert root_mean_square(np.array([3.0, 4.0])) == pytest.approx(math.sqrt(12.5))
    assert root_mean_square(np.array([3e200, 4e200])) == pytest.approx(math.sqrt(12.5) * 1e200)
    assert root_mean_square(np.zeros(3)) == 0.0
