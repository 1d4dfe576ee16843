"""Laws that hold for any input: readers, conversions, rotations, the filter's covariance."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from rotcli.logs.imu import read_imu, read_reference, write_columns
from rotcli.logs.table import read_table
from rotcli.logs.timing.clock import fit_sample_clock
from rotcli.models import rotation
from rotcli.observe.zupt import model as zupt
from rotcli.rig.rig import Rig, rig_from_dict
from rotcli.srins.filter import FilterSettings, build_filter_model, gain_sequence
from rotcli.srins.reciprocation import RotationScheme
from rotcli.units import SPELLINGS, UNITS, factor, wrap_pi

ROOT = Path(__file__).parents[2]
DEG = np.pi / 180
few = settings(
    max_examples=settings.default.max_examples * 2 // 5,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
angles = st.floats(-1e4, 1e4)


@pytest.mark.parametrize("kind", UNITS)
@given(value=st.floats(-1e9, 1e9))
@few
def test_a_unit_converts_there_and_back(kind, value):
    for unit in UNITS[kind]:
        to_si = factor(unit, kind)
        # One rounding each way; subnormal numbers have fewer digits.
        assert value * to_si / to_si == pytest.approx(value, rel=4e-16, abs=1e-300)
    for spelling, unit in SPELLINGS.items():
        assert factor(spelling, kind) == factor(unit, kind)


@given(angles)
@few
def test_a_wrapped_angle_is_the_same_direction_within_half_a_turn(angle):
    wrapped = wrap_pi(angle)
    assert -np.pi <= wrapped < np.pi
    # 1e4 rad have their last digit at 2e-12.
    assert abs(np.exp(1j * wrapped) - np.exp(1j * angle)) < 1e-11


@given(
    start=st.floats(0.0, 359.99),
    rate=st.floats(-100.0, 100.0),
    direction=st.sampled_from([1, -1]),
    wrap=st.sampled_from(["0..360", "-180..180"]),
    lost=st.lists(st.integers(1, 198), max_size=60),
)
@example(start=0.0, rate=100.0, direction=1, wrap="0..360", lost=[179])  # the jump is in a gap
@few
def test_a_table_log_is_unwrapped_from_any_angle_in_any_sense_through_drop_outs(
    tmp_path, start, rate, direction, wrap, lost
):
    keep = np.setdiff1d(np.arange(200), lost)
    gaps = np.diff(keep).max()
    time = 0.02 * keep
    if abs(rate) * 0.02 * gaps >= 179.0 or len(keep) < 2:
        return  # half a turn without a record: ambiguous
    turned = start + rate * time
    angle = turned % 360.0 if wrap == "0..360" else (turned + 180.0) % 360.0 - 180.0
    path = tmp_path / "table.csv"
    write_columns(path, {"time [s]": time, "angle [deg]": angle})
    log = read_table(path, rig_from_dict({"table": {"direction": direction}}))
    np.testing.assert_allclose(
        log.angle - log.angle[0], direction * rate * (time - time[0]) * DEG, atol=1e-10
    )
    if gaps > 2:
        assert any("gap" in text for text in log.warnings)


@given(
    values=arrays(np.float64, (6, 12), elements=st.floats(-1e5, 1e5)),
    gyro=st.sampled_from(sorted(UNITS["rate"])),
    accel=st.sampled_from(sorted(UNITS["acceleration"])),
    clock=st.sampled_from(["s", "ms", "us"]),
    suffix=st.sampled_from(["csv", "csv.gz", "csv.zst", "parquet"]),
)
@few
def test_any_file_of_any_units_gives_the_numbers_times_their_factors(
    tmp_path, values, gyro, accel, clock, suffix
):
    path = tmp_path / f"imu.{suffix}"
    time = np.arange(12) * 0.01
    columns = {f"time [{clock}]": time / factor(clock, "time")}
    names = [f"gyro_{a} [{gyro}]" for a in "xyz"] + [f"accel_{a} [{accel}]" for a in "xyz"]
    columns |= dict(zip(names, values, strict=True))
    write_columns(path, columns)
    log = read_imu(path, Rig())
    np.testing.assert_array_equal(log.gyro.T, values[:3] * factor(gyro, "rate"))
    np.testing.assert_array_equal(log.accel.T, values[3:] * factor(accel, "acceleration"))
    assert log.interval == pytest.approx(0.01, rel=1e-9)


@given(arrays(np.float64, (3, 9), elements=st.floats(-1.0, 1.0)))
@few
def test_a_reference_log_comes_back_from_csv_as_from_parquet(tmp_path, values):
    values = values * [[90.0], [1e6], [1e4]]  # as far as a vehicle goes
    names = ["latitude [deg]", "height [m]", "v_up [m/s]"]
    columns = {"time [s]": np.arange(9.0), **dict(zip(names, values, strict=True))}
    logs = []
    for suffix in ("csv", "parquet"):
        write_columns(tmp_path / f"r.{suffix}", columns)
        logs.append(read_reference(tmp_path / f"r.{suffix}"))
    for name in ("latitude", "height", "v_up"):
        np.testing.assert_array_equal(logs[0].values[name], logs[1].values[name])
    np.testing.assert_array_equal(logs[0].values["height"], values[1])


@given(
    interval=st.floats(1e-4, 1.0),
    start=st.floats(-1e3, 1e3),
    jitter=st.floats(0.0, 0.3),
    seed=st.integers(0, 10_000),
)
@few
def test_the_even_clock_behind_jitter_is_found(interval, start, jitter, seed):
    rng = np.random.default_rng(seed)
    time = start + interval * (np.arange(400) + jitter * rng.uniform(-1.0, 1.0, 400))
    line = fit_sample_clock(time)
    assert line is not None
    # A line through 400 stamps of uniform jitter: slope sigma sqrt(12/3) jitter 400^-1.5.
    assert line.interval == pytest.approx(interval, rel=6.0 * 2.0 * jitter / 400**1.5 + 1e-9)
    np.testing.assert_array_equal(line.slots, np.arange(400))


unit_vectors = arrays(np.float64, 3, elements=st.floats(-1, 1)).filter(
    lambda v: np.linalg.norm(v) > 0.1
)


@given(unit_vectors, angles, angles)
@few
def test_rotations_are_orthogonal_and_add_up(vector, one, two):
    axis = vector / np.linalg.norm(vector)
    C = rotation.axis_rotation(axis, one)
    np.testing.assert_allclose(C @ C.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(C) == pytest.approx(1.0, abs=1e-14)
    # Angles of 2e4 rad have their last digit at 4e-12.
    both = rotation.axis_rotation(axis, one + two)
    np.testing.assert_allclose(C @ rotation.axis_rotation(axis, two), both, atol=2e-11)
    np.testing.assert_allclose(C @ axis, axis, atol=1e-14)


@given(arrays(np.float64, (3, 4), elements=st.floats(-10, 10)))
@few
def test_quaternions_keep_lengths_and_are_undone_by_their_conjugates(phi):
    q = rotation.quaternion_from_vector(phi)
    np.testing.assert_allclose(np.sum(q**2, axis=0), 1.0, atol=1e-14)
    v = np.arange(12.0).reshape(3, 4)
    back = rotation.rotate(rotation.conjugate(q), rotation.rotate(q, v))
    np.testing.assert_allclose(back, v, atol=1e-12)


_ONE_AFTER_THE_OTHER = """
import json, sys
from rotcli.cli.main import main
for line in json.loads(sys.argv[1]):
    try:
        main([*line, "--quiet"])
    except SystemExit as stop:
        assert stop.code == 0, line
"""


def test_the_bytes_of_results_do_not_depend_on_locale_time_zone_hash_seed_or_threads(tmp_path):
    fixture = ROOT / "fixtures" / "nav440_rate_60"
    # The locales are those that every system has; decimal commas come from none of them, and no
    # part of the program asks for a locale (see the test below).
    worlds = (
        {"PYTHONHASHSEED": "1", "TZ": "UTC", "LC_ALL": "C", "OPENBLAS_NUM_THREADS": "1"},
        {
            "PYTHONHASHSEED": "777",
            "TZ": "Asia/Kathmandu",
            "LC_ALL": "C.UTF-8",
            "LANG": "de_DE.UTF-8",
            "OMP_NUM_THREADS": "2",  # sums by threads would have other last digits
        },
    )
    logs = [str(fixture / name) for name in ("imu.parquet", "table.parquet")]
    lines = (
        ["allan", logs[0], "-o", "a.json"],
        ["calibrate", *logs, "-o", "c.json", "--report-residuals", "r.csv"],
        ["navigate", *logs, "--calibration", "c.json", "-o", "n.json", "--solution", "s.parquet"],
        ["observe", *logs, "-o", "o.json"],
        ["report", "c.json", "n.json", "-o", "r.html"],
    )
    plain = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    made = []
    for k, world in enumerate(worlds):
        folder = tmp_path / str(k)
        folder.mkdir()
        subprocess.run(
            [sys.executable, "-c", _ONE_AFTER_THE_OTHER, json.dumps(lines)],
            cwd=folder,
            env={**plain, "PYTHONPATH": str(ROOT), **world},
            check=True,
        )
        made.append({p.name: p.read_bytes() for p in sorted(folder.iterdir())})
    assert made[0] == made[1]


def test_no_part_of_the_program_asks_for_a_locale_or_for_the_time():
    for path in (ROOT / "rotcli").rglob("*.py"):
        text = path.read_text()
        assert not re.search(
            r"\blocale\b|datetime\.(now|today|utcnow)|time\.(ctime|localtime|strftime)", text
        ), path


_THREADS = """
import os, numpy
numpy.ones((600, 600)) @ numpy.ones((600, 600))
print(len(os.listdir("/proc/self/task")))
"""


@pytest.mark.campaign
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads cannot be counted here")
def test_results_on_another_count_of_threads_are_the_same_to_twelve_digits(tmp_path):
    # 18000 samples: sums of more than ten thousand go to several threads.
    line = "simulate --imu nav440 --rate 20 --static 60 --rotation 60 --navigation 60 -o run"
    lines = (
        "calibrate run/imu.parquet run/table.parquet -o c.json",
        "navigate run/imu.parquet run/table.parquet --calibration c.json -o n.json",
        "observe run/imu.parquet run/table.parquet -o o.json",
        "allan run/imu.parquet --window 0:60 --axes gyro_z -o a.json",
    )
    made = []
    for count in ("1", "4"):
        folder = tmp_path / count
        folder.mkdir()
        world = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), count)
        options = {
            "cwd": folder,
            "env": {**os.environ, "PYTHONPATH": str(ROOT), **world},
            "check": True,
        }
        threads = subprocess.run(
            [sys.executable, "-c", _THREADS], capture_output=True, text=True, **options
        )
        if count == "4" and int(threads.stdout) < 2:
            pytest.skip("this numpy knows no threads")
        for text in (line, *lines):
            program = [sys.executable, "-m", "rotcli", *text.split(), "--quiet"]
            subprocess.run(program, **options)
        made.append([numbers_of(json.loads((folder / f"{k}.json").read_text())) for k in "cnoa"])
    for one, other in zip(*made, strict=True):
        assert one.keys() == other.keys()
        assert len(one) > 20
        for name, values in one.items():
            largest = max(map(abs, values))
            assert other[name] == pytest.approx(values, rel=1e-12, abs=1e-12 * largest), name


def numbers_of(value, name=""):
    """Return the numbers of a result document: name (without indices) to all its values."""
    found = {}
    if isinstance(value, dict):
        parts = [(f"{name}.{key}", item) for key, item in value.items() if key != "inputs"]
    elif isinstance(value, list):
        parts = [(name, item) for item in value]
    else:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return {name: [float(value)]} if number else {}
    for key, item in parts:
        for at, numbers in numbers_of(item, key).items():
            found.setdefault(at, []).extend(numbers)
    return found


@pytest.mark.parametrize("rate", [0.0, 10.0])
def test_the_covariance_stays_symmetric_and_positive_over_a_day(rate):
    # 24 h at 1 Hz, an update every 10 s.
    theta = rate * DEG * np.arange(86_401.0)
    C_nb = rotation.attitude_matrix(0.0, 0.5, 0.0)
    settings = zupt.Settings(
        latitude=0.9, gravity=9.81, C_nb=C_nb, axis=np.array([0.0, 0.0, 1.0]), samples=10
    )
    p = zupt.build_update_model(theta, 1.0, settings)
    P = p.gains(p.P0, covariances=True).posterior
    assert len(P) == 8640
    sigma = np.sqrt(np.einsum("kii->ki", P))
    scaled = P / (sigma[:, :, None] * sigma[:, None, :])
    # Rounding of 8640 steps, each 2e-16, which Joseph's form does not let grow.
    assert np.max(np.abs(scaled - np.swapaxes(scaled, 1, 2))) < 1e-9
    assert np.linalg.eigvalsh(scaled).min() > 0.0


@pytest.mark.parametrize(
    ("kind", "measured"),
    [
        ("two-stop", True),
        pytest.param("one-stop", False, marks=pytest.mark.campaign),
        pytest.param("one-stop", True, marks=pytest.mark.campaign),
        pytest.param("two-stop", False, marks=pytest.mark.campaign),
    ],
)
def test_the_covariance_of_a_voyage_stays_symmetric_and_positive_over_a_day(kind, measured):
    settings = FilterSettings(measured_damping=measured)
    # 24 h in steps of 10 s, a GNSS epoch each second except for an hour's outage.
    n = 86_400
    theta = RotationScheme(kind=kind).angle(np.arange(n + 1.0))
    epochs = np.ones(n, dtype=np.int64)
    epochs[40_000:43_600] = 0
    latitude = 42.3 * DEG
    velocity = np.ones((2, n + 1)) * [[1.0], [0.0]]
    steps = build_filter_model(theta, velocity, np.full(n + 1, latitude), 1.0, settings, epochs)
    P0 = np.diag(settings.initial_sigma(latitude) ** 2)
    gains = gain_sequence(steps, P0)
    assert gains.sigma.shape == (8640, 16)
    assert np.all(np.isfinite(gains.sigma))
    assert gains.sigma.min() > 0.0
    for k in range(0, 8640, 10):  # what the gains are made of, all along
        assert np.linalg.eigvalsh(gains.S[k]).min() > 0.0
    P = gains.covariance
    np.testing.assert_array_equal(P, P.T)
    scaled = P / np.outer(gains.sigma[-1], gains.sigma[-1])
    # The damping states are measured to 1e-6 m/s: in units of their sigmas, all the same, the
    # smallest eigenvalue is well above the rounding of 8640 steps.
    assert np.linalg.eigvalsh(scaled).min() > 1e-9
