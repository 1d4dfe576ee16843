"""Filter, line, repeated samples and flicker of the simulator are truth of the noise analysis."""

import numpy as np
import pytest

from rotcli.allan.deviation import averaging_factors, overlapping_variance, phase_from_rate
from rotcli.allan.estimate import allan
from rotcli.errors import RigError
from rotcli.models.reading_effects import ReadingEffects
from rotcli.rig.profile import read_profile
from rotcli.rig.scenario import Leg, Scenario
from rotcli.simulate.estimate import simulate
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR

N = 0.3  # deg/sqrt(h)


def still(
    tmp_path, gyro="", *, rate=100.0, seconds=600.0, seed=1, noise=f"angle_random_walk = {N}"
):
    path = tmp_path / "imu.toml"
    path.write_text(
        f"rate = {rate}\n[gyro]\n{noise}\n{gyro}\n[accel]\nvelocity_random_walk = 0.05\n"
    )
    scenario = Scenario(read_profile(str(path)), (Leg(seconds, 0.0),), seed=seed)
    return simulate(scenario).imu


def analysed(log):
    return allan(log, axes=["gyro_x", "gyro_y", "gyro_z"])


def z_of_n(result):
    found = [axis.fit.coefficients["random_walk"] for axis in result.axes.values()]
    return [(n.value / DEG_PER_ROOT_HOUR - N) / (n.sigma / DEG_PER_ROOT_HOUR) for n in found]


def test_a_low_pass_filter_is_found_and_n_is_that_before_it(tmp_path):
    result = analysed(still(tmp_path, "low_pass = 8.0"))
    for axis in result.axes.values():
        assert axis.spectrum.cutoff == pytest.approx(8.0, rel=0.25)
        assert axis.fit.coefficients["bias_instability"].value is None
    assert np.max(np.abs(z_of_n(result))) < 3.5
    assert [f.code for f in result.findings] == ["low-pass"]


def test_a_line_is_found_with_frequency_and_amplitude(tmp_path):
    result = analysed(still(tmp_path, "line_frequency = 0.5\nline_amplitude = 0.02"))
    for axis in result.axes.values():
        (line,) = axis.spectrum.lines
        assert line.frequency == pytest.approx(0.5, abs=0.005)
        assert line.amplitude / DEG == pytest.approx(0.02, rel=0.1)
    assert np.max(np.abs(z_of_n(result))) < 3.5


def test_held_samples_are_found_and_n_is_that_of_the_sensor(tmp_path):
    """The sensor of 100 Hz scatters by N sqrt(100 Hz), whatever the rate of the log."""
    log = still(tmp_path, "repeats = 10", rate=1000.0, seconds=200.0)
    result = analysed(log)
    assert {axis.spectrum.repeats for axis in result.axes.values()} == {10}
    # Each reading counts ten times: the density of the log is ten times that of the noise drawn.
    found = [axis.fit.coefficients["random_walk"] for axis in result.axes.values()]
    z = [(n.value / DEG_PER_ROOT_HOUR - N * np.sqrt(10)) / (n.sigma / DEG_PER_ROOT_HOUR)
         for n in found]  # fmt: skip
    assert np.max(np.abs(z)) < 3.5


def test_flicker_with_history_has_its_floor_at_all_cluster_times(tmp_path):
    """The mean Allan variance of 16 x 3 axes is (2 ln2/pi) B^2, also at a tenth of the log."""
    total = 0.0
    for seed in range(16):
        log = still(tmp_path, rate=10.0, seconds=2000.0, seed=seed,
                    noise="bias_instability = 20")  # fmt: skip
        factors = averaging_factors(len(log.gyro), None, 0.1)
        for axis in log.gyro.T:
            total += overlapping_variance(phase_from_rate(axis, 0.1), factors, 0.1)
    mean = total / 48 / DEG_PER_HOUR**2
    floor = 2.0 * np.log(2.0) / np.pi * 20.0**2
    inside = (0.1 * factors >= 2.0) & (0.1 * factors <= 200.0)
    # 48 x 10 degrees of freedom at 200 s: 6 %.
    assert mean[inside] == pytest.approx(np.full(inside.sum(), floor), rel=0.2)
    assert np.mean(mean[inside]) == pytest.approx(floor, rel=0.06)


def test_without_effects_the_readings_are_untouched():
    readings = np.random.default_rng(0).standard_normal((50, 3))
    assert ReadingEffects().apply(readings, 0.01) is readings


def test_a_constant_passes_every_effect_but_the_line():
    constant = np.tile([1.0, -2.0, 9.81], (200, 1))
    out = ReadingEffects(low_pass=5.0, repeats=4).apply(constant, 0.01)
    assert out == pytest.approx(constant, abs=1e-12)


def test_the_filter_halves_the_power_at_its_cut_off():
    time = 0.001 * np.arange(20_000)
    wave = np.sin(2 * np.pi * 40.0 * time)[:, None] * np.ones(3)
    out = ReadingEffects(low_pass=40.0).apply(wave, 0.001)
    assert np.var(out[5000:, 0]) == pytest.approx(0.25, rel=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("low_pass = 50", "half of rate or more"),
        ("line_frequency = 80", "half of rate or more"),
        ("repeats = 0", "out of range"),
        ("repeats = 2.5", "not an integer"),
        ("line_amplitude = -1", "out of range"),
        ("lowpass = 5", "unknown key"),
    ],
)
def test_impossible_effects_are_rejected_with_file_and_key(tmp_path, text, message):
    path = tmp_path / "imu.toml"
    path.write_text(f"[gyro]\n{text}\n")
    with pytest.raises(RigError, match=message) as fault:
        read_profile(str(path))
    assert str(fault.value).startswith(f"{path}: [gyro] ")


def test_an_effect_beyond_half_the_rate_is_rejected_in_arrays_too():
    with pytest.raises(ValueError, match="must be below 50 Hz"):
        ReadingEffects(low_pass=60.0).apply(np.zeros((10, 3)), 0.01)


def test_a_line_is_a_sine_on_x_and_120_and_240_deg_ahead_on_y_and_z():
    out = ReadingEffects(line_frequency=2.0, line_amplitude=0.3).apply(np.full((50, 3), 5.0), 0.01)
    time = 0.01 * np.arange(50)
    for axis, ahead in enumerate((0.0, 120.0, 240.0)):
        expected = 5.0 + 0.3 * np.sin(2.0 * np.pi * 2.0 * time + np.radians(ahead))
        np.testing.assert_allclose(out[:, axis], expected, atol=1e-13)
