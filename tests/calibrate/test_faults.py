"""Faults of a run that the log itself shows: each is named, and clean runs are silent."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.calibrate import document
from rotcli.calibrate.api import base_of, settings_of
from rotcli.calibrate.estimate import calibrate
from rotcli.errors import LogError
from rotcli.rig.profile import read_profile
from rotcli.run.recording import calibration_run
from rotcli.simulate.estimate import simulate
from rotcli.units import DEG, DEG_PER_HOUR

UP = np.array([0.0, 0.0, 1.0])
STAGES = {"static": [0, 60], "rotation": [[61, 121]], "navigation": [121, 421]}
FIGURES = {
    "nav440": {"angle_random_walk": 0.4, "bias_instability": 15.66, "rate_random_walk": 0.35},
    "mti-g": {"angle_random_walk": 3.0, "bias_instability": 8.28, "rate_random_walk": 2.6},
}


@pytest.fixture(scope="module")
def make(papers_run):
    """Return a maker of a run: IMU log, table log, rig."""

    def run(imu="nav440", rate=30.0, seed=1, axis="z"):
        scenario = papers_run(imu, rate=rate, seed=seed, navigation=5.0, table={"axis": axis})
        figures = {**FIGURES[imu], "scale_sigma": 4000.0 if imu == "mti-g" else 800.0}
        figures["gyro_range"] = read_profile(imu).gyro.range / DEG
        made = simulate(scenario)
        return made.imu, made.table, scenario.rig.override({"imu": figures, "stages": STAGES})

    return run


@pytest.fixture(scope="module")
def clean(make):
    return make()


def codes(imu, table, rig):
    """Return the codes of the findings of a calibration, and the result."""
    run = calibration_run(imu, table, rig)
    result = calibrate(
        imu,
        table,
        run.segments,
        axis_name=rig.table.axis_name,
        axis=rig.table.axis,
        base=base_of(rig),
        settings=settings_of(rig),
        uneven=run.uneven,
    )
    return [f.code for f in (*run.findings, *result.findings)], result


def at(imu, start, end):
    return slice(*np.searchsorted(imu.time, [start - 1e-6, end - 1e-6]))


def _zeros(imu):
    imu.gyro[at(imu, 90.0, 90.1)] = imu.accel[at(imu, 90.0, 90.1)] = 0.0


def _spike(imu):
    imu.gyro[at(imu, 90.0, 90.05), 2] += 2.0


def _step(axis, size, time):
    def change(imu):
        imu.gyro[at(imu, time, 1e9), axis] += size * DEG_PER_HOUR

    return change


def _line(imu):
    span = at(imu, 80.0, 85.0)
    n = span.stop - span.start
    for values in (imu.gyro, imu.accel):
        for k in range(3):
            values[span, k] = np.linspace(values[span.start, k], values[span.stop - 1, k], n)


def _drift(imu):
    imu.gyro[:] += np.outer(imu.time, np.ones(3)) * 0.3 * DEG / 421.0


def _copy(imu):
    source, target = at(imu, 70.0, 72.0), at(imu, 80.0, 82.0)
    imu.gyro[target], imu.accel[target] = imu.gyro[source], imu.accel[source]


def _stored(imu):
    imu.gyro[1::2], imu.accel[1::2] = imu.gyro[:-1:2], imu.accel[:-1:2]


def _unit(axis, factor):
    def change(imu):
        imu.gyro[:, axis] *= factor

    return change


FAULTS = {
    "rows of zeros": (_zeros, "samples-not-measured"),
    "a spike": (_spike, "segment-disturbed"),
    "a step of the bias while turning": (_step(0, 1000.0, 90.0), "fit-contradicted"),
    "a step of the bias while still": (_step(0, 200.0, 30.0), "fit-contradicted"),
    "interpolated rows": (_line, "samples-not-measured"),
    "copied rows": (_copy, "copied-rows"),
    "each row twice": (_stored, "repeated-rows"),
    "drift of the biases": (_drift, "fit-contradicted"),
    "one gyro in another unit": (_unit(0, DEG), "noise-of-one-gyro"),
    "a scale factor of 2 percent": (_unit(2, 1.02), "scale-implausible"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_the_readings_is_named(clean, fault):
    imu, table, rig = clean
    change, code = FAULTS[fault]
    faulted = replace(imu, gyro=imu.gyro.copy(), accel=imu.accel.copy())
    change(faulted)
    found, _ = codes(faulted, table, rig)
    assert code in found, found


def test_a_clean_run_is_silent_and_within_its_sigmas(clean):
    imu, table, rig = clean
    found, result = codes(imu, table, rig)
    assert found == []
    truth = read_profile("nav440").gyro
    expected = np.concatenate([truth.matrix[:, 2], truth.bias])
    assert np.all(np.abs(result.values - expected) < 4.0 * np.sqrt(np.diag(result.covariance)))


@pytest.mark.parametrize(("imu", "rate", "axis"), [("nav440", -100.0, "x"), ("mti-g", 10.0, "y")])
def test_a_few_clean_runs_of_other_rates_and_axes_are_silent(make, imu, rate, axis):
    for seed in range(3):
        assert codes(*make(imu, rate, seed, axis))[0] == []


@pytest.mark.campaign
@pytest.mark.parametrize("imu", FIGURES)
@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("rate", [10.0, 30.0, -100.0])
def test_two_hundred_clean_runs_raise_two_alarms_at_most(make, imu, axis, rate):
    alarms = [seed for seed in range(200) if codes(*make(imu, rate, seed, axis))[0]]
    assert len(alarms) <= 2, alarms


def test_a_segment_named_twice_is_refused(clean):
    imu, table, rig = clean
    twice = rig.override({"stages": {**STAGES, "rotation": [[61, 101], [81, 121]]}})
    with pytest.raises(LogError, match="overlap, so samples would count twice"):
        codes(imu, table, twice)


def test_a_table_clock_of_eight_seconds_is_refused_with_the_offset(clean):
    imu, table, rig = clean
    late = replace(table, time=table.time - 8.0)
    with pytest.raises(
        LogError, match=r"lags the table log by (7999|8000)\.\d.* time_offset = (7\.999|8\.0)"
    ):
        codes(imu, late, rig.override({"stages": {"rotation": [[61, 110]]}}))


def test_a_clipped_segment_is_rejected(clean):
    imu, table, rig = clean
    low = rig.override({"imu": {"gyro_range": 29.0}})
    clipped = replace(imu, gyro=np.clip(imu.gyro, -29.0 * DEG, 29.0 * DEG))
    with pytest.raises(LogError, match=r"is rejected: 1 of the samples of gyro_z are clipped"):
        codes(clipped, table, low)


def test_an_eccentric_encoder_is_reported_and_does_not_matter(clean):
    imu, table, rig = clean
    for size, expected in ((0.02, []), (0.05, ["encoder-eccentricity"])):
        error = size * DEG * np.sin(table.angle + 0.4)
        found, result = codes(imu, replace(table, angle=table.angle + error), rig)
        assert [c for c in found if c == "encoder-eccentricity"] == expected
        assert abs(result.values[2] - 1200e-6) < 4.0 * np.sqrt(result.covariance[2, 2])


def test_rows_between_gaps_that_were_interpolated_on_reading_are_not_reported(clean):
    imu, table, rig = clean
    faulted = replace(imu, gyro=imu.gyro.copy(), accel=imu.accel.copy())
    _line(faulted)
    missing = np.zeros(imu.samples, dtype=bool)
    missing[at(imu, 80.0, 85.0)] = True
    found, _ = codes(replace(faulted, missing=missing), table, rig)
    assert "samples-not-measured" not in found


def test_every_test_has_figure_limit_and_verdict_in_the_result(clean):
    imu, table, rig = clean
    good = document.fields(codes(imu, table, rig)[1])["goodness"]
    assert list(good) == [
        "x",
        "y",
        "z",
        "harmonics",
        "steadiness",
        "clipping",
        "scale",
        "mean_after",
    ]
    assert {test["verdict"] for test in good.values()} == {"consistent"}
    assert good["harmonics"]["dof"] == 12
    assert good["harmonics"]["limit"] == pytest.approx(32.909, abs=1e-3)  # chi2.isf(1e-3, 12)
    assert 0.0 < good["steadiness"]["value"] < good["steadiness"]["limit"] == 1.0
    assert (good["clipping"]["value"], good["clipping"]["limit"]) == (0.0, 0.01)
    assert good["scale"]["where"] in ("Kgxz", "Kgz")  # 1100 and 1200 ppm, sigma of the rig 800
    assert good["scale"]["value"] == pytest.approx(1.5, abs=0.5)


@pytest.mark.parametrize(
    ("change", "name", "where"),
    [
        (_unit(2, 1.02), "scale", "Kgz"),
        (_spike, "steadiness", "gyro_z near "),
    ],
)
def test_a_test_that_fails_says_so_in_the_result(clean, change, name, where):
    imu, table, rig = clean
    faulted = replace(imu, gyro=imu.gyro.copy(), accel=imu.accel.copy())
    change(faulted)
    test = document.fields(codes(faulted, table, rig)[1])["goodness"][name]
    assert test["verdict"] == "contradicted"
    assert test["value"] > test["limit"]
    assert test["where"].startswith(where)
