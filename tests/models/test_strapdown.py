"""The kernel against exact table motion, and against a textbook integration of free motion."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from rotcli.models import earth, rotation, strapdown
from rotcli.models.strapdown import geography
from rotcli.models.turntable import Schedule, ScheduleStep, Turntable

DEG = np.pi / 180
LATITUDE, LONGITUDE, HEIGHT = 51.08 * DEG, -114.13 * DEG, 1100.0
INTERVAL, SAMPLES = 0.01, 30_001
TIME = INTERVAL * np.arange(SAMPLES)

# Asked for are 0.1 mm and 1e-7 deg after 300 s; the sixth order leaves rounding, a hundredth of it.
POSITION, ANGLE = 1e-6, 1e-9 * DEG


def _turntable(axis, motion, tilt):
    piece = (
        ScheduleStep(400.0, sweep=100 * DEG)
        if motion == "sweep"
        else ScheduleStep(400.0, rate=motion * DEG)
    )
    return Turntable(
        LATITUDE,
        HEIGHT,
        rotation.attitude_matrix(tilt * DEG, -0.5 * tilt * DEG, 2 * tilt * DEG),
        np.array(rotation.UNIT_VECTORS[axis]),
        Schedule((piece,)),
    )


@pytest.mark.parametrize("averages", [False, True], ids=["instant", "increment"])
@pytest.mark.parametrize("tilt", [0, 30])
@pytest.mark.parametrize("motion", [0, 10, 50, 100, "sweep"])
@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_error_free_input_stays_where_it_is(axis, motion, tilt, averages):
    table = _turntable(axis, motion, tilt)
    w, f = table.average(TIME, INTERVAL) if averages else table.sense(TIME)
    start = strapdown.InitialState(LATITUDE, LONGITUDE, HEIGHT, np.zeros(3), table.C_nb)
    path = strapdown.mechanize_log(w, f, INTERVAL, start, averages=averages)

    R_M, R_N = earth.radii(LATITUDE)
    assert np.abs((path.latitude - LATITUDE) * (R_M + HEIGHT)).max() < POSITION
    east = (path.longitude - LONGITUDE) * (R_N + HEIGHT) * np.cos(LATITUDE)
    assert np.abs(east).max() < POSITION
    assert np.abs(path.height - HEIGHT).max() < POSITION
    # 0.1 mm over 300 s and more of jitter-free motion is 1e-6 m/s.
    assert np.abs(path.v_n).max() < 1e-5
    angle = table.schedule.motion(TIME)[0]
    expected = table.C_nb @ rotation.axis_rotation(table.axis, angle)
    deviations = rotation.matrix_from_quaternion(path.q_ns) - expected
    assert np.abs(deviations).max() < ANGLE


_TEXTBOOK = [1e-15, 1e-15, 1e-9, 1e-10, 1e-10, 1e-10]  # rad, rad, m, m/s


def _textbook(start, f_i, seconds, hold=False):
    """Integrate v' = f + g - (2 w_ie + w_en) x v in n with an adaptive Runge-Kutta of order 8.

    hold: the vertical acceleration is zero.
    """

    def derivative(t, y):
        latitude, longitude, height, *v = y
        v = np.array(v)
        R_M, R_N = earth.radii(latitude)
        w_ie = earth.earth_rate_n(latitude)
        east = v[0] / (R_N + height)
        w_en = np.array([-v[1] / (R_M + height), east, east * np.tan(latitude)])
        C_ni = earth.C_ne(latitude, longitude) @ _C_ei(t) @ earth.C_ne(*start[:2]).T
        g = float(earth.normal_gravity(latitude, height))
        a = C_ni @ f_i(t) - np.array([0, 0, g]) - np.cross(2 * w_ie + w_en, v)
        a[2] = 0.0 if hold else a[2]
        rates = [v[1] / (R_M + height), east / np.cos(latitude), v[2]]
        return [*rates, *a]

    return solve_ivp(
        derivative, (0, seconds), start, method="DOP853", rtol=1e-13, atol=_TEXTBOOK, max_step=5.0
    ).y[:, -1]


def _C_ei(t):
    return Rotation.from_rotvec([0, 0, -earth.EARTH_RATE * t]).as_matrix()


@pytest.mark.parametrize("hold", [False, True])
def test_free_motion_agrees_with_a_textbook_integration(hold):
    # A sensor that does not rotate against inertial space starts with 36 m/s; its force oscillates.
    seconds, v0 = 300.0, np.array([20.0, -30.0, 0.0 if hold else 5.0])
    t = INTERVAL * np.arange(30_001)
    g = float(earth.normal_gravity(LATITUDE, HEIGHT))

    def force(t):
        wave = np.sin(2 * np.pi * t / 60.0)
        return np.stack([0.02 * wave, 0.01 + 0.0 * t, g + 0.03 * wave], axis=-1)

    w = np.zeros((len(t), 3))
    start = strapdown.InitialState(LATITUDE, LONGITUDE, HEIGHT, v0, np.eye(3))
    path = strapdown.mechanize_log(w, force(t), INTERVAL, start, hold_height=hold)
    end = _textbook([LATITUDE, LONGITUDE, HEIGHT, *v0], force, seconds, hold=hold)
    # A group of cells is up to 20 m long, which errs by 3e-11 m/s^2.
    _assert_same(path, end, 3e-6)
    if hold:
        np.testing.assert_allclose(path.height, HEIGHT, rtol=0.0, atol=1e-8)
        np.testing.assert_array_equal(path.v_n[:, 2], 0.0)


def _assert_same(path, end, position):
    R_M, _ = earth.radii(LATITUDE)
    assert abs(path.latitude[-1] - end[0]) * R_M < position
    assert abs(path.longitude[-1] - end[1]) * R_M < position
    assert abs(path.height[-1] - end[2]) < position
    # Over 300 s a velocity error grows to a position error.
    np.testing.assert_allclose(path.v_n[-1], end[3:], atol=position / 100.0)


@pytest.mark.parametrize("hold", [False, True])
def test_a_fast_sensor_leaves_the_range_of_the_series_and_agrees_with_a_textbook(hold):
    seconds, v0 = 300.0, np.array([2000.0, -2200.0, 0.0])
    t = INTERVAL * np.arange(30_001)
    force = np.tile([0.0, 0.1, 9.8], (len(t), 1))
    start = strapdown.InitialState(LATITUDE, LONGITUDE, HEIGHT, v0, np.eye(3))
    path = strapdown.mechanize_log(np.zeros((len(t), 3)), force, INTERVAL, start, hold_height=hold)
    end = _textbook([LATITUDE, LONGITUDE, HEIGHT, *v0], lambda t: force[0], seconds, hold=hold)
    # In a cell of 0.32 s the sensor moves 960 m and the vertical rotates by 1.5e-4 rad. The mean
    # of gravity differs from gravity at the mean by up to 5e-8 m/s^2, 2 mm in 300 s and 900 km;
    # the vertical force that is removed has 0.05 m/s^2.
    _assert_same(path, end, 2e-2 if hold else 4e-3)


@pytest.mark.parametrize("hold", [False, True])
def test_a_sensor_half_an_hour_away_from_its_start_agrees_with_a_textbook(hold):
    # 500 km from the start the vertical has rotated by 5 deg, and the start's gravity with it.
    seconds, v0 = 1800.0, np.array([200.0, -220.0, 0.0])
    t = 0.02 * np.arange(90_001)

    def force(t):
        # Upward at the moving sensor: a rotation with its speed.
        angle = 300.0 / 6.4e6 * t
        return 9.8 * np.stack([0.67 * np.sin(angle), -0.74 * np.sin(angle), np.cos(angle)], -1)

    start = strapdown.InitialState(LATITUDE, LONGITUDE, HEIGHT, v0, np.eye(3))
    path = strapdown.mechanize_log(np.zeros((len(t), 3)), force(t), 0.02, start, hold_height=hold)
    end = _textbook([LATITUDE, LONGITUDE, HEIGHT, *v0], force, seconds, hold=hold)
    # In a cell of 0.64 s the sensor moves 190 m: 2e-9 m/s^2 of gravity. The vertical that a block
    # of 328 s takes with height hold is extrapolated: 0.1 m of 500 km.
    _assert_same(path, end, 0.2 if hold else 0.02)


@pytest.mark.parametrize("speed", [5.0, 20.0, 300.0])
def test_series_and_exact_coordinates_agree(speed, monkeypatch):
    t = INTERVAL * np.arange(20_001)
    force = np.tile([0.0, 0.0, 9.81], (len(t), 1))
    velocity = np.array([speed, -0.7 * speed, 0.1 * speed])
    start = strapdown.InitialState(LATITUDE, LONGITUDE, HEIGHT, velocity, np.eye(3))
    w = np.tile([0.3, -0.2, 0.1], (len(t), 1))
    series = strapdown.mechanize_log(w, force, INTERVAL, start)
    monkeypatch.setattr(geography, "_MAX_REACH", 0.0)
    exact = strapdown.mechanize_log(w, force, INTERVAL, start)
    # Rounding of a longitude of 2 rad is 2 nm. The exact latitude is a formula for low heights:
    # 18 km below the surface its error changes by 5e-15 rad in a cell.
    near = np.abs(exact.height) < 5e3
    assert near.sum() > 3000
    for name, scale in (("latitude", 6.4e6), ("longitude", 6.4e6), ("height", 1.0)):
        difference = (getattr(series, name) - getattr(exact, name))[near]
        assert np.abs(difference).max() * scale < (4e-7 if name == "height" else 1e-8)
    np.testing.assert_allclose(series.v_n, exact.v_n, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(series.q_ns, exact.q_ns, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("averages", [False, True])
def test_a_lever_arm_moves_the_sensor_on_a_circle(averages):
    # 400 deg/s: a group of cells is more than a turn, so the circle is aliased.
    table = replace(_turntable("x", 400, 30), lever_arm=np.array([0.02, 0.3, -0.2]), gravity=None)
    t = TIME[:20_001]
    w, f = table.average(t, INTERVAL) if averages else table.sense(t)
    angle = table.schedule.motion(t)[0]
    C = table.C_nb @ rotation.axis_rotation(table.axis, angle)
    arm_n = C @ table.lever_arm
    v_n = C[0] @ np.cross(400 * DEG * table.axis, table.lever_arm)
    start = strapdown.InitialState(LATITUDE, LONGITUDE, HEIGHT, v_n, C[0], arm_n[0])
    path = strapdown.mechanize_log(w, f, INTERVAL, start, averages=averages)
    R_M, R_N = earth.radii(LATITUDE)
    east = (path.longitude - LONGITUDE) * (R_N + HEIGHT) * np.cos(LATITUDE)
    moved = np.stack([east, (path.latitude - LATITUDE) * (R_M + HEIGHT), path.height - HEIGHT])
    # Values from means err by (w h)^6 / 140 = 8e-10 of gravity: 1.7e-4 m in 200 s.
    np.testing.assert_allclose(moved.T, arm_n, atol=3e-4 if averages else 1e-5)


def test_a_horizontal_velocity_error_swings_with_the_schuler_period():
    # 84.4 minutes; the Earth's rotation (Foucault) leaves the first zero within a few per mille.
    seconds = 1800.0
    t = 0.1 * np.arange(int(seconds / 0.1) + 1)
    table = Turntable(
        LATITUDE, HEIGHT, np.eye(3), np.array([0.0, 0, 1]), Schedule((ScheduleStep(seconds),))
    )
    w, f = table.sense(t)
    start = strapdown.InitialState(
        LATITUDE, LONGITUDE, HEIGHT, np.array([0.0, 1.0, 0.0]), np.eye(3)
    )
    path = strapdown.mechanize_log(w, f, 0.1, start, hold_height=True)
    speed = np.hypot(path.v_n[:, 0], path.v_n[:, 1])
    R_M, _ = earth.radii(LATITUDE)
    g = float(earth.normal_gravity(LATITUDE, HEIGHT))
    quarter = 0.5 * np.pi * np.sqrt((R_M + HEIGHT) / g)
    assert t[np.argmin(speed)] == pytest.approx(quarter, rel=0.02)


def test_a_gravity_given_replaces_the_normal_one():
    g = 9.79
    C = np.eye(3)
    table = Turntable(
        LATITUDE, HEIGHT, C, np.array([0.0, 0, 1]), Schedule((ScheduleStep(60.0),)), gravity=g
    )
    w, f = table.sense(TIME[:6001])
    start = strapdown.InitialState(LATITUDE, LONGITUDE, HEIGHT, np.zeros(3), C)
    kept = strapdown.mechanize_log(w, f, INTERVAL, start, gravity=g)
    fell = strapdown.mechanize_log(w, f, INTERVAL, start)
    assert np.abs(kept.height - HEIGHT).max() < POSITION
    lost = 0.5 * (g - float(earth.normal_gravity(LATITUDE, HEIGHT))) * 60.0**2
    assert fell.height[-1] - HEIGHT == pytest.approx(lost, rel=0.01)


@pytest.mark.parametrize("n", [2, 3, 4, 5, 6, 7])
def test_short_windows_work_too(n):
    table = _turntable("z", 10, 0)
    for averages in (False, True):
        w, f = table.average(TIME[:n], INTERVAL) if averages else table.sense(TIME[:n])
        start = strapdown.InitialState(LATITUDE, LONGITUDE, HEIGHT, np.zeros(3), table.C_nb)
        path = strapdown.mechanize_log(w, f, INTERVAL, start, averages=averages)
        assert path.height.shape == (n,)
        assert np.abs(path.height - HEIGHT).max() < 1e-9


@pytest.mark.parametrize("averages", [False, True])
@pytest.mark.parametrize("n", [31, 33, 16_383, 16_385, 16_420, 16_421, 16_422])
def test_lengths_next_to_those_of_cells_and_blocks_work_too(n, averages):
    table = _turntable("y", 50, 30)
    t = INTERVAL * np.arange(n)
    w, f = table.average(t, INTERVAL) if averages else table.sense(t)
    start = strapdown.InitialState(LATITUDE, LONGITUDE, HEIGHT, np.zeros(3), table.C_nb)
    path = strapdown.mechanize_log(w, f, INTERVAL, start, averages=averages)
    assert path.q_ns.shape == (4, n)
    assert np.abs(path.height - HEIGHT).max() < POSITION
    assert np.abs(path.v_n).max() < 1e-8


def test_two_mechanizations_that_take_turns_do_not_disturb_each_other():
    # Both use the same memory for their blocks.
    tables = [_turntable(axis, 50, 30) for axis in "xz"]
    inputs = [table.sense(TIME[:20_000]) for table in tables]
    starts = [
        strapdown.InitialState(LATITUDE, LONGITUDE, HEIGHT, np.zeros(3), table.C_nb)
        for table in tables
    ]
    pair = [strapdown.Mechanization(INTERVAL, start) for start in starts]
    first = [m.advance(w[:17_000], f[:17_000]) for m, (w, f) in zip(pair, inputs, strict=True)]
    rest = [
        m.advance(w[17_000:], f[17_000:], last=True) for m, (w, f) in zip(pair, inputs, strict=True)
    ]
    for start, (w, f), a, b in zip(starts, inputs, first, rest, strict=True):
        alone = strapdown.mechanize_log(w, f, INTERVAL, start)
        np.testing.assert_array_equal(np.concatenate([a.v_n, b.v_n]), alone.v_n)


def test_a_long_log_is_navigated_in_windows_without_a_seam():
    table = _turntable("x", 100, 0)
    w, f = table.sense(TIME)
    bias = np.array([1e-4, -2e-4, 3e-4])
    start = strapdown.InitialState(LATITUDE, LONGITUDE, HEIGHT, np.zeros(3), table.C_nb)
    complete = strapdown.mechanize_log(w, f + bias, INTERVAL, start)
    steps = np.diff(complete.v_n[:, 2])
    # Velocity steps are the force times 10 ms: no jump at a window's edge.
    assert np.abs(np.diff(steps)).max() < 1e-4 * INTERVAL


@pytest.mark.parametrize("averages", [False, True])
@pytest.mark.parametrize("hold", [False, True])
def test_a_log_in_parts_comes_out_as_in_one(averages, hold):
    """Parts of any length, with the state carried over, equal the complete to rounding."""
    rng = np.random.default_rng(3)
    n = 36_000
    t = INTERVAL * np.arange(n)
    w = np.array([0.0, 0.4, 0.0]) + 0.5 * np.sin(t)[:, None] * np.array([1.0, 0.3, 2.0])
    w += 0.01 * rng.standard_normal((n, 3))
    f = np.array([0.1, -0.2, 9.8]) + 0.02 * rng.standard_normal((n, 3))
    start = strapdown.InitialState(
        LATITUDE, LONGITUDE, HEIGHT, np.array([1.0, 2.0, 0.0]), np.eye(3), np.full(3, 0.1)
    )
    complete = strapdown.mechanize_log(w, f, INTERVAL, start, averages=averages, hold_height=hold)
    carried = strapdown.Mechanization(INTERVAL, start, averages=averages, hold_height=hold)
    edges = [0, 2, 3003, 16_421, 16_422, 17_005, 32_806, n]
    parts = [carried.advance(w[a:b], f[a:b], last=b == n) for a, b in pairwise(edges)]
    assert [len(part.height) for part in parts] == [0, 0, 16_384, 0, 0, 16_384, 3232]
    radius = 6.4e6
    for name, scale in (("latitude", radius), ("longitude", radius), ("height", 1.0)):
        joined = np.concatenate([getattr(part, name) for part in parts])
        # The last digit of a latitude is 0.7 nm, and the way is kilometres long.
        assert np.abs(joined - getattr(complete, name)).max() * scale < 4e-9
    v_n = np.concatenate([part.v_n for part in parts])
    np.testing.assert_allclose(v_n, complete.v_n, rtol=0.0, atol=1e-11)
    q_ns = np.concatenate([part.q_ns for part in parts], axis=1)
    np.testing.assert_allclose(q_ns, complete.q_ns, rtol=0.0, atol=5e-13)


def test_a_height_that_runs_away_stays_a_number():
    n = 40_000  # 11 hours at 1 Hz: an unaided height grows e-fold in ten minutes
    start = strapdown.InitialState(LATITUDE, LONGITUDE, HEIGHT, np.zeros(3), np.eye(3))
    for excess in (0.05, -0.05):
        f = np.tile([0.0, 0.0, 9.8 + excess], (n, 1))
        path = strapdown.mechanize_log(np.zeros((n, 3)), f, 1.0, start)
        assert np.isfinite(path.height).all()
        assert np.isfinite(path.v_n).all()
        assert np.abs(path.height[-1]) > 1e5
