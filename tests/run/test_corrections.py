"""Calibration documents applied to logs, in memory and streamed."""

import json

import numpy as np
import pytest

from rotcli.errors import ResultError
from rotcli.logs.record import ImuLog
from rotcli.models.sensors import AXIS_COLUMN_NAMES, BIAS_NAMES, TriadErrors
from rotcli.models.triad import parameters as p
from rotcli.models.triad.kinematics import table
from rotcli.models.triad.sensor import readings
from rotcli.run import corrections
from rotcli.run.corrections import (
    CorrectedSource,
    correct_log,
    corrected,
    read_corrections,
    split_corrections,
)
from rotcli.units import DEG


def _document(path, parameters, **more):
    doc = {"kind": "calibration", "schema": 1, "rotcli": "0", "inputs": [], "rig": {}}
    path.write_text(json.dumps({**doc, "model": "triad", "parameters": parameters, **more}))
    return str(path)


def _parameters(x):
    rows = zip(p.NAMES, x, p.unit_factors(), p.unit_names(), strict=True)
    return {
        name: {"value": value / to_si, "sigma": 1.0, "unit": unit}
        for name, value, to_si, unit in rows
    }


def _errors():
    x = np.zeros(p.count())
    x[p.N] = np.linspace(-2e-3, 3e-3, 9)
    x[p.M] = np.linspace(3e-3, -1e-3, 9)
    x[p.GYRO_BIAS], x[p.ACCEL_BIAS] = [1e-4, -2e-4, 3e-4], [0.01, 0.02, -0.03]
    x[p.G] = np.linspace(-20, 20, 9) * p.G_UNIT
    x[p.K2], x[p.ACCEL_ASYMMETRY] = np.array([50, -100, 20]) * p.K2_UNIT, [1e-4, 0, -1e-4]
    x[p.GYRO_ASYMMETRY] = [1e-4, -2e-4, 5e-5]
    return x


def _log(x, n=50):
    nominal = table("zxy", latitude=0.9, gravity=9.8)
    rng = np.random.default_rng(1)
    angles, rates = rng.uniform(-3, 3, (3, n)), rng.uniform(-100, 100, (3, n)) * DEG
    still = np.zeros((3, n))
    y = readings(nominal, x, angles, rates, still)
    clean = readings(nominal, np.zeros_like(x), angles, rates, still)
    time = np.arange(n) * 0.01
    return ImuLog("a.csv", time, y[:3].T.copy(), y[3:].T.copy(), 0.01, rows=n), clean


def test_a_triad_document_undoes_the_errors_of_its_sensors(tmp_path):
    x = _errors()
    log, clean = _log(x)
    found = correct_log(log, read_corrections([_document(tmp_path / "c.json", _parameters(x))]))
    np.testing.assert_allclose(found.gyro.T, clean[:3], atol=1e-11)
    np.testing.assert_allclose(found.accel.T, clean[3:], atol=1e-9)


def test_a_streamed_log_is_corrected_like_one_in_memory(tmp_path):
    log, _ = _log(_errors())
    corrections = read_corrections([_document(tmp_path / "c.json", _parameters(_errors()))])
    complete, source = correct_log(log, corrections), CorrectedSource(log, corrections)
    parts = list(source.chunks(slice(10, 40)))
    np.testing.assert_array_equal(np.concatenate([q.gyro for q in parts]), complete.gyro[10:40])
    out = np.empty(30)
    source.fill(out, "accel_y", slice(10, 40))
    np.testing.assert_array_equal(out, complete.accel[10:40, 1])
    assert (source.rows, source.samples, source.path) == (50, 50, "a.csv")


def test_no_correction_leaves_the_source_alone():
    log, _ = _log(np.zeros(p.count()))
    assert corrected(log, []) is log


def test_a_log_of_more_than_one_chunk_stays_a_stream(tmp_path, monkeypatch):
    log, _ = _log(_errors())
    found = read_corrections([_document(tmp_path / "c.json", _parameters(_errors()))])
    monkeypatch.setattr(corrections, "CHUNK_SAMPLES", 50)
    assert isinstance(corrected(log, found), ImuLog)
    monkeypatch.setattr(corrections, "CHUNK_SAMPLES", 49)
    stream = corrected(log, found)
    assert isinstance(stream, CorrectedSource)
    np.testing.assert_array_equal(stream.crop(0.0, 1.0).gyro, correct_log(log, found).gyro)


@pytest.mark.parametrize(("group", "name"), [(p.N, "gyro"), (p.M, "accelerometer")])
def test_a_matrix_that_cannot_be_inverted_is_refused(group, name, tmp_path):
    # The determinant is 0.25 less the square of the other entry, 0.01 at least.
    for entry, other, refused in ((-0.5, 0.492, True), (-0.5, 0.488, False), (0.5, 0.5, False)):
        x = np.zeros(p.count())
        x[group] = np.array([[entry, other, 0], [other, entry, 0], [0, 0, 0]]).ravel()
        path = _document(tmp_path / "c.json", _parameters(x))
        if refused:
            with pytest.raises(ResultError, match=f"the {name} matrix cannot be inverted"):
                read_corrections([path])
        else:
            assert len(read_corrections([path])) == 1


def test_a_single_axis_calibration_removes_its_biases_and_its_column():
    errors = TriadErrors(np.outer([0.01, -0.02, 0.03], [0.0, 0.0, 1.0]), np.array([1e-3, 0, 2e-3]))
    found = corrections.ColumnCorrection("c.json", None, errors, np.array([0.1, -0.2, 0.3]))
    true = np.array([[0.1, 0.2, 0.5]])
    read = true + np.array([[0.01, -0.02, 0.03]]) * 0.5 + np.array([[1e-3, 0, 2e-3]])
    log = ImuLog("imu", np.zeros(1), read, np.array([[1.1, -2.2, 9.8]]), 0.01)
    gyro, accel = found.apply(log)
    np.testing.assert_allclose(gyro, true, rtol=1e-12)
    np.testing.assert_allclose(accel, [[1.0, -2.0, 9.5]], rtol=1e-12)


def _column(path, axis="z"):
    names = (*BIAS_NAMES, *AXIS_COLUMN_NAMES[axis])
    units = ["deg/h"] * 3 + ["ppm"] * 3
    parameters = {
        name: {"value": 0.0, "sigma": 1.0, "unit": unit}
        for name, unit in zip(names, units, strict=True)
    }
    more = {"axis": axis, "parameters": parameters, "rate": {"value": 10.0, "unit": "deg/s"}}
    doc = {"kind": "calibration", "schema": 1, "rotcli": "0", "inputs": [], "rig": {}}
    path.write_text(json.dumps({**doc, **more}))
    return str(path)


def test_one_single_axis_calibration_is_apart_from_the_others_two_are_refused(tmp_path):
    z, y = _column(tmp_path / "z.json"), _column(tmp_path / "y.json", "y")
    triad = _document(tmp_path / "t.json", _parameters(_errors()))
    column, others = split_corrections([triad, z])
    assert (column.path, [c.path for c in others]) == (z, [triad])
    column, others = split_corrections([triad])
    assert (column, [c.path for c in others]) == (None, [triad])
    with pytest.raises(ResultError, match=r"y\.json: a second single-axis calibration"):
        split_corrections([z, triad, y])


def test_null_parameters_are_not_corrected(tmp_path):
    parameters = _parameters(_errors())
    for name in ("Kgx", "gsens_zz"):
        parameters[name]["value"] = None
    (found,) = read_corrections([_document(tmp_path / "c.json", parameters)])
    assert found.absent == ("Kgx", "gsens_zz")


def test_a_wrong_unit_an_unknown_model_and_another_imu_are_errors(tmp_path):
    parameters = _parameters(_errors())
    named = _document(tmp_path / "a.json", parameters, rig={"imu": {"name": "A 1"}})
    with pytest.raises(ResultError, match="made for the IMU A 1, but the rig names B"):
        read_corrections([named], "B")
    strange = _document(tmp_path / "b.json", parameters, model="spline")
    with pytest.raises(ResultError, match="model: 'spline' is unknown"):
        read_corrections([strange])
    parameters["Kgx"]["unit"] = "percent"
    with pytest.raises(ResultError, match=r"parameters\.Kgx"):
        read_corrections([_document(tmp_path / "c.json", parameters)])
