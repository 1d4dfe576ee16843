"""The error budget against navigated logs, published figures and simulated random walks."""

import numpy as np
import pytest

from rotcli.budget import estimate as stage
from rotcli.budget.estimate import ACCEL_BIAS, GYRO_BIAS, GYRO_INSTALLATION, GYRO_SCALE
from rotcli.models.base import FixedBase
from rotcli.models.earth import normal_gravity
from rotcli.models.rotation import attitude_matrix
from rotcli.models.sensors import NoiseFigures, TriadErrors
from rotcli.navigate.estimate import navigate, prepare
from rotcli.rig.profile import Profile, Triad, read_profile
from rotcli.rig.rig import rig_from_dict
from rotcli.rig.scenario import Leg, Scenario
from rotcli.simulate.estimate import simulate

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
    # One per cent of the whole: the Earth turns 2e-3 rad in 30 s.
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


@pytest.mark.parametrize(
    ("axis", "rate", "seconds"), [("x", 12.0, 30.0), ("y", 60.0, 63.0), ("z", -20.0, 300.0)]
)
@pytest.mark.parametrize("source", list(ERRORS))
def test_every_component_of_a_log_with_one_error_comes_out_as_navigated(
    source, axis, rate, seconds
):
    bias, matrix = (0.1 * part for part in ERRORS[source])
    found = stage.navigated(source, bias, matrix, LEVEL, unit(axis), rate * DEG, seconds)
    plus = navigated(source, bias, matrix, axis, rate * DEG, seconds)
    minus = navigated(source, -bias, -matrix, axis, rate * DEG, seconds)
    # Half the difference: what is second order in the errors (coning, tilt squared) drops out.
    shown = 0.5 * (plus - minus)
    # Pitch error is eps_E, roll error eps_N, azimuth (clockwise) error -eps_U.
    parts = {
        "attitude": (shown[[6, 7, 8]] * [1, 1, -1], 1e-9),
        "velocity": (shown[[4, 3, 5]], 1e-7),
        "position": (shown[[1, 0, 2]], 1e-5),
    }
    for name, (seen, kernel) in parts.items():
        expected = getattr(found, name)
        # 1 % of each component; below 1e-4 of the largest third order effects (tilts of 0.02 rad
        # squared) are seen, and below `kernel` the accuracy of the integration.
        atol = 1e-4 * np.abs(expected).max() + kernel
        np.testing.assert_allclose(seen, expected, rtol=0.01, atol=atol, err_msg=name)


@pytest.mark.parametrize("source", [ACCEL_BIAS, GYRO_BIAS])
def test_standing_still_is_navigated_too(source):
    bias, matrix = (0.1 * part for part in ERRORS[source])
    found = stage.navigated(source, bias, matrix, LEVEL, np.zeros(3), 0.0, 300.0)
    plus, minus = (navigated(source, sign * bias, matrix, "z", 0.0, 300.0) for sign in (1, -1))
    shown = 0.5 * (plus - minus)[[1, 0, 2]]
    # Tilts up to 1.5 deg, second order taken out by the difference, third order left.
    largest = np.abs(found.position).max()
    np.testing.assert_allclose(shown, found.position, rtol=0.01, atol=1e-4 * largest)


def test_the_table_alone_holds_for_installation_errors_that_the_turning_does_not_excite():
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
    # b t = 0.01 x 100, b t^2 / 2 = 0.01 x 1e4 / 2; up for z; all three standing still.
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
        return [
            (
                stage.integrated(*parts, base, unit(axis), 10 * DEG),
                *vars(stage.navigated(source, *parts, base, unit(axis), 10 * DEG, 40.0)).values(),
            )
            for axis in "xyz"
            for source, parts in ERRORS.items()
        ]

    ours = figures()
    monkeypatch.setattr(stage, "_NODES", 96)
    stage._transitions.cache_clear()
    finest = figures()
    stage._transitions.cache_clear()
    for row, finer in zip(ours, finest, strict=True):
        # 1e-12 of what is added up before it cancels: some 0.02 rad in the turn, and g t, g t^2
        # times that as velocity and position; of 0.3 m/s for the accelerometers.
        for value, other, atol in zip(row, finer, (2e-14, 2e-14, 8e-12, 3e-10), strict=True):
            np.testing.assert_allclose(value, other, rtol=1e-12, atol=atol)


@pytest.mark.parametrize(("name", "bias"), [("mti-g", 23.2), ("nav440", 3.1)])
def test_white_noise_gives_the_published_calibration_errors(name, bias):
    # R16 table 6, MTi-G and NAV440, ppm at 10 and 80 deg/s, 60 s.
    published = {"mti-g": (645.5, 80.7), "nav440": (86.1, 10.8)}[name]
    noise = NoiseFigures(**read_profile(name).gyro.noise)
    for rate, ppm in zip((10.0, 80.0), published, strict=True):
        row = stage.calibration_sigmas(noise, 60.0, rate * DEG)
        # To the printed digit.
        assert row.bias_white / DPH == pytest.approx(bias, abs=0.05)
        assert row.column_white / 1e-6 == pytest.approx(ppm, abs=0.1)
        assert row.column == pytest.approx(row.bias / (rate * DEG))
        assert row.bias > row.bias_white


@pytest.mark.parametrize(("name", "lowest"), [("mti-g", 24.0), ("nav440", 11.0)])
def test_the_best_calibration_time_is_the_published_lowest_point_near_120_s(name, lowest):
    noise = NoiseFigures(**read_profile(name).gyro.noise)
    best, is_minimum = stage.best_calibration_time(noise)
    assert is_minimum
    times = np.linspace(10.0, 600.0, 5901)
    sigma = np.sqrt(noise.allan_variance(times))
    assert best == pytest.approx(times[np.argmin(sigma)], abs=0.1)
    assert best == pytest.approx(120.0, rel=0.05)
    # R16 figure 6, read to a whole deg/h.
    assert stage.calibration_sigmas(noise, best, DEG).bias / DPH == pytest.approx(lowest, rel=0.05)


def test_without_a_rate_random_walk_the_best_time_is_where_white_noise_meets_the_floor():
    noise = NoiseFigures(white=2e-4, bias_instability=1e-5)
    best, is_minimum = stage.best_calibration_time(noise)
    assert not is_minimum
    floor = 1e-5 * np.sqrt(2 * np.log(2) / np.pi)
    assert 2e-4 / np.sqrt(best) == pytest.approx(floor)
    assert stage.calibration_sigmas(noise, best, DEG).bias == pytest.approx(np.sqrt(2) * floor)


@pytest.mark.parametrize("noise", [NoiseFigures(white=1e-4), NoiseFigures(bias_instability=1e-5)])
def test_without_two_noises_against_each_other_there_is_no_best_time(noise):
    assert stage.best_calibration_time(noise) == (None, False)


def test_a_random_walk_leaves_the_predicted_error_at_the_end_of_the_stretch():
    # Truth is the bias at the end of the stretch: that is what navigation starts with.
    N, K, T, n, runs = 3e-4, 2e-5, 60.0, 600, 4000
    rng = np.random.default_rng(4)
    dt = T / n
    walk = np.cumsum(K * np.sqrt(dt) * rng.standard_normal((runs, n)), axis=1)
    read = walk + N / np.sqrt(dt) * rng.standard_normal((runs, n))
    error = read.mean(axis=1) - walk[:, -1]
    row = stage.calibration_sigmas(NoiseFigures(white=N, rate_random_walk=K), T, DEG)
    # A standard deviation from 4000 runs is good to 1.1 %; four of them.
    assert error.std() == pytest.approx(row.bias, rel=0.045)
    assert row.bias > 2 * row.bias_white


def _budget(gyro=None, accel=(0.0, 0.0, 0.0), **given):
    given = {"rate": 10 * DEG, **given}
    return stage.budget(gyro or TriadErrors(), np.array(accel), QUIET, LEVEL, **given)


def test_narrowing_to_one_axis_keeps_its_rows_and_standing_still():
    found = _budget(accel=(0.01, 0.02, 0.03), axes=("y",))
    assert {t.axis for t in found.turns} == {"y"}
    assert {g.axis for g in found.growth} == {"y", "still"}
    assert len(found.turns) == 4


def test_a_growth_beyond_small_tilts_is_warned_of():
    found = _budget(TriadErrors(bias=np.array([0.0, 1800 * DPH, 0.0])))
    # 0.5 deg/s for 300 s is 150 deg, less 2 % that position feeds back.
    assert [text.split(",")[0] for text in found.warnings] == ["turning about y", "standing still"]
    assert "the tilt after 300 s comes to 147 deg" in found.warnings[0]
    assert "take a shorter --duration" in found.warnings[0]
    assert _budget(TriadErrors(bias=np.array([0.0, 60 * DPH, 0.0]))).warnings == ()


def test_a_base_on_its_side_turns_the_budget_with_it():
    # Azimuth 90 deg: the body's x axis points south, y east.
    base = FixedBase(LATITUDE, 9.81, attitude_matrix(0.0, 0.0, np.pi / 2))
    none = np.zeros((3, 3))
    along_x = stage.closed_form(np.array([0.01, 0.02, 0.03]), none, base, unit("x"), 10 * DEG)
    np.testing.assert_allclose(along_x, [0.0, -0.36, 0.0], atol=1e-15)
