from dataclasses import replace

import numpy as np
import pytest

from rotcli.allan import estimate
from rotcli.allan.estimate import allan
from rotcli.allan.fit.coefficients import NoiseFit
from rotcli.errors import LogError
from rotcli.files.channels import AXES
from rotcli.logs.record import ImuLog
from rotcli.models.sensors import NoiseFigures, noise
from rotcli.units import DEG_PER_HOUR, DEG_PER_ROOT_HOUR

INTERVAL = 0.1


def log_of(seconds, gyro=None, accel=None, seed=0):
    n = round(seconds / INTERVAL)
    rng = np.random.default_rng(seed)
    gyro = gyro or NoiseFigures(white=3 * DEG_PER_ROOT_HOUR)
    accel = accel or NoiseFigures(white=0.002)
    columns = [noise(rng.spawn(1)[0], n, INTERVAL, gyro) for _ in range(3)]
    columns += [noise(rng.spawn(1)[0], n, INTERVAL, accel) for _ in range(3)]
    values = np.array(columns)
    values[5] += 9.81
    return ImuLog(
        path="still.parquet",
        time=INTERVAL * np.arange(n),
        gyro=values[:3].T,
        accel=values[3:].T,
        interval=INTERVAL,
    )


@pytest.mark.parametrize("estimator", ["oadev", "adev", "mdev", "totdev"])
def test_every_axis_has_allantools_deviations(estimator):
    import allantools

    log = log_of(600)
    result = allan(log, estimator=estimator, taus=[0.1, 1.0, 30.0])
    assert list(result.axes) == list(AXES)
    for name, axis in result.axes.items():
        function = getattr(allantools, estimator)
        rate = log.column(name)
        _, expected, _, _ = function(rate, rate=10.0, data_type="freq", taus=[0.1, 1.0, 30.0])
        assert np.allclose(axis.deviation, expected, rtol=1e-12, atol=0)
        assert np.all(axis.lower < axis.deviation)
        assert np.all(axis.deviation < axis.upper)


def test_the_coefficients_do_not_depend_on_the_estimator_or_the_times():
    log = log_of(1200)
    first = allan(log, axes=["gyro_x"]).axes["gyro_x"].fit
    for estimator, taus in (("mdev", None), ("oadev", "octave"), ("totdev", "decade")):
        other = allan(log, axes=["gyro_x"], estimator=estimator, taus=taus).axes["gyro_x"].fit
        for name, found in first.coefficients.items():
            # The curve squared and rooted again: rounding.
            again = other.coefficients[name]
            assert (again.value or again.upper) == pytest.approx(found.value or found.upper, 1e-9)


def test_a_falling_curve_has_no_minimum_and_says_so():
    axis = allan(log_of(1200), axes=["gyro_x"]).axes["gyro_x"]
    assert axis.minimum.tau is None
    assert axis.minimum.reason.startswith("the curve still falls at")


def test_a_curve_without_a_noise_term_has_no_minimum():
    # A strong line leaves so few cluster times that no term is significant: no slope is known.
    fit = NoiseFit({}, np.zeros(4), ramp=0.0, trend=0.0, trend_sigma=1.0)
    curve = np.array([3.0, 1.0, 2.0])
    found = estimate._minimum(np.arange(1.0, 4.0), curve, curve, curve, np.full(3, 50.0), fit)
    assert found.tau is None
    assert found.reason == "no noise term is significant"


def test_a_minimum_is_the_lowest_sure_point():
    figures = NoiseFigures(white=0.4 * DEG_PER_ROOT_HOUR, rate_random_walk=3 * DEG_PER_HOUR)
    axis = allan(log_of(7200, figures), axes=["gyro_y"]).axes["gyro_y"]
    # sigma^2 = N^2/tau + K^2 tau/3 is lowest at tau = sqrt(3) N / K = 13.9 s, flat around.
    assert 8.0 < axis.minimum.tau < 25.0
    expected = np.sqrt(figures.allan_variance(np.array([13.9])))[0]
    assert axis.minimum.deviation == pytest.approx(expected, rel=0.1)
    assert axis.minimum.lower < axis.minimum.deviation < axis.minimum.upper
    assert axis.minimum.deviation == axis.deviation[axis.tau == axis.minimum.tau][0]


def test_a_drift_with_temperature_is_reported_as_rate_ramp():
    slope = 200 * DEG_PER_HOUR / 3600
    log = log_of(7200)
    log.gyro[:, 1] -= slope * log.time
    result = allan(log)
    found = result.axes["gyro_y"].fit
    ramp = found.coefficients["rate_ramp"]
    assert abs(ramp.value - slope) < 4 * ramp.sigma
    assert found.trend == pytest.approx(-ramp.value)
    assert result.axes["gyro_x"].fit.coefficients["rate_ramp"].value is None
    assert result.warnings == (
        "still.parquet: gyro_y has a linear trend, probably temperature; it is reported as rate "
        "ramp",
    )
    # Not swallowed: the curve ends on the ramp's R tau / sqrt(2).
    last = result.axes["gyro_y"]
    assert last.deviation[-1] == pytest.approx(slope * last.tau[-1] / np.sqrt(2), rel=0.1)
    assert last.gauss_markov.reason == "a linear trend remains in the record"


def test_motion_is_excluded_and_both_parts_are_pooled():
    log = log_of(600)
    log.gyro[4000:4200] += 0.5
    result = allan(log)
    first, second = result.segments
    assert first == (0.0, pytest.approx(399.0, abs=1.01))
    assert second == (pytest.approx(421.0, abs=1.01), pytest.approx(599.9))
    assert result.share == pytest.approx(0.965, abs=0.004)
    assert result.samples == pytest.approx(5790, abs=25)
    assert any("motion" in w for w in result.warnings)
    n = result.axes["gyro_x"].fit.coefficients["random_walk"]
    assert abs(n.value / (3 * DEG_PER_ROOT_HOUR) - 1) < 0.1


def test_a_dead_axis_is_rejected_by_name():
    log = log_of(60)
    log.accel[:, 2] = 9.81
    with pytest.raises(LogError, match=r"still.parquet: accel_z: the readings are constant"):
        allan(log)
    assert list(allan(log, axes=["gyro_z"]).axes) == ["gyro_z"]


def test_times_that_do_not_suit_are_refused_with_the_file():
    with pytest.raises(LogError, match=r"still.parquet: 0.25 s is no integer .* averaging times"):
        allan(log_of(60), taus=[0.25])
    with pytest.raises(LogError, match=r"still.parquet: mdev cannot be .* averaging times"):
        allan(log_of(60), taus=[0.1, 28.0], estimator="mdev")


def codes_of(result):
    return [finding.code for finding in result.findings]


def test_a_temperature_drift_is_named_and_not_taken_for_slow_noise():
    log = log_of(3600)
    temperature = 20.0 + 3.0 * np.sin(log.time / 500.0) ** 2
    log.gyro[:, 0] += 300 * DEG_PER_HOUR * temperature
    result = allan(replace(log, extras={"temperature": temperature}), axes=["gyro_x", "gyro_y"])
    axis = result.axes["gyro_x"]
    (drift,) = axis.drifts
    assert drift.kind == "temperature"
    assert drift.amplitude / DEG_PER_HOUR == pytest.approx(
        300.0, abs=4 * drift.sigma / DEG_PER_HOUR
    )
    assert codes_of(result) == ["temperature-drift"]
    assert "follows the temperature by " in result.warnings[0]
    for name in ("bias_instability", "rate_random_walk", "rate_ramp"):
        assert axis.fit.coefficients[name].value is None
    n = axis.fit.coefficients["random_walk"]
    assert abs(n.value - 3 * DEG_PER_ROOT_HOUR) < 3.5 * n.sigma
    # The curve is that of the readings, the other one without the drift.
    assert axis.deviation[-10] > 1.5 * axis.rest[-10]
    assert result.axes["gyro_y"].drifts == ()


@pytest.mark.parametrize(
    ("kind", "code", "drift"),
    [
        ("step", "bias-step", lambda time: 400.0 * (time > 2000.0)),
        ("exponential", "warm-up-drift", lambda time: 900.0 * np.exp(-time / 300.0)),
    ],
)
def test_a_step_and_a_warm_up_are_not_taken_for_random_walk(kind, code, drift):
    log = log_of(3600)
    log.gyro[:, 0] += drift(log.time) * DEG_PER_HOUR
    result = allan(log, axes=["gyro_x"])
    axis = result.axes["gyro_x"]
    assert codes_of(result) == [code]
    assert axis.drifts[0].kind == kind
    assert axis.fit.coefficients["rate_random_walk"].value is None
    n = axis.fit.coefficients["random_walk"]
    assert abs(n.value - 3 * DEG_PER_ROOT_HOUR) < 3.5 * n.sigma


def test_a_random_walk_is_not_taken_for_a_drift():
    figures = NoiseFigures(white=3 * DEG_PER_ROOT_HOUR, rate_random_walk=20 * DEG_PER_HOUR)
    axis = allan(log_of(3600, figures), axes=["gyro_x"]).axes["gyro_x"]
    assert axis.drifts == ()
    k = axis.fit.coefficients["rate_random_walk"]
    assert abs(k.value - 20 * DEG_PER_HOUR) < 3.5 * k.sigma
