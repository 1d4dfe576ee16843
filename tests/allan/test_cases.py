"""Logs of users and faulted still logs with their right answers, read where they are."""

import importlib.util
import json
import re
import sys

import pytest

from tests.recorded import shared

GYROS = ("gyro_x", "gyro_y", "gyro_z")
ACCELS = ("accel_x", "accel_y", "accel_z")


@pytest.fixture
def analyse(rotcli, tmp_path):
    """Return a function that runs `rotcli allan`; it returns the outcome and the document."""

    def run(path, *options):
        result = tmp_path / "allan.json"
        done = rotcli("allan", path, "-o", result, *options)
        document = json.loads(result.read_text()) if done.status == 0 else None
        return done, document

    return run


def z_of_n(document, name, truth):
    found = document["axes"][name]["coefficients"]["random_walk"]
    return (found["value"] - truth) / found["sigma"]


def assert_white(document, gyro=0.3, accel=0.05, sigmas=3.2):
    """Every axis has N within its sigma (six axes), and no bias instability."""
    for names, truth in ((GYROS, gyro), (ACCELS, accel)):
        for name in names:
            assert abs(z_of_n(document, name, truth)) < sigmas, name
            slow = document["axes"][name]["coefficients"]["bias_instability"]
            assert slow["value"] is None, name


def codes(document):
    return {finding["code"] for finding in document["findings"]}


def case(*parts):
    return shared("cases", "logs", *parts)


def test_a_low_pass_filtered_log_has_the_noise_before_the_filter(analyse):
    done, document = analyse(case("01-lowpass", "fc5.parquet"))
    assert_white(document)
    assert codes(document) == {"low-pass"}
    assert "low-pass filtered at about 4." in done.err
    assert "Cluster times below" in done.err


@pytest.mark.campaign  # a long log; tests/simulate/test_effects.py has a short one
def test_repeated_readings_have_the_noise_of_the_sensor(analyse):
    done, document = analyse(case("02-sample-and-hold", "hold10.parquet"))
    assert_white(document)
    assert "occurs 10 times in a row" in done.err
    assert {axis["spectrum"]["repeats"] for axis in document["axes"].values()} == {10}


def test_a_sinusoid_is_named_and_does_not_change_n(analyse):
    _, document = analyse(case("03-sine", "sine.parquet"))
    assert_white(document, sigmas=2.0)
    for name in GYROS:
        (line,) = document["axes"][name]["spectrum"]["lines"]
        assert f"{line['frequency_hz']:.2f}" == "0.50"
        # 0.02 deg/s; 16 windows know the amplitude of this line to 4 %.
        assert line["amplitude"] == pytest.approx(0.020, abs=0.002)
        assert line["unit"] == "deg/s"


@pytest.mark.parametrize("name", ["inc100.csv", "inc200.csv"])
def test_increments_are_not_read_as_rates_and_the_advice_works(analyse, tmp_path, name):
    path = case("07-increments", name)
    done, _ = analyse(path)
    assert done.status == 1
    assert 'set [imu] sampling = "increment"' in done.err
    rig = tmp_path / "rig.toml"
    rig.write_text('[imu]\nsampling = "increment"\n')
    done, document = analyse(path, "--rig", rig)
    assert done.status == 0, done.err
    assert_white(document)


def test_one_of_two_imus_in_a_log_is_used(analyse, tmp_path):
    path, rig = case("21-two-imus", "ardu.csv"), case("21-two-imus", "ardu.toml")
    done, document = analyse(path, "--rig", rig)
    assert "2 IMUs" in done.err
    assert_white(document)
    second = tmp_path / "second.toml"
    second.write_text(rig.read_text() + "instance = 1\n")
    done, document = analyse(path, "--rig", second)
    assert "2 IMUs" not in done.err
    assert_white(document)


def test_a_log_with_lost_samples_is_used_completely(analyse):
    _, document = analyse(case("22-lost-samples", "lost.parquet"))
    assert_white(document)
    assert document["used"]["percent"] == 100.0
    assert document["used"]["seconds"] == pytest.approx(300.0, abs=0.02)


# Fault: words of the warning or error, and the axes whose N must still be that of the log.
FAULTS = {
    "still_clean": (None, GYROS),
    "still_counter": ("time counts records", None),
    "still_minutes": ("time has no unit, 6000 records per second", None),
    "still_held": ("each reading of gyro_x, .* occurs 2 times in a row", ()),
    "still_half_copied": ("30000 rows repeat earlier rows .* the first at 300 s", GYROS),
    "still_10s_repeated": ("59000 rows repeat earlier rows .* the first at 10 s", GYROS),
    "still_cut": ("gyro_x: 4.1 % of the readings are exactly .* clipped", GYROS[1:]),
    "still_boxcar": ("gyro_x is low-pass filtered at about 2", GYROS),
    "still_sine": ("gyro_x: a sinusoid of 2.70. Hz, amplitude 0.0[45]", GYROS),
    "still_unit_one_axis": ("different units: gyro_x rad/s, gyro_y deg/s", None),
    "still_one_bracket": ("different units: gyro_x deg/s", None),
    "still_contradiction": ("units in names and metadata differ: gyro_x", None),
    "still_spike": ("gyro_x: 1 spike, the largest 57.. deg/s .* at 300 s", GYROS),
    "still_zeros_3": ("accel_z: 3 spikes, .* at 300 s", GYROS),
    "still_warm_up": ("gyro_x has a linear trend", GYROS),
    "still_lost": (r"1184 gaps \(1204 samples\)", GYROS),
}
TRUTH = 0.4  # deg/sqrt(h)


@pytest.fixture(scope="module")
def faults():
    path = shared("cases", "faults", "make_faults.py")
    spec = importlib.util.spec_from_file_location("make_allan_faults", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules["make_allan_faults"] = module
    spec.loader.exec_module(module)
    return module


def test_every_fault_of_a_still_log_is_listed(faults):
    assert set(FAULTS) == {n for n, f in faults.FAULTS.items() if f.right.startswith("a=")}


@pytest.mark.parametrize("name", FAULTS)
def test_a_faulted_still_log_gets_its_right_answer(faults, analyse, tmp_path, name):
    faults.make(name, None, tmp_path / "run")
    words, axes = FAULTS[name]
    path = next((tmp_path / "run").glob("imu.*"))
    done, document = analyse(path)
    lines = [s for s in done.err.splitlines() if "warning: " in s or "error: " in s]
    if words is None:
        assert (done.status, lines) == (0, [])
    else:
        assert [s for s in lines if re.search(words, s)], lines
        right = faults.FAULTS[name].right.removeprefix("a=")
        assert ("R" if done.status else "W") in right
    for axis in axes or ():
        assert abs(z_of_n(document, axis, TRUTH)) < 3.2, axis
    if name == "still_held":
        # A sensor of 50 Hz in a log of 100 Hz: twice the variance a second.
        assert abs(z_of_n(document, "gyro_x", TRUTH * 2**0.5)) < 3.2
    if name == "still_cut":
        assert document["axes"]["gyro_x"]["coefficients"]["random_walk"]["value"] is None
    if name == "still_boxcar":
        assert document["axes"]["gyro_x"]["coefficients"]["bias_instability"]["value"] is None
    if name == "still_lost":
        assert document["used"]["percent"] == 100.0


def test_spikes_are_interpolated_on_request(faults, analyse, tmp_path):
    faults.make("still_spike", None, tmp_path / "run")
    path = next((tmp_path / "run").glob("imu.*"))
    done, document = analyse(path)
    assert "--despike interpolates spikes" in done.err
    assert len(document["used"]["segments_s"]) == 2
    done, document = analyse(path, "--despike")
    assert document["used"]["segments_s"] == [[0.0, pytest.approx(599.99)]]
    assert abs(z_of_n(document, "gyro_x", TRUTH)) < 3.2
