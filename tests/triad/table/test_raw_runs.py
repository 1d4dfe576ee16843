"""Raw logs from end to end: exact simulation, reduction to blocks, estimate."""

import numpy as np
import pytest

from rotcli.logs.record import ImuLog
from rotcli.logs.table_axes import AxesLog
from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.sensors import NoiseFigures, noise
from rotcli.models.triad import parameters as p
from rotcli.models.triad import sequences
from rotcli.models.triad.motion import MotionBuilder
from rotcli.models.triad.sensor import readings
from rotcli.rig.rig import rig_from_dict
from rotcli.simulate.sequence import SequenceSetup, simulate_sequence
from rotcli.triad.drift import Drift
from rotcli.triad.estimate import estimate
from rotcli.triad.table.reduction import ImuClock, Samples, TableLog, reduce_logs
from rotcli.triad.table.run import TriadOptions, calibrate_on_table
from rotcli.triad.table.steps import encoder_noise, find_steps
from rotcli.units import DEG, DEG_PER_HOUR
from tests.triad import bench

_ENCODER = 1e-5 * DEG


def _setup(nominal):
    return SequenceSetup(
        nominal.axes, nominal.C_nb, nominal.mountings, nominal.latitude, nominal.gravity
    )


def _truth(rng, problem):
    x = np.zeros(p.count())
    x[problem.free] = rng.standard_normal(len(problem.free)) * problem.size
    for k in (p.BASE_AZIMUTH, p.GRAVITY):
        x[k] = rng.standard_normal() * problem.prior_sigma[k]
    x[[p.CLOCK_GYRO, p.CLOCK_ACCEL]] = rng.uniform(-0.6e-3, 6.4e-3, 2)
    return x


def _logs(rng, nominal, motion, x, *, sigma, sampling="instant", encoder=_ENCODER):
    log = simulate_sequence(_setup(nominal), motion, x, sampling=sampling)
    y = np.column_stack([log.gyro, log.accel]) + sigma * rng.standard_normal((len(log.time), 6))
    angles = log.angles + encoder * rng.standard_normal(log.angles.shape)
    return y, TableLog(log.table_time, angles)


def _calibrate(problem, y, table, *, shift=0.0, chunk=30_000, **options):
    chunks = (Samples(k, y[k : k + chunk]) for k in range(0, len(y), chunk))
    blocks, variance, _ = reduce_logs(chunks, ImuClock(-shift, 0.01), len(y), table)
    return estimate(problem, blocks, **options), blocks, variance


def _errors(problem, fit, x):
    return (fit.x - x)[problem.free] / (fit.sigma[problem.free] / fit.scale)


def test_the_simulator_agrees_with_the_model_that_it_does_not_share():
    # Newton-Euler recursion against sums over axes: they differ by the centrifugal force of the
    # Earth's rotation at the lever (5e-9 times 60 mm).
    nominal, x = bench.three_axes(), bench.spot_parameters()
    motion = sequences.m5().motion()
    x[[p.CLOCK_GYRO, p.CLOCK_ACCEL]] = 0.0
    log = simulate_sequence(_setup(nominal), motion, x)
    end = motion.start[0] + motion.duration  # a complete number of samples: the last is at it
    assert (log.time[-1], log.table_time[-1]) == pytest.approx((end, end), abs=1e-6)
    at = np.arange(7, len(log.time), 501)
    found = np.column_stack([log.gyro, log.accel])[at]
    expected = readings(nominal, x, *motion.at(log.time[at])).T
    np.testing.assert_allclose(found[:, :3], expected[:, :3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[:, 3:], expected[:, 3:], rtol=0, atol=2e-9)


def test_clock_offsets_delay_the_motion_exactly_across_kinks():
    nominal, x = bench.three_axes(), np.zeros(p.count())
    motion = sequences.m5().motion()
    x[p.CLOCK_GYRO], x[p.CLOCK_ACCEL] = 0.004, -0.003
    log = simulate_sequence(_setup(nominal), motion, x)
    k = int(np.searchsorted(log.time, motion.start[1]))  # the first sample after a kink
    late, early = (motion.at(np.array([log.time[k] - tau])) for tau in (0.004, -0.003))
    x[:] = 0.0
    gyro, accel = (readings(nominal, x, *m)[:, 0] for m in (late, early))
    np.testing.assert_allclose(log.gyro[k], gyro[:3], atol=1e-12)
    np.testing.assert_allclose(log.accel[k], accel[3:], atol=2e-9)


def test_increments_are_the_integrals_of_the_readings():
    nominal, x = bench.three_axes(), bench.spot_parameters()
    b = MotionBuilder(3)
    b.spin(1, 60 * DEG, 0.2)
    motion = b.motion()
    coarse = simulate_sequence(_setup(nominal), motion, x, sampling="increment")
    fine = simulate_sequence(_setup(nominal), motion, x, rate=10_000.0)
    for name in ("gyro", "accel"):
        values, total = getattr(fine, name), getattr(coarse, name)
        running = np.concatenate([[np.zeros(3)], np.cumsum(0.5 * (values[1:] + values[:-1]), 0)])
        expected = np.diff(running[::100], axis=0) * 1e-4
        # Trapezoids of 0.1 ms miss the kinks of the motion by h^2 of the rate's slope.
        np.testing.assert_allclose(total[1 : len(expected) + 1], expected, atol=3e-7)


def test_noise_free_logs_return_every_parameter_within_a_tenth_of_a_sigma():
    rng = np.random.default_rng(7)
    problem = bench.problem(bench.three_axes())
    x = _truth(rng, problem)
    y, table = _logs(rng, problem.table, sequences.m5().motion(), x, sigma=0.0)
    fit, _, _ = _calibrate(problem, y, table)
    by_priors = {p.BASE_AZIMUTH, p.GRAVITY, p.INDEX["Kax"], p.INDEX["Kay"], p.INDEX["Kaz"]}
    at = [k for k, q in enumerate(problem.free) if q not in by_priors]
    assert np.abs(_errors(problem, fit, x)[at]).max() < 0.1


@pytest.mark.parametrize("sampling", ["average", "increment"])
def test_means_and_increments_are_as_good_as_instants(sampling):
    rng = np.random.default_rng(8)
    problem = bench.problem(bench.three_axes())
    x = _truth(rng, problem)
    motion = sequences.m5().motion()
    y, table = _logs(rng, problem.table, motion, x, sigma=0.0, sampling=sampling)
    y = y / 0.01 if sampling == "increment" else y
    fit, _, _ = _calibrate(problem, y, table, shift=0.005)
    by_priors = {p.BASE_AZIMUTH, p.GRAVITY, p.INDEX["Kax"], p.INDEX["Kay"], p.INDEX["Kaz"]}
    at = [k for k, q in enumerate(problem.free) if q not in by_priors]
    assert np.abs(_errors(problem, fit, x)[at]).max() < 0.3


def test_a_coarse_encoder_costs_little():
    # 16 bits: 0.0055 deg. Its steps are averaged by the cubics of the blocks.
    rng = np.random.default_rng(9)
    problem = bench.problem(bench.three_axes())
    x = _truth(rng, problem)
    y, table = _logs(rng, problem.table, sequences.m5().motion(), x, sigma=bench.SIGMA_1)
    step = 2.0 * np.pi / 2**16
    coarse = TableLog(table.time, np.round(table.angles / step) * step)
    fit, blocks, _ = _calibrate(problem, y, coarse)
    assert encoder_noise(coarse.angles) == pytest.approx(step / np.sqrt(12), rel=0.6)
    assert blocks.count.sum() > 0.7 * len(y)
    assert fit.chi2 / fit.dof == pytest.approx(1.0, abs=0.06)
    assert np.abs(_errors(problem, fit, x)).max() < 4.5


def test_chunks_of_any_size_give_the_same_blocks():
    rng = np.random.default_rng(10)
    problem = bench.problem(bench.three_axes())
    x = _truth(rng, problem)
    y, table = _logs(rng, problem.table, sequences.m5().motion(), x, sigma=bench.SIGMA_1)
    _, one, variance = _calibrate(problem, y, table, chunk=len(y))
    _, many, again = _calibrate(problem, y, table, chunk=997)
    np.testing.assert_allclose(one.means, many.means, atol=1e-12)
    np.testing.assert_allclose(np.sqrt(variance), bench.SIGMA_1, rtol=0.03)
    np.testing.assert_allclose(again, variance, rtol=0.02)  # pairs across chunks are left out


def test_steps_of_a_log_are_those_of_its_motion():
    motion = sequences.m5().motion()
    t = np.arange(0.0, motion.duration, 0.02)
    angles = motion.at(t)[0].T
    steps = find_steps(t, angles)
    # Where a spin is reversed both ramps are one step of constant acceleration.
    for begin, end in zip(steps.start + 0.06, steps.end - 0.06, strict=True):
        inside = motion.at(np.linspace(begin, end, 20))[2]
        np.testing.assert_allclose(inside, np.broadcast_to(inside[:, :1], inside.shape))
    assert (steps.end - steps.start).sum() > 0.98 * motion.duration
    assert not steps.still.any()


@pytest.mark.campaign
def test_20_raw_logs_are_consistent_from_end_to_end():
    problem = bench.problem(bench.three_axes())
    motion = sequences.s1(10.0, 100.0).motion()
    squares, ratios, clock = [], [], []
    for seed in range(20):
        rng = np.random.default_rng(1000 + seed)
        x = _truth(rng, problem)
        y, table = _logs(rng, problem.table, motion, x, sigma=bench.SIGMA_1)
        fit, _, _ = _calibrate(problem, y, table)
        error = _errors(problem, fit, x)
        squares.append(float(np.mean(error**2)))
        ratios.append(fit.chi2 / fit.dof)
        clock.append(error[list(problem.free).index(p.CLOCK_ACCEL)])
    # 20 runs of 54 correlated values: pooled within 0.9 to 1.1, each run within 0.7 to 1.3.
    assert 0.9 < np.sqrt(np.mean(squares)) < 1.1
    assert np.sqrt(min(squares)) > 0.7
    assert np.sqrt(max(squares)) < 1.3
    assert np.abs(np.array(ratios) - 1.0).max() < 0.03
    assert np.abs(clock).max() < 3.5


@pytest.mark.campaign
def test_sigmas_contain_flicker_and_random_walk_of_a_mems_imu():
    problem = bench.problem(bench.three_axes())
    motion = sequences.s1().motion()
    gyro = NoiseFigures(bias_instability=15.66 * DEG_PER_HOUR, rate_random_walk=0.35 * DEG_PER_HOUR)
    accel = NoiseFigures(bias_instability=4.5e-4)
    figures = (gyro,) * 3 + (accel,) * 3
    drift = Drift(tuple(SlowNoise.from_figures(f) for f in figures), 0.01)
    errors, ratios = [], []
    for seed in range(20):
        rng = np.random.default_rng(500 + seed)
        x = _truth(rng, problem)
        y, table = _logs(rng, problem.table, motion, x, sigma=bench.SIGMA_1)
        slow = np.column_stack([noise(rng, len(y), 0.01, f) for f in figures])
        fit, _, _ = _calibrate(problem, y + slow, table, drift=drift)
        # The bias of a run is the constant plus the mean of the slow noise in it.
        x[p.GYRO_BIAS] += slow[:, :3].mean(axis=0)
        x[p.ACCEL_BIAS] += slow[:, 3:].mean(axis=0)
        errors.append((fit.x - x)[problem.free] / fit.sigma[problem.free])
        ratios.append(fit.chi2 / fit.dof)
    # 20 runs of 54 correlated values: spread of the pooled rms about 0.025.
    assert 0.93 < np.sqrt(np.mean(np.square(errors))) < 1.07
    assert np.abs(np.array(ratios) - 1.0).max() < 0.03


def test_a_clock_that_runs_fast_is_found(tmp_path):
    rng = np.random.default_rng(12)
    problem = bench.problem(bench.three_axes())
    y, table = _logs(rng, problem.table, sequences.m5().motion(), np.zeros(60), sigma=bench.SIGMA_1)
    rig = rig_from_dict(
        {"site": {"latitude": 51.08, "height": 1100.0}, "table": {"axes": ["z", "x", "y"]},
         "imu": {"angle_random_walk": 0.4, "velocity_random_walk": 0.05}}
    )  # fmt: skip
    time = 0.01 * np.arange(len(y))
    imu = ImuLog("imu", time, y[:, :3], y[:, 3:], 0.01, rows=len(y))
    codes = {}
    for name, factor in (("right", 1.0), ("fast", 1.0 + 5e-6)):
        t = table.time * factor
        log = AxesLog("table", t, table.angles, 0.02, len(t), (), None)
        result = calibrate_on_table(imu, log, rig, TriadOptions())
        codes[name] = [f.code for f in result.findings]
    assert codes["right"] == []
    assert "clock-drift" in codes["fast"]


def test_blocks_with_samples_that_are_not_finite_are_excluded():
    rng = np.random.default_rng(13)
    problem = bench.problem(bench.three_axes())
    motion = sequences.m5().motion()
    y, table = _logs(rng, problem.table, motion, np.zeros(p.count()), sigma=bench.SIGMA_1)
    _, every, _ = _calibrate(problem, y, table)
    y[5000:5003] = np.nan
    fit, rest, variance = _calibrate(problem, y, table)
    assert len(rest) == len(every) - 1
    assert np.all(np.isfinite(fit.x))
    np.testing.assert_allclose(np.sqrt(variance), bench.SIGMA_1, rtol=0.03)
