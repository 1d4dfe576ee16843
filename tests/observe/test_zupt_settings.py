"""Settings of the filter on a log: calibration, window, noise figures, and what is refused."""

import numpy as np
import pytest

from rotcli.errors import LogError, RigError, RotcliError
from rotcli.logs.record import TableLog
from rotcli.models.sensors import TriadErrors
from rotcli.observe.zupt import Options, filter_log, noise_from_rig
from rotcli.observe.zupt.model import Noise
from rotcli.rig.rig import rig_from_dict
from rotcli.units import DEG_PER_HOUR, PPM
from tests.observe.zupt_runs import FIGURES, simulated


def test_a_residual_scale_factor_is_shown_with_what_the_calibration_removed():
    imu, table, rig, profile = simulated("z", 30.0, legs=((30.0, 0.0), (60.0, 20.0), (60.0, -20.0)))
    column = profile.gyro.matrix @ rig.table.axis
    removed = TriadErrors(np.outer(column + 500.0 * PPM, rig.table.axis))
    options = Options(scale=1000.0 * PPM)
    e = filter_log(imu, table, rig, options, removed).estimates
    assert (np.abs(e.values[-1, 12:] - column) < 4.0 * e.sigma[-1, 12:]).all()
    assert (np.abs(e.values[-1, 12:] - column - 500.0 * PPM) > 300.0 * PPM).any()


def test_a_calibration_is_applied_first_and_its_biases_are_part_of_the_estimates():
    imu, table, rig, profile = simulated()
    matrix = np.outer(profile.gyro.matrix @ rig.table.axis, rig.table.axis)
    plain = filter_log(imu, table, rig, Options(), TriadErrors(matrix))
    near = profile.gyro.bias + 30.0 * DEG_PER_HOUR
    shifted = filter_log(
        imu, table, rig, Options(), TriadErrors(matrix, near), TriadErrors(bias=profile.accel.bias)
    )
    a, b = (r.estimates.values[-1, 6:12] for r in (plain, shifted))
    # The prior of 500 deg/h and 0.02 m/s^2 is centred elsewhere: a hundredth of the shift.
    np.testing.assert_allclose(a[3:], b[3:], atol=10.0 * DEG_PER_HOUR)
    np.testing.assert_allclose(a[:3], b[:3], atol=1e-4)


def test_what_is_left_after_a_calibration_counts_in_the_gyros_own_scale():
    """The gyro reads (I + N) w + d: what is estimated of w is N larger in d."""
    imu, table, rig, _ = simulated("z", 30.0, legs=((100.0, 0.0),))
    large = TriadErrors(np.diag([0.2, 0.0, 0.0]))
    plain = filter_log(imu, table, rig, Options())
    scaled = filter_log(imu, table, rig, Options(), large).estimates.values[-1, 9]
    # 750 deg/h of bias and 13 of Earth rate are read as (b + w) / 1.2 - w; back in the gyro's own
    # terms that is b less a fifth of the Earth's rate, 1.2 times what the filter contains.
    b = plain.estimates.values[-1, 9]
    assert scaled == pytest.approx(b, abs=6.0 * DEG_PER_HOUR)
    assert abs(b) > 500.0 * DEG_PER_HOUR  # so that a fifth of it would show


def test_averaged_samples_and_a_window_are_respected():
    averages = {**FIGURES, "sampling": "average"}
    imu, table, rig, profile = simulated(legs=((80.0, 60.0),), imu=averages)
    assert imu.sampling == "average"
    matrix = np.outer(profile.gyro.matrix @ rig.table.axis, rig.table.axis)
    result = filter_log(imu, table, rig, Options(window=(10.0, 70.0)), TriadErrors(matrix))
    assert result.settings.samples_are_means
    assert (result.start, result.end) == pytest.approx((10.0, 70.0), abs=0.011)
    assert result.estimates.time[-1] == pytest.approx(70.0, abs=0.11)
    miss = result.estimates.values[-1, 9:12] - profile.gyro.bias
    assert (np.abs(miss) < 4.0 * result.estimates.sigma[-1, 9:12]).all()


def test_noise_figures_come_from_the_rig_or_are_said_to_be_assumed():
    noise, warnings = noise_from_rig(rig_from_dict({}))
    assert noise == Noise()
    assert "assumed" in warnings[0]
    assert "accel_bias_instability 0.0005 m/s^2" in warnings[0]
    noise, warnings = noise_from_rig(rig_from_dict({"imu": FIGURES}))
    assert not warnings
    # 2 sigma^2 / T is the walk's K^2 with what the instability adds.
    drive = 2.0 * noise.gyro_markov_sigma**2 / noise.gyro_correlation_time
    K, B = 2.6 * DEG_PER_HOUR, 8.3 * DEG_PER_HOUR
    assert drive == pytest.approx(K**2 + 2.0 * (3.0 * B) ** 2 / 120.0)
    datasheet, _ = noise_from_rig(rig_from_dict({"imu": {"bias_instability": 24.0}}))
    assert datasheet.gyro_markov_sigma == pytest.approx(24.0 * DEG_PER_HOUR)
    assert noise.accel_markov_sigma == pytest.approx(6.0 * 1.8e-3)
    markov = {
        **FIGURES,
        "gauss_markov_gyro_sigma": [10.0, 10.0, 10.0],
        "gauss_markov_gyro_time": 30.0,
    }
    noise, _ = noise_from_rig(rig_from_dict({"imu": markov}))
    expected = 2.0 * (10.0 * DEG_PER_HOUR) ** 2 / 30.0
    assert 2.0 * noise.gyro_markov_sigma**2 / noise.gyro_correlation_time == pytest.approx(expected)
    assert rig_from_dict({"imu": {"scale_sigma": 500.0}}).imu.scale_sigma == 500.0 * PPM


def test_logs_and_options_that_cannot_work_are_refused():
    imu, table, rig, _ = simulated(legs=((20.0, 10.0),))
    with pytest.raises(RigError, match=r"rig: site: latitude is missing; set \[site\] latitude"):
        filter_log(imu, table, rig_from_dict({}), Options())
    with pytest.raises(LogError, match="the window 5 to 50 s is not within the time of both logs"):
        filter_log(imu, table, rig, Options(window=(5.0, 50.0)))
    with pytest.raises(LogError, match="contains 11 samples, fewer than two updates of 10"):
        filter_log(imu, table, rig, Options(window=(5.0, 5.1)))
    with pytest.raises(RotcliError, match="smoothing needs the slaved azimuth"):
        filter_log(imu, table, rig, Options(smooth=True, slave_azimuth=False))
    apart = TableLog(table.path, table.time + 100.0, table.angle, table.interval)
    with pytest.raises(LogError, match="shares no time with the table log"):
        filter_log(imu, apart, rig, Options())
