"""What the readings show before the filter: the same findings as a calibration has, no others."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rotcli.observe.api import filter_logs
from rotcli.observe.zupt import Options, filter_log
from rotcli.observe.zupt.prepare import prepare_zupt
from rotcli.rig.rig import rig_from_dict
from rotcli.simulate.document import _rig
from rotcli.simulate.estimate import simulate
from rotcli.units import DEG, DEG_PER_HOUR

LOG = Path(__file__).parents[2] / "fixtures" / "nav440_rate_60" / "imu.parquet"


@pytest.fixture(scope="module")
def clean(papers_run):
    scenario = papers_run("nav440", rate=30.0, seed=3, static=40.0, rotation=100.0)
    made = simulate(scenario)
    return made.imu, made.table, rig_from_dict(_rig(scenario, made))


def at(imu, start, end):
    return slice(*np.searchsorted(imu.time, [start - 1e-6, end - 1e-6]))


def _step(imu):
    imu.gyro[at(imu, 20.0, 1e9), 0] += 300.0 * DEG_PER_HOUR


def _drift(imu):
    imu.gyro[:] += np.outer(imu.time, np.ones(3)) * 0.3 * DEG / 140.0


def _line(imu):
    span = at(imu, 80.0, 81.0)
    for values in (imu.gyro, imu.accel):
        values[span] = np.linspace(values[span.start], values[span.stop - 1], 100)


def _copy(imu):
    for values in (imu.gyro, imu.accel):
        values[at(imu, 80.0, 82.0)] = values[at(imu, 60.0, 62.0)]


def _zero(imu):
    imu.gyro[8000] = imu.accel[8000] = 0.0


def _spike(imu):
    imu.gyro[8000:8005, 2] += 0.5


def _flip(imu):
    imu.gyro[:, 1] *= -1.0


FAULTS = {
    "a step of the bias while still": (
        _step,
        "fit-contradicted",
        "changes by 2.* near (16|17|18|19|2)",
    ),
    "drift": (_drift, "fit-contradicted", "the bias drifts by"),
    "interpolated rows": (_line, "samples-not-measured", "98 samples lie on a straight line"),
    "copied rows": (_copy, "copied-rows", "200 rows repeat earlier rows bit for bit"),
    "a row of zeros": (_zero, "samples-not-measured", "1 sample is zero in all channels: 80 s"),
    "a spike": (_spike, "segment-disturbed", "was disturbed near (79|80).* s .gyro_z deviates"),
}


def findings(imu, table, rig):
    return {f.code: f.text for f in prepare_zupt(imu, table, rig, Options()).findings}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_the_readings_is_named_once(clean, fault):
    imu, table, rig = clean
    change, code, says = FAULTS[fault]
    faulted = replace(imu, gyro=imu.gyro.copy(), accel=imu.accel.copy())
    change(faulted)
    found = findings(faulted, table, rig)
    assert re.search(says, found[code]), found
    assert set(found) <= {code, "segment-disturbed"}, found


def test_a_clean_log_is_silent(clean):
    assert findings(*clean) == {}


def test_a_flipped_gyro_is_found_by_the_earth_rate(papers_run):
    scenario = papers_run("nav440", rate=30.0, seed=3, static=40.0, rotation=300.0)
    made = simulate(scenario)
    imu = replace(made.imu, gyro=made.imu.gyro.copy())
    _flip(imu)
    found = findings(imu, made.table, rig_from_dict(_rig(scenario, made)))
    assert "gyro_y has the wrong sign" in found["residual-harmonics"]


def test_a_still_log_without_table_is_tested_too(clean):
    imu, _, rig = clean
    still = imu.crop(0.0, 39.0)
    result = filter_log(still, None, rig, Options())
    assert result.findings == ()
    stepped = replace(still, gyro=still.gyro.copy())
    _step(stepped)
    (text,) = [t for t in filter_log(stepped, None, rig, Options()).warnings if "gyro_x" in t]
    assert "the bias changes by" in text


def test_a_result_contains_the_findings_of_the_readings_with_their_types(clean):
    imu, table, rig = clean
    faulted = replace(imu, gyro=imu.gyro.copy(), accel=imu.accel.copy(), path=str(LOG))
    _zero(faulted)
    document = filter_logs(faulted, replace(table, path=str(LOG)), rig, Options()).document
    finding = document["findings"][0]
    assert (finding["code"], finding["severity"]) == ("samples-not-measured", "warning")
    assert {f["text"] for f in document["findings"]} <= set(document["warnings"])
