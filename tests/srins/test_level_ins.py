"""The level-channel mechanization against the true voyage and against its linear model."""

import numpy as np
import pytest

from rotcli.models import earth, rotation
from rotcli.rig.profile import Triad
from rotcli.srins import level_ins, model
from rotcli.srins.model import Damping, VehicleMotion
from rotcli.srins.voyage.scenario import MICRO_G, Maneuver, SrinsScenario
from rotcli.srins.voyage.simulate import Voyage, imu_chunks
from rotcli.units import DEG_PER_HOUR, HOUR

UP = np.array([0.0, 0.0, 1.0])
ARCSEC = np.pi / 180 / 3600


def constant(gyro=0.0, accel=0.0):
    """Sensors without noise: biases (rad/s, m/s^2) on each axis."""
    zero = np.zeros((3, 3))
    return {
        "gyro": Triad(np.full(3, gyro), zero, {}, None),
        "accel": Triad(np.full(3, accel), zero, {}, None),
    }


def increments_of(scenario, block=1.0):
    samples = round(block * scenario.rate)
    return level_ins.LevelIncrements.join(
        [
            level_ins.preintegrate_means(chunk.gyro, chunk.accel, scenario.interval, samples)
            for chunk in imu_chunks(scenario)
        ]
    )


def start_of(scenario, phi=(0.0, 0.0, 0.0)):
    voyage = Voyage(scenario)
    theta = float(voyage.theta(np.zeros(1))[0])
    C = rotation.rotate_about(UP, np.full(3, theta), np.eye(3)).T
    tilt = rotation.matrix_from_quaternion(rotation.quaternion_from_vector(-np.array(phi)))
    v = voyage.velocity(np.zeros(1))[:, 0]
    q = rotation.quaternion_from_matrix(tilt @ C)
    return level_ins.LevelState(q, v, scenario.latitude, scenario.longitude)


def navigate(scenario, damping=None, phi=(0.0, 0.0, 0.0), block=1.0):
    increments = increments_of(scenario, block)
    middle = block * (np.arange(len(increments)) + 0.5)
    v_ref = Voyage(scenario).velocity(middle)
    return level_ins.mechanize(increments, start_of(scenario, phi), v_ref, damping or Damping())


def errors(scenario, solution, block=1.0):
    """Return INS - truth of the states but the sensor errors, (11, n)."""
    voyage = Voyage(scenario)
    time = block * np.arange(solution.latitude.shape[0], dtype=float)
    theta, zero = voyage.theta(time), np.zeros(len(time))
    true = np.stack([np.cos(theta / 2), zero, zero, np.sin(theta / 2)])
    q = rotation.multiply(solution.q_ns, rotation.conjugate(true))
    latitude, longitude = voyage.position(time)
    return np.concatenate(
        [
            solution.velocity - voyage.velocity(time),
            -2.0 * q[1:] * np.sign(q[0]),
            [solution.latitude - latitude, solution.longitude - longitude],
            solution.u,
        ]
    )


@pytest.mark.parametrize("rate", [1.0, 10.0])
@pytest.mark.parametrize("switch", [1.0, 0.0])
def test_ideal_sensors_lead_along_the_true_voyage(rate, switch):
    scenario = SrinsScenario(
        duration=4 * HOUR,
        rate=rate,
        v_north=1.0,
        azimuth=0.5,
        maneuvers=(Maneuver(HOUR, 20.0, 0.1, 0.05),),
        **constant(),
    )
    error = errors(scenario, navigate(scenario, Damping(enabled=switch)))
    # Second order in blocks of 1 s; the maneuver's corners cost most: 1e-5 m/s, 5 cm, against
    # 0.1 m/s and 100 m that a drift of 0.003 deg/h makes in this time.
    assert np.abs(error[:2]).max() < 2e-5
    assert np.abs(error[5:7]).max() * earth.SEMI_MAJOR_AXIS < 0.05
    assert np.abs(error[2:5]).max() < 1e-8


def linear_errors(scenario, damping, phi, count):
    """Return the linear model's errors (11, count + 1) for constant sensor errors."""
    motion = VehicleMotion(scenario.latitude, scenario.v_east, scenario.v_north)
    scheme_rates = np.diff(Voyage(scenario).theta(np.arange(count + 1.0))).round(9)
    Phi = {
        rate: model.transition_matrix(model.srins_error_dynamics_n(motion, damping, rate), 1.0)
        for rate in set(scheme_rates)
    }
    x = np.zeros(16)
    x[2:5], x[7:10], x[10:12] = phi, scenario.gyro.bias, scenario.accel.bias[:2]
    trace = [x]  # the voyage starts at theta = 0: s is n
    for rate in scheme_rates:
        x = Phi[rate] @ x
        trace.append(x)
    states = np.array(trace).T
    return np.concatenate([states[:7], states[12:]])


LEVEL, TILTED = (0.0, 0.0, 0.0), (10.0, -20.0, 60.0)


@pytest.mark.parametrize(
    ("phi", "switch"),
    [
        (TILTED, 1.0),
        pytest.param(LEVEL, 0.0, marks=pytest.mark.campaign),
        pytest.param(LEVEL, 1.0, marks=pytest.mark.campaign),
        pytest.param(TILTED, 0.0, marks=pytest.mark.campaign),
    ],
)
def test_over_34_hours_the_linear_model_follows_the_nonlinear_one(phi, switch):
    scenario = SrinsScenario(rate=10.0, **constant(0.003 * DEG_PER_HOUR, 20 * MICRO_G))
    damping, phi = Damping(enabled=switch), np.array(phi) * ARCSEC
    nonlinear = errors(scenario, navigate(scenario, damping, phi))
    linear = linear_errors(scenario, damping, phi, nonlinear.shape[1] - 1)
    peak = np.abs(linear).max(axis=1)
    # 0.3 % of each state's peak: what the radii's change with latitude and squares make.
    assert np.all(np.abs(nonlinear - linear).max(axis=1) < 3e-3 * peak)


def test_instants_of_a_smooth_motion_sum_to_the_increments_of_its_means():
    # A rotation without corners within the block: turning on through a complete hour.
    scenario = SrinsScenario(
        duration=60.0, rate=20.0, rotation_rate=np.radians(3.0), rotation_kind="one-stop",
        **constant(),
    )  # fmt: skip
    voyage = Voyage(scenario)
    means = increments_of(scenario)
    fine = voyage_instants(voyage, scenario)
    instants = level_ins.preintegrate_instants(*fine, scenario.interval, 20)
    np.testing.assert_allclose(instants.heading_increment, means.heading_increment, atol=1e-12)
    # Means within the sample were summed in closed form; the trapezoid's own error is 1e-8.
    np.testing.assert_allclose(instants.level_rotation, means.level_rotation, atol=1e-11)
    np.testing.assert_allclose(instants.dv, means.dv, atol=1e-9)


def voyage_instants(voyage, scenario):
    """Return gyro and accel (n + 1, 3) at instants of a voyage that turns at one rate."""
    time = np.arange(round(scenario.duration * scenario.rate) + 1) / scenario.rate
    theta, v = voyage.theta(time), voyage.velocity(time)
    latitude, _ = voyage.position(time)
    w, coriolis, _ = level_ins.level_rates(v, v, latitude)
    rate = -scenario.rotation_rate
    c, s = np.cos(theta), np.sin(theta)
    _, R_N = earth.radii(latitude)
    g = earth.normal_gravity(latitude, 0.0)
    up = g - (2 * earth.EARTH_RATE * np.cos(latitude) + v[0] / R_N) * v[0]
    fe, fn = -coriolis * v[1], coriolis * v[0]
    gyro = np.stack([c * w[0] + s * w[1], c * w[1] - s * w[0], w[2] + rate], axis=1)
    return gyro, np.stack([c * fe + s * fn, c * fn - s * fe, up], axis=1)


def test_many_runs_at_once_are_the_runs_one_by_one():
    scenario = SrinsScenario(duration=600.0, **constant(0.01 * DEG_PER_HOUR, 50 * MICRO_G))
    one = increments_of(scenario)
    start, v_ref = start_of(scenario), np.ones((2, len(one))) * [[1.0], [0.0]]
    alone = level_ins.mechanize(one, start, v_ref, Damping())
    three = level_ins.LevelIncrements(
        one.duration,
        *(
            np.repeat(x[..., None], 3, axis=-1)
            for x in (one.heading_increment, one.level_rotation, one.dv)
        ),
    )
    three.dv[0, :, 1] += 1e-3
    many = level_ins.mechanize(three, start, np.repeat(v_ref[..., None], 3, axis=-1), Damping())
    np.testing.assert_allclose(many.velocity[..., 0], alone.velocity, atol=1e-13)
    np.testing.assert_allclose(many.velocity[..., 2], alone.velocity, atol=1e-13)
    assert np.abs(many.velocity[..., 1] - alone.velocity).max() > 0.1


def test_a_voyage_can_be_gone_on_with_where_it_was_left():
    scenario = SrinsScenario(duration=600.0, **constant(0.01 * DEG_PER_HOUR, 50 * MICRO_G))
    complete = navigate(scenario)
    parts = increments_of(scenario)
    v_ref = np.ones((2, 600)) * [[1.0], [0.0]]
    state = start_of(scenario)
    for part in (slice(0, 250), slice(250, 600)):
        some = level_ins.LevelIncrements(
            1.0, parts.heading_increment[part], parts.level_rotation[:, part], parts.dv[:, part]
        )
        solution = level_ins.mechanize(some, state, v_ref[:, part], Damping())
        state = solution.last
    np.testing.assert_allclose(solution.u[:, -1], complete.u[:, -1], atol=1e-15)
    np.testing.assert_allclose(solution.latitude[-1], complete.latitude[-1], rtol=1e-15)
