"""The error budget against navigated logs, published figures and simulated random walks."""

import numpy as np
import pytest

from rotcli.budget import estimate as stage
from rotcli.budget import navigation
from rotcli.budget.estimate import ACCEL_BIAS, GYRO_BIAS, GYRO_INSTALLATION, GYRO_SCALE
from rotcli.budget.navigation import SensorError, navigation_errors
from rotcli.models.base import FixedBase
from rotcli.models.earth import normal_gravity
from rotcli.models.rotation import attitude_matrix
from rotcli.models.sensors import NoiseFigures, TriadErrors
from rotcli.navigate.estimate import navigate
from rotcli.navigate.place import prepare
from rotcli.rig.profile import Profile, Triad, read_profile
from rotcli.rig.rig import rig_from_dict
from rotcli.rig.scenario import Leg, Scenario
from rotcli.simulate.estimate import simulate
from tests.budget.linear_growth import linear_growth

DEG = np.pi / 180
DPH = DEG / 3600
QUIET = NoiseFigures()
LATITUDE, HEIGHT = 51.08 * DEG, 1100.0
LEVEL = FixedBase(LATITUDE, float(normal_gravity(LATITUDE, HEIGHT)), np.eye(3))
ERRORS = {  # of the size of a calibrated MEMS unit, no two alike
    ACCEL_BIAS: (np.array([0.010, -0.007, 0.008]), np.zeros((3, 3))),
    GYRO_BIAS: (np.array([75.0, -180.0, 115.0]) * DPH, np.zeros((3, 3))),
    GYRO_SCALE: (np.zeros(3), np.diag([2500e-6, -1800e-6, 3000e-6])),
    GYRO_INSTALLATION: (
        np.zeros(3),
        1e-6 * np.array([[0, 1200, -3800], [-1500, 0, 3600], [1000, -1300, 0]]),
    ),
}


def navigated(source, bias, matrix, axis, rate, seconds, attitude=(0.0, 0.0, 0.0)):
    """Simulate a log with one error only, navigate it and return its final errors (9,)."""
    none = (np.zeros(3), np.zeros((3, 3)))
    gyro, accel = (none, (bias, matrix)) if source == ACCEL_BIAS else ((bias, matrix), none)
    return navigated_log(gyro, accel, axis, rate, seconds, attitude)


def navigated_log(gyro, accel, axis, rate, seconds, attitude=(0.0, 0.0, 0.0)):
    """Simulate a noise-free log, (bias, matrix) each; navigate it; return the final errors (9,)."""
    triads = (Triad(*gyro, {}, None), Triad(*accel, {}, None))
    rig = {
        "site": {"latitude": LATITUDE / DEG, "longitude": -114.13, "height": HEIGHT},
        "attitude": {
            name: angle / DEG
            for name, angle in zip(("pitch", "roll", "azimuth"), attitude, strict=True)
        },
        "table": {"axis": axis},
        "stages": {"navigation": [0.0, seconds]},
    }
    scenario = Scenario(
        Profile("constant errors", 100.0, *triads),
        (Leg(seconds, rate),),
        rig=rig_from_dict(rig),
        ramp=0.0,
        encoder_step=0.0,
    )
    made = simulate(scenario)
    logs = prepare(made.imu, made.table, scenario.rig, need_static=False)
    return navigate(*logs, TriadErrors(), mode="full").final


def seen(final):
    """Return attitude (E, N, U) and velocity (E, N, U) errors of a level base facing north."""
    # Pitch error is eps_E, roll error eps_N, azimuth (clockwise) error -eps_U.
    return np.array([final[6], final[7], -final[8]]), final[[4, 3, 5]]


def unit(axis):
    return np.eye(3)["xyz".index(axis)]


@pytest.mark.parametrize("rate", [12.0, -60.0])
@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("source", [ACCEL_BIAS, GYRO_BIAS, GYRO_SCALE])
def test_a_log_with_one_error_shows_the_table_of_the_paper_after_one_turn(source, axis, rate):
    bias, matrix = ERRORS[source]
    expected = stage.closed_form(bias, matrix, LEVEL, unit(axis), rate * DEG)
    attitude, velocity = seen(navigated(source, bias, matrix, axis, rate * DEG, 360 / abs(rate)))
    shown = velocity if source == ACCEL_BIAS else attitude
    # One per cent of the magnitude: the Earth turns 2e-3 rad in 30 s.
    assert np.linalg.norm(shown - expected) < 0.01 * np.linalg.norm(expected)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_log_with_all_errors_shows_the_sum_of_the_budget_after_one_turn(axis):
    gyro = TriadErrors(
        0.1 * (ERRORS[GYRO_SCALE][1] + ERRORS[GYRO_INSTALLATION][1]), 0.1 * ERRORS[GYRO_BIAS][0]
    )
    accel = 0.1 * ERRORS[ACCEL_BIAS][0]
    found = stage.budget(gyro, accel, QUIET, LEVEL, rate=12 * DEG, axes=(axis,))
    attitude, velocity = seen(
        navigated_log((gyro.bias, gyro.matrix), (accel, np.zeros((3, 3))), axis, 12 * DEG, 30.0)
    )
    table = sum(t.closed_form for t in found.turns if t.source != ACCEL_BIAS)
    assert np.linalg.norm(attitude - table) < 0.01 * np.linalg.norm(table)
    total = sum(t.navigated.velocity for t in found.turns)
    assert np.linalg.norm(velocity - total) < 0.01 * np.linalg.norm(total)


def by_navigation(source, bias, matrix, axis, rate, seconds, base=LEVEL):
    """Return the final errors of the budget's navigation with one source."""
    none = (np.zeros(3), np.zeros((3, 3)))
    if source == ACCEL_BIAS:
        error = SensorError(*none, bias)
    else:
        error = SensorError(bias, matrix, np.zeros(3))
    u = unit(axis) if rate else np.zeros(3)
    return stage.NavigationError.at_end(navigation_errors(error, base, u, rate, seconds))


MOTIONS = [("x", 12.0, 30.0), ("y", 60.0, 63.0), ("z", -20.0, 300.0), ("z", 0.0, 300.0)]


@pytest.mark.parametrize(("axis", "rate", "seconds"), MOTIONS)
@pytest.mark.parametrize("source", list(ERRORS))
def test_every_component_of_a_log_with_one_error_comes_out_of_the_budget(
    source, axis, rate, seconds
):
    bias, matrix = ERRORS[source]
    found = by_navigation(source, bias, matrix, axis, rate * DEG, seconds)
    shown = navigated(source, bias, matrix, axis, rate * DEG, seconds)
    clean = navigated(source, 0 * bias, 0 * matrix, axis, rate * DEG, seconds)
    shown = shown - clean
    # Velocity and position at the size of real errors, tilts of up to 15 deg: 1e-3 of the largest
    # component (the height of the site changes the radius by 2e-4).
    for seen, expected, kernel in (
        (shown[[4, 3, 5]], found.velocity, 1e-6),
        (shown[[1, 0, 2]], found.position, 1e-4),
    ):
        np.testing.assert_allclose(seen, expected, atol=1e-3 * np.abs(expected).max() + kernel)


@pytest.mark.parametrize(("axis", "rate", "seconds"), MOTIONS)
@pytest.mark.parametrize("source", list(ERRORS))
def test_small_errors_grow_as_the_linear_equations_say(source, axis, rate, seconds):
    small = 1e-3
    bias, matrix = (small * part for part in ERRORS[source])
    found = by_navigation(source, bias, matrix, axis, rate * DEG, seconds)
    u = unit(axis) if rate else np.zeros(3)
    linear = linear_growth(source, bias, matrix, LEVEL, u, rate * DEG, seconds)
    for seen, expected, kernel in zip(
        vars(found).values(), linear, (3e-11, 1e-9, 1e-7), strict=True
    ):
        # Second order of tilts of 1e-4 rad, in attitude also the coning of ripples of 4e-6 rad.
        atol = 1e-3 * np.abs(expected).max() + kernel
        np.testing.assert_allclose(seen, expected, rtol=2e-3, atol=atol)


def test_a_tilt_of_15_deg_lowers_the_height_as_the_linear_equations_cannot():
    # NAV440 about z at 10 deg/s: the linear height error is 12.8 m, the navigated one 5.4 m.
    bias = read_profile("nav440").gyro.bias
    none = np.zeros((3, 3))
    linear = linear_growth(GYRO_BIAS, bias, none, LEVEL, unit("z"), 10 * DEG, 300.0)
    found = by_navigation(GYRO_BIAS, bias, none, "z", 10 * DEG, 300.0)
    shown = navigated(GYRO_BIAS, bias, none, "z", 10 * DEG, 300.0)
    assert linear[2][2] == pytest.approx(12.8, abs=0.05)
    assert shown[2] == pytest.approx(5.4, abs=0.05)
    assert found.position[2] == pytest.approx(shown[2], abs=0.01)


def test_navigation_does_not_depend_on_the_sampling(monkeypatch):
    bias, matrix = ERRORS[GYRO_BIAS]
    coarse = by_navigation(GYRO_BIAS, bias, matrix, "z", 50 * DEG, 300.0)
    monkeypatch.setattr(navigation, "_STEP", 0.5 * DEG)
    fine = by_navigation(GYRO_BIAS, bias, matrix, "z", 50 * DEG, 300.0)
    for name in ("attitude", "velocity", "position"):
        a, b = getattr(coarse, name), getattr(fine, name)
        np.testing.assert_allclose(a, b, atol=1e-5 * np.abs(b).max())


def test_the_velocity_of_a_modulated_gyro_bias_does_not_cancel_over_a_turn():
    # R16 states that it does. 2 pi g d / w^2 with d = 120 deg/h, w = 10 deg/s, g = 9.81: 1.177 m/s
    # to the east, 1 % less for the rotation of the Earth and gravity in the tilted axes.
    turn = stage.one_turn(
        "z", GYRO_BIAS, np.array([120.0, 0, 0]) * DPH, np.zeros((3, 3)), LEVEL, 10 * DEG
    )
    np.testing.assert_allclose(turn.navigated.velocity[:2], [1.177, 0.0], atol=0.01)
    within = turn.within
    assert within.angle[-1] == pytest.approx(2 * np.pi)
    # The error itself and the attitude do what R16 (10) to (25) say: d cos, d sin; d/w sin.
    middle = np.argmin(np.abs(within.angle - np.pi / 2))
    np.testing.assert_allclose(within.error[middle] / DPH, [0.0, 120.0, 0.0], atol=1e-9)
    expected = 120 * DPH / (10 * DEG) * np.array([1.0, 1.0])
    np.testing.assert_allclose(within.navigated.attitude[middle, :2], expected, rtol=1e-3)


@pytest.mark.parametrize(("seconds", "expected"), [(100.0, 100.0), (200.0, -160.0)])
def test_an_attitude_error_is_a_rotation_vector_of_half_a_turn_at_most(seconds, expected):
    # 1 deg/s about up; the tilt that the Earth makes of it is below a degree.
    bias = np.array([0.0, 0.0, 1.0]) * DEG
    found = by_navigation(GYRO_BIAS, bias, np.zeros((3, 3)), "z", 0.0, seconds)
    assert found.attitude[2] / DEG == pytest.approx(expected, abs=0.5)
    assert np.hypot(*found.attitude[:2]) / DEG < 2.0


def test_a_turn_of_more_than_an_hour_is_not_navigated():
    slow = stage.one_turn("z", GYRO_BIAS, np.ones(3) * DPH, np.zeros((3, 3)), LEVEL, 0.05 * DEG)
    assert slow.within is None
    assert slow.navigated is None


def test_the_table_alone_is_right_for_installation_errors_that_the_rotation_does_not_excite():
    # Turning about z excites the column Kgxz, Kgyz. Without it the table's entry is all there is;
    # with it the Earth turning under the ripple makes as much again.
    bias, matrix = ERRORS[GYRO_INSTALLATION]
    calm = matrix * [1, 1, 0]

    def difference(part):
        shown = [
            seen(navigated(GYRO_INSTALLATION, bias, sign * part, "z", 12 * DEG, 30.0))[0]
            for sign in (1, -1)
        ]
        entry = stage.closed_form(bias, part, LEVEL, unit("z"), 12 * DEG)
        return np.linalg.norm(0.5 * (shown[0] - shown[1]) - entry) / np.linalg.norm(entry)

    assert difference(calm) < 0.01
    assert difference(matrix) > 1.0


def test_growth_follows_the_square_and_the_cube_of_time():
    found = stage.budget(
        TriadErrors(bias=np.array([10.0, 20.0, 30.0]) * DPH),
        np.array([0.01, 0.02, 0.03]),
        QUIET,
        FixedBase(0.0, 9.8, np.eye(3)),
        rate=10 * DEG,
        duration=100.0,
    )
    rows = {(g.axis, g.source): g.unmodulated for g in found.growth}
    # b t = 0.01 x 100, b t^2 / 2 = 0.01 x 1e4 / 2; up for z; all three without rotation.
    np.testing.assert_allclose(rows["x", ACCEL_BIAS].velocity, [1.0, 0, 0])
    np.testing.assert_allclose(rows["x", ACCEL_BIAS].position, [50.0, 0, 0])
    np.testing.assert_allclose(rows["z", ACCEL_BIAS].position, [0, 0, 150.0])
    np.testing.assert_allclose(rows["still", ACCEL_BIAS].position, [50.0, 100.0, 150.0])
    # A tilt that grows about east drives to the south: g d t^2 / 2, g d t^3 / 6.
    d = 10 * 4.84813681109536e-06
    np.testing.assert_allclose(rows["x", GYRO_BIAS].velocity, [0, -9.8 * d * 1e4 / 2, 0])
    np.testing.assert_allclose(rows["x", GYRO_BIAS].position, [0, -9.8 * d * 1e6 / 6, 0])
    np.testing.assert_allclose(rows["y", GYRO_BIAS].position, [9.8 * 2 * d * 1e6 / 6, 0, 0])
    np.testing.assert_allclose(rows["z", GYRO_BIAS].position, [0, 0, 0])
    np.testing.assert_allclose(rows["z", GYRO_BIAS].attitude, [0, 0, 3 * d * 100])


def test_the_quadrature_has_converged(monkeypatch):
    base = FixedBase(LATITUDE, 9.81, attitude_matrix(0.2, -0.3, 1.0))

    def figures():
        stage._gauss.cache_clear()
        return [
            stage.integrated(*parts, base, unit(axis), 10 * DEG)
            for axis in "xyz"
            for parts in ERRORS.values()
        ]

    ours = figures()
    monkeypatch.setattr(stage, "_NODES", 96)
    finest = figures()
    monkeypatch.undo()
    stage._gauss.cache_clear()
    # 1e-12 of what is added up before it cancels: some 0.02 rad in the turn.
    np.testing.assert_allclose(ours, finest, rtol=1e-12, atol=2e-14)


def _budget(gyro=None, accel=(0.0, 0.0, 0.0), **given):
    given = {"rate": 10 * DEG, **given}
    return stage.budget(gyro or TriadErrors(), np.array(accel), QUIET, LEVEL, **given)


def test_narrowing_to_one_axis_keeps_its_rows_and_standing_still():
    found = _budget(accel=(0.01, 0.02, 0.03), axes=("y",))
    assert {t.axis for t in found.turns} == {"y"}
    assert {g.axis for g in found.growth} == {"y", "still"}
    assert len(found.turns) == 4


def test_all_sources_together_are_not_the_sum_of_the_sources():
    profile = read_profile("mti-g")
    found = _budget(TriadErrors(profile.gyro.matrix, profile.gyro.bias), profile.accel.bias)
    for scheme, total in found.totals.items():
        parts = sum(g.navigated.position for g in found.growth if g.axis == scheme)
        off = np.linalg.norm(parts - total.position) / np.linalg.norm(total.position)
        assert off > 1e-3
    small = _budget(TriadErrors(1e-4 * profile.gyro.matrix, 1e-4 * profile.gyro.bias))
    for scheme, total in small.totals.items():
        parts = sum(g.navigated.position for g in small.growth if g.axis == scheme)
        np.testing.assert_allclose(parts, total.position, atol=1e-3 * np.abs(parts).max())


def test_a_base_on_its_side_turns_the_budget_with_it():
    # Azimuth 90 deg: the body's x axis points south, y east.
    base = FixedBase(LATITUDE, 9.81, attitude_matrix(0.0, 0.0, np.pi / 2))
    none = np.zeros((3, 3))
    along_x = stage.closed_form(np.array([0.01, 0.02, 0.03]), none, base, unit("x"), 10 * DEG)
    np.testing.assert_allclose(along_x, [0.0, -0.36, 0.0], atol=1e-15)


def test_sensors_without_errors_navigate_without_errors():
    none = SensorError(np.zeros(3), np.zeros((3, 3)), np.zeros(3))
    base = FixedBase(LATITUDE, 9.81, attitude_matrix(0.1, 0.2, 0.3))
    found = navigation_errors(none, base, unit("z"), 10 * DEG, 72.0)
    for part in (found.attitude, found.velocity, found.position):
        np.testing.assert_allclose(part, 0.0, atol=1e-14)
