"""What residuals of known size are reported as, and from which size on."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rotcli.models.triad import parameters as p
from rotcli.models.triad import sequences
from rotcli.models.triad.blocks import expected_means
from rotcli.triad import residuals
from rotcli.triad.bias_steps import BiasStep
from rotcli.triad.estimate import KindGoodness, estimate
from tests.triad import bench

TIME = np.arange(2.0, 402.0)


def blocks():
    class Times:
        time = TIME

        def __len__(self):
            return len(TIME)

    return Times()


def fit(**more):
    """A fit whose innovations are +1 and -1: unit variance without an outlier."""
    signs = np.tile([1.0, -1.0, -1.0, 1.0], 100) * np.ones((6, 1))
    usual = {"innovations": signs, "converged": True, "passes": 3, "kinds": [], "drift": True}
    free = np.array([p.CLOCK_GYRO, p.CLOCK_ACCEL])
    return SimpleNamespace(**{**usual, "scale": 1.0, "problem": SimpleNamespace(free=free), **more})


def found(one, factors=(1.0, 1.0), white=(1.0, 1.0), clocks=(), step=None, monkeypatch=None):
    monkeypatch.setattr(residuals, "_over_time", lambda *_: (list(clocks), step))
    return residuals.residual_findings(one, factors, blocks(), "imu", np.array(white))


@pytest.mark.parametrize(
    ("kind", "count", "limit"),
    [("still", 1000, 1.5), ("turn", 24, 2.0), ("ramp", 6, 3.0)],
)
def test_chi_squared_of_a_kind_is_judged_by_its_number_of_blocks(kind, count, limit, monkeypatch):
    # The larger of 1.5 and 1 + 6 sqrt(2 / (3 n)): six sigma of the mean square of 3 n readings.
    for gyro, accel in ((0.99 * limit, 0.5), (0.5, 0.99 * limit)):
        one = fit(kinds=[KindGoodness(kind, count, gyro, accel)])
        assert found(one, monkeypatch=monkeypatch) == []
    for gyro, accel in ((1.01 * limit, 0.5), (0.5, 1.01 * limit)):
        one = fit(kinds=[KindGoodness(kind, count, gyro, accel)])
        (finding,) = found(one, monkeypatch=monkeypatch)
        assert (finding.code, finding.where) == (f"{kind}-residuals", kind)
        assert (finding.value, finding.limit) == pytest.approx((1.01 * limit, limit))


def test_chi_squared_of_a_kind_is_that_of_the_weights_less_what_is_large_everywhere(monkeypatch):
    # Weights with twice and three times the noise; the log has 1.5 times that of the rig.
    one = fit(kinds=[KindGoodness("turn", 1000, 2.0, 0.3)])
    (finding,) = found(one, (2.0, 3.0), (1.5, 0.5), monkeypatch=monkeypatch)
    assert finding.value == pytest.approx(2.0 * 2.0**2 / 1.5**2)
    (finding,) = found(one, (1.0, 3.0), (1.5, 0.5), monkeypatch=monkeypatch)
    assert finding.value == pytest.approx(0.3 * 3.0**2)


def test_an_outlier_is_found_with_channel_time_and_size(monkeypatch):
    one = fit()
    one.innovations[4, 37] = -9.0
    (finding,) = found(one, monkeypatch=monkeypatch)
    # The usual size contains the outlier as one of seven sigma.
    usual = np.sqrt((399.0 + 49.0) / 400.0)
    assert (finding.code, finding.where) == ("disturbed-blocks", "39 s")
    assert (finding.value, finding.limit) == (pytest.approx(9.0 / usual), 7.0)
    assert "accel_y deviates by 8.5 sigma at 39 s (1 blocks above 7)" in finding.text
    one.innovations[4, 37] = 6.9 * usual
    assert found(one, monkeypatch=monkeypatch) == []


def test_factors_of_the_noise_enlarge_an_outlier_and_the_usual_size_reduces_it(monkeypatch):
    one = fit()
    one.innovations[1, 5] = 8.0
    (finding,) = found(one, (0.9, 1.0), monkeypatch=monkeypatch)
    assert finding.value == pytest.approx(7.2)  # the usual size counts from 1 on
    assert found(one, (0.5, 1.0), monkeypatch=monkeypatch) == []
    one.innovations[:] *= 0.5
    one.innovations[1, 5] = 8.0
    (finding,) = found(one, (2.0, 1.0), monkeypatch=monkeypatch)
    assert finding.value == pytest.approx(16.0 / np.sqrt((399.0 + 49.0) / 400.0))


@pytest.mark.parametrize(("count", "named"), [(40, True), (41, False)])
def test_more_than_a_tenth_of_the_blocks_is_no_shock(count, named, monkeypatch):
    one = fit()
    one.innovations[0, :count] = 100.0
    assert bool(found(one, monkeypatch=monkeypatch)) == named


@pytest.mark.parametrize(
    ("channel", "size", "text"),
    [
        (1, 412.0 * np.pi / 180 / 3600, "the bias of gyro_y changes by 412 deg/h near 70 s"),
        (5, 0.0123, "the bias of accel_z changes by 0.0123 m/s^2 near 70 s"),
    ],
)
def test_a_step_takes_the_place_of_a_smaller_outlier(channel, size, text, monkeypatch):
    one = fit()
    one.innovations[4, 37] = -9.0
    step = BiasStep(channel, 70.0, size, 8.6)
    (finding,) = found(one, step=step, monkeypatch=monkeypatch)
    assert finding.code == "bias-step"
    assert text in finding.text
    assert (finding.value, finding.limit) == (8.6, 6.0)
    step = BiasStep(channel, 70.0, size, 8.4)
    (finding,) = found(one, step=step, monkeypatch=monkeypatch)
    assert finding.code == "disturbed-blocks"


def test_clock_offsets_of_both_halves_differ_beyond_four_sigma():
    # Information of 1/(3 us)^2 and 1/(4 us)^2: the difference has 5 us, twice that as scaled.
    information = 1.0 / np.array([3e-6, 4e-6]) ** 2
    for difference, codes in ((39e-6, []), (41e-6, ["clock-drift"]), (-41e-6, ["clock-drift"])):
        sums = np.ones((2, 2, 2))
        sums[1, :, 0] = information
        sums[1, :, 1] = information * (7e-6 + np.array([0.0, difference]))
        one = fit(scale=2.0)
        findings = residuals._clock_halves(sums, one, "imu")
        assert [f.code for f in findings] == codes
        for finding in findings:
            assert (finding.value, finding.limit) == pytest.approx((difference, 40e-6))
            assert (
                f"accelerometers changes by {1e6 * difference:.3g} us (4.1 sigma)" in finding.text
            )
    one = fit(scale=2.0, problem=SimpleNamespace(free=np.array([p.CLOCK_GYRO])))
    assert residuals._clock_halves(sums, one, "imu") == []


def test_a_clock_that_changes_between_the_halves_of_a_log_is_found_with_its_size():
    problem, data = bench.problem(bench.three_axes()), bench.blocks(sequences.m5())
    middle = 0.5 * (data.time[0] + data.time[-1])
    x, means = np.zeros(p.count()), []
    for offset in (1e-3, 1.4e-3):  # s
        x[p.CLOCK_GYRO] = offset
        means.append(expected_means(problem.table, x, data))
    one = replace(data, means=np.where(data.time < middle, *means))
    fitted = estimate(problem, one)
    findings, _ = residuals._over_time(fitted, one, "imu")
    (finding,) = [f for f in findings if f.code == "clock-drift"]
    assert "clock offset of the gyros" in finding.text
    assert finding.value == pytest.approx(4e-4, rel=0.05)
