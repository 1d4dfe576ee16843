"""Sines of the table angle in the residuals: false alarms, power, and the cause that is named."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from rotcli.logs.record import Segment
from rotcli.models.base import FixedBase
from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.rotation import attitude_matrix, rotate_about
from rotcli.models.slow_noise import simulate_slow_noise
from rotcli.run.consistency.blocks import EarthHarmonics, SegmentBlocks
from rotcli.run.consistency.harmonics import check_harmonics, residual_harmonics
from rotcli.run.evidence.samples import SampleScan
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR
from tests.independent_noise import long_flicker

LATITUDE = 51.08 * DEG
Z = np.array([0.0, 0.0, 1.0])
SLOW = [SlowNoise(15.66 * DEG_PER_HOUR, 0.35 * DEG_PER_HOUR)] * 3
WHITE = np.full(3, 0.4 * DEG_PER_ROOT_HOUR)
FOG = np.full(3, 0.005 * DEG_PER_ROOT_HOUR)
BLOCK, INTERVAL, SIZE = 0.25, 0.01, 25


def base(azimuth=0.0, pitch=0.0):
    return FixedBase(LATITUDE, 9.81, attitude_matrix(pitch, 0.0, azimuth))


def blocks(true_base, white, seconds=60.0, rate=30.0, seed=0, change=lambda w, angle: w, slow=True):
    """Return a turning segment of gyros in Earth rate and noise; change: of the readings."""
    rng = np.random.default_rng(seed)
    n = round(seconds / BLOCK)
    time = BLOCK * (np.arange(n) + 0.5)
    angle = rate * DEG * time + 0.3
    gyro = change(true_base.w_ie_s(Z, angle) + rate * DEG * Z, angle)
    gyro = gyro + white / np.sqrt(BLOCK) * rng.standard_normal((n, 3))
    if slow:
        gyro += np.stack([simulate_slow_noise(rng, n, BLOCK, SLOW[0]) for _ in range(3)], axis=1)
    sinc = np.sinc(rate * DEG * BLOCK / (2.0 * np.pi))
    return SegmentBlocks(
        Segment(0.0, seconds, rate * DEG, rate * DEG * seconds), 0.0, INTERVAL, SIZE,
        np.full(n, float(SIZE)), gyro, sinc * np.cos(angle), sinc * np.sin(angle),
        np.zeros(3), np.zeros(3), SampleScan(),
    )  # fmt: skip


def check(segment, rig_base, white=WHITE, slow=SLOW, azimuth=0.0):
    earth = EarthHarmonics.of(rig_base, Z)
    harmonics = residual_harmonics([segment], earth, white, slow)
    return check_harmonics("imu.csv", harmonics, rig_base, Z, azimuth), harmonics


def test_the_harmonics_of_the_earth_rate_are_those_of_its_rotation():
    place = base(azimuth=0.7, pitch=0.4)
    u = np.array([0.6, 0.0, 0.8])
    angle = np.linspace(0.0, 7.0, 50)
    earth = EarthHarmonics.of(place, u)
    expected = rotate_about(u, -angle, np.broadcast_to(place.w_ie_b, (50, 3)))
    np.testing.assert_allclose(earth.at(np.cos(angle), np.sin(angle)), expected, atol=1e-18)


@pytest.mark.parametrize(("seconds", "rate"), [(60.0, 30.0), (60.0, 10.0), (300.0, 30.0)])
def test_clean_segments_raise_no_alarm(seconds, rate):
    chi2, alarms = [], 0
    for seed in range(200):
        findings, harmonics = check(blocks(base(), WHITE, seconds, rate, seed), base())
        chi2.append(harmonics.chi2)
        alarms += bool(findings)
    assert alarms <= 2  # 0.2 expected
    # 12 degrees of freedom: the mean of 200 scatters by sqrt(24 / 200) = 0.35.
    assert np.mean(chi2) == pytest.approx(12.0, abs=1.2)


@pytest.mark.parametrize(("seconds", "rate", "turns"), [(40.0, 10.0, 1.1), (60.0, 30.0, 5.0)])
def test_chi_squared_follows_its_distribution_under_flicker_of_any_age(seconds, rate, turns):
    """The flicker noise is made by another method than the simulation's and the covariance's."""
    rng = np.random.default_rng(8)
    n = round(seconds / BLOCK)
    flicker_only = [SlowNoise(SLOW[0].bias_instability)] * 3
    fine = long_flicker(rng, 5 * n, BLOCK / 5.0, (250, 3))
    chi2 = []
    for flicker in fine.reshape(250, 3, n, 5).mean(axis=-1) * SLOW[0].bias_instability:
        segment = blocks(base(), WHITE, seconds, rate, int(rng.integers(2**31)), slow=False)
        changed = replace(segment, gyro=segment.gyro + flicker.T)
        chi2.append(check(changed, base(), slow=flicker_only)[1].chi2)
    assert rate * seconds / 360.0 == pytest.approx(turns, abs=0.02)
    # Kolmogorov and Smirnov's 99 % limit of 250 values is 1.63 / sqrt(250).
    assert kstest(chi2, "chi2", args=(12,)).statistic < 0.103


def test_an_azimuth_of_the_other_sense_is_named_with_the_one_that_cancels_it():
    segment = blocks(base(azimuth=90.6 * DEG), FOG, 40.0, 10.0, slow=False)
    wrong = base(azimuth=-90.6 * DEG)
    (finding,), _ = check(segment, wrong, FOG, [SlowNoise()] * 3, azimuth=-90.6 * DEG)
    assert finding.code == "residual-harmonics"
    found = float(finding.text.split("azimuth = ")[1].split(" deg")[0])
    assert found == pytest.approx(90.6, abs=0.3)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda w, a: w * [-1.0, 1.0, 1.0], "gyro_x has the wrong sign"),
        (lambda w, a: w[:, [1, 0, 2]], "gyro_x and gyro_y are exchanged"),
        (lambda w, a: w * [1.0, 0.0, 1.0], "gyro_y does not measure the Earth rate"),
        (
            lambda w, a: w + 0.05 * DEG * np.column_stack([np.sin(a), 0 * a, 0 * a]),
            "sensitivity to gravity, or a wrong",
        ),
    ],
)
def test_the_cause_is_named(change, says):
    segment = blocks(base(), FOG, 120.0, 10.0, change=change, slow=False)
    (finding,), _ = check(segment, base(), FOG, [SlowNoise()] * 3)
    assert says in finding.text


@pytest.mark.parametrize(("seconds", "rate"), [(60.0, 30.0), (60.0, 10.0), (40.0, 50.0)])
def test_slow_noise_that_the_rig_does_not_state_raises_no_alarm(seconds, rate):
    earth, none = EarthHarmonics.of(base(), Z), [SlowNoise()] * 3
    chi2 = []
    for seed in range(100):
        segment = blocks(base(), WHITE, seconds, rate, seed)
        found = residual_harmonics([segment], earth, WHITE, none, known=False)
        chi2.append(found.chi2)
    assert max(chi2) < found.limit
    assert 7.0 < np.mean(chi2) < 12.0  # of 12: more slow noise is assumed than there is


def _with_sine(w, angle):
    return w + 31.0 * DEG_PER_HOUR * np.column_stack([np.sin(angle), 0 * angle, 0 * angle])


def test_half_of_the_sines_of_31_deg_per_h_are_found():
    """The power stated in the documentation: NAV440, 60 s at 30 deg/s."""
    found = 0
    for seed in range(30):
        segment = blocks(base(), WHITE, seed=seed, change=_with_sine)
        found += bool(check(segment, base())[0])
    assert 0.2 < found / 30.0 < 0.8


def test_the_size_of_a_sine_is_stated_in_deg_per_h():
    segment = blocks(base(), FOG, 120.0, 10.0, change=_with_sine, slow=False)
    (finding,), _ = check(segment, base(), FOG, [SlowNoise()] * 3)
    size = float(re.search(r"by (\S+) deg/h", finding.text)[1])
    assert size == pytest.approx(31.0, rel=0.02)
