"""Deterministic sigmas, ranks, lost directions and closed forms of the named sequences."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.models.rotation import axis_rotation
from rotcli.models.triad import parameters as p
from rotcli.models.triad import sequences
from rotcli.models.triad.blocks import RAMP, STILL
from rotcli.models.triad.conventions import convert, convert_covariance
from rotcli.models.triad.information import design_covariance, information_factor
from rotcli.models.triad.kinematics import table
from rotcli.models.triad.leastsquares import rank_of
from rotcli.models.triad.motion import MotionBuilder
from rotcli.units import DEG, DEG_PER_HOUR
from tests.triad import bench

ARW, VRW = 0.4 * DEG / 60.0, 0.05 / 60.0
WITHOUT_GRAVITY = "N d G M b K2 R eps table tau"
# 1-sigma of the prototype: S1 and S2, in the units of results (levers mm, angles arcsec, us).
PUBLISHED = {
    "S1": "4.816 5.003 4.845 5.833 4.803 5.183 4.842 4.893 4.820 .4923 .4923 .4923 "
    ".8401 .8485 .8473 .8402 .8484 .8476 .8403 .8484 .8472 "
    "30.74 3.068 3.063 5.244 30.75 3.950 3.112 3.170 30.73 3.122e-5 3.812e-5 2.751e-5 "
    "4.531 5.064 4.243 .02778 .06456 .06580 .06355 .02762 .06602 .06588 .06599 .02772 "
    ".371 .370 180 .6045 .8882 .5943 22.15 4.187 3e-4",
    "S2": "5.304 6.421 5.703 5.933 5.392 6.712 5.472 6.360 5.573 .8115 .8115 .8115 "
    "1.412 1.313 1.476 1.412 1.313 1.477 1.412 1.313 1.476 "
    "31.03 5.427 5.522 6.257 30.95 6.110 5.295 5.500 31.04 5.132e-5 6.021e-5 4.996e-5 "
    "8.930 9.954 9.740 .02571 .05870 .05402 .05707 .02628 .04765 .05240 .05000 .02531 "
    ".733 .719 180 .8413 .7012 .6723 19.47 3.647 3e-4",
}


def _sigma(motion, groups=p.BASIC):
    problem = bench.problem(bench.three_axes(), groups)
    covariance = design_covariance(problem, bench.blocks(motion))
    sigma = np.sqrt(np.diag(covariance)) / p.unit_factors()[problem.free]
    return dict(zip((p.NAMES[k] for k in problem.free), sigma, strict=True))


@pytest.mark.parametrize(("name", "duration"), [("S1", 2463.6), ("S2", 920.4), ("M5", 377.5)])
def test_named_sequences_last_as_long_as_published(name, duration):
    assert sequences.NAMED[name]().motion().duration == pytest.approx(duration, abs=0.06)


@pytest.mark.parametrize("name", ["S1", "S2"])
def test_sigmas_of_a_perfect_sensor_are_the_published_ones(name):
    found = np.array(list(_sigma(sequences.NAMED[name]()).values()))
    expected = np.array([float(v) for v in PUBLISHED[name].split()])
    np.testing.assert_allclose(found, expected, rtol=0.01)


def test_sigmas_with_asymmetries_are_the_published_ones():
    s1, s2 = (_sigma(sequences.NAMED[n](), p.WITH_ASYMMETRY) for n in ("S1", "S2"))
    for found, name, values in (
        (s1, "bias_", (0.564, 0.566, 0.563)),
        (s1, "gyro_asymmetry_", (5.59, 5.59, 5.58)),
        (s1, "Ka2_", (21.9, 22.0, 21.7)),
        (s1, "accel_asymmetry_", (21.1, 21.1, 20.8)),
        (s1, "accel_bias_", (3.15e-5, 3.83e-5, 2.76e-5)),
        (s2, "bias_", (1.04, 1.08, 1.05)),
        (s2, "gyro_asymmetry_", (6.86, 7.14, 7.28)),
        (s2, "Ka2_", (31.3, 34.8, 31.1)),
        (s2, "accel_asymmetry_", (29.9, 31.6, 27.8)),
    ):
        got = [found[name + axis] for axis in "xyz"]
        # Second-order term and asymmetry differ only between the faces: their sigma depends a
        # little on the length of the blocks, which the prototype chose otherwise.
        np.testing.assert_allclose(got, values, rtol=0.015)


def test_the_minimal_sequence_has_the_published_sigmas():
    found = _sigma(sequences.m5())
    gyro = [found[name] for name in p.GROUPS["N"].names]
    assert min(gyro) == pytest.approx(9.8, rel=0.01)
    assert max(gyro) == pytest.approx(17.65, rel=0.03)  # printed as 18
    assert found["bias_x"] == pytest.approx(1.43, rel=0.01)
    # Ranges to 1 %, and half a unit of their last printed digit (of b one unit).
    published = {
        "G": (2.0, 2.6, 0.05),
        "M": (10.0, 15.0, 0.5),
        "b": (10e-5, 11.5e-5, 0.1e-5),
        "K2": (17.0, 19.0, 0.5),
    }
    for group, (least, most, half) in published.items():
        scale = ("Kax", "Kay", "Kaz")  # known from gravity: 31 ppm
        values = [found[name] for name in p.GROUPS[group].names if name not in scale]
        assert abs(min(values) - least) < half + 0.01 * least, group
        assert abs(max(values) - most) < half + 0.01 * most, group
    levers = [found[name] for name in p.GROUPS["R"].names]
    assert (min(levers), max(levers)) == (
        pytest.approx(0.12, rel=0.03),
        pytest.approx(0.38, rel=0.01),
    )
    faster = _sigma(sequences.m5(100.0, 8.0))
    gyro = [faster[name] for name in p.GROUPS["N"].names]
    assert (min(gyro), max(gyro)) == (pytest.approx(5.9, rel=0.02), pytest.approx(12, rel=0.05))


def test_exact_gravity_makes_the_accelerometer_scale_ten_times_better():
    nominal = bench.three_axes()
    priors = p.default_priors()
    priors[p.GRAVITY] = 1e-9
    problem = bench.problem(nominal, priors=priors)
    sigma = np.sqrt(np.diag(design_covariance(problem, bench.blocks(sequences.s1()))))
    at = [int(np.flatnonzero(problem.free == p.INDEX[n])[0]) for n in ("Kax", "Kay", "Kaz")]
    np.testing.assert_allclose(sigma[at] * 1e6, [3.09, 3.12, 3.02], rtol=0.01)


def test_sigmas_in_the_accelerometer_convention_are_the_published_ones():
    problem = bench.problem(bench.three_axes())
    covariance = design_covariance(problem, bench.blocks(sequences.s1()))
    D = convert(np.zeros(p.count()), "accelerometer").derivative
    sigma = np.sqrt(np.diag(convert_covariance(covariance, problem.free, D))) * 1e6
    assert sigma[p.M][[3, 6, 7]] == pytest.approx([5.66, 4.31, 4.87], rel=0.01)
    assert sigma[p.M][[1, 2, 5]] == pytest.approx([0, 0, 0], abs=1e-9)
    published = [4.82, 5.73, 5.70, 6.31, 4.80, 5.86, 5.69, 5.90, 4.82]
    assert sigma[p.N] == pytest.approx(published, rel=0.01)


def test_closed_forms_hold():
    motion = sequences.s1()
    blocks = bench.blocks(motion)
    found = _sigma(motion)
    span = blocks.count / bench.RATE
    total, ramps = span.sum(), span[blocks.kind == RAMP].sum()
    assert found["bias_x"] == pytest.approx(ARW / np.sqrt(total) / DEG_PER_HOUR, rel=0.02)
    sensed = ARW / (bench.GRAVITY * np.sqrt(total / 3.0)) / p.G_UNIT
    assert found["gsens_xx"] == pytest.approx(sensed, rel=0.03)
    # Slews and ramps turn at 20 deg/s^2; blocks of ramps alone carry the gyros' clock.
    clock = ARW / (20.0 * DEG * np.sqrt(ramps)) * 1e6
    assert found["clock_gyro"] == pytest.approx(clock, rel=0.02)
    for axis in "xyz":
        ratio = found[f"accel_bias_{axis}"] / (VRW / np.sqrt(total))
        assert 1.6 <= ratio <= 2.3


def test_without_ramps_the_clock_of_the_gyros_is_lost():
    blocks = bench.blocks(sequences.s1())
    problem = bench.problem(bench.three_axes())
    cut = blocks.part(blocks.kind != RAMP)
    covariance = design_covariance(problem, cut)
    at = int(np.flatnonzero(problem.free == p.CLOCK_GYRO)[0])
    assert np.sqrt(covariance[at, at]) == pytest.approx(55e-3, rel=0.05)


def _rank(motion, axes, groups=WITHOUT_GRAVITY, *, mountings=None, exact=True, still=False, **at):
    nominal = table(axes, latitude=bench.LATITUDE, gravity=bench.GRAVITY, mountings=mountings, **at)
    priors = p.weak_priors(nominal.mounting_count)
    problem = bench.problem(nominal, groups, exact=exact, priors=priors)
    blocks = bench.blocks(motion)
    blocks = blocks.part(blocks.kind == STILL) if still else blocks
    x = np.zeros(p.count(nominal.mounting_count))
    rank = rank_of(information_factor(problem, x, blocks).R)
    D = convert(x, "accelerometer").derivative
    covariance = convert_covariance(design_covariance(problem, blocks), problem.free, D)
    sigma = np.sqrt(np.diag(covariance)) * 1e6
    return len(problem.free), rank, sigma


_VERTICAL = bench.cube(bench.X, bench.Y)
_LYING = bench.cube(bench.Z, bench.Y)
_EIGHT = tuple(range(0, 360, 45))
_LYING_3 = [_LYING[0], _LYING[2], _LYING[4]]
_OFF = ~np.eye(3, dtype=bool).ravel()


def _two_axes():
    """Return spins of both axes of a table, outer axis horizontal: 1535 s."""
    b = MotionBuilder(2)
    for outer in (0, 90, 180, 270):
        b.go((outer * DEG, 0.0))
        b.spin(1, 60 * DEG, 10)
    for inner in (0, 45, 90):
        for outer in (0, 90, 180, 270):
            b.go((outer * DEG, inner * DEG))
            b.hold(40.0)
        b.go((0.0, inner * DEG))
        b.spin(0, 60 * DEG, 10)
    return b


EQUIPMENT = {
    # name: motion, axes, options, parameters, rank, worst diagonal and off-diagonal N, M (ppm)
    "vertical, 6 exact mountings": (
        lambda: sequences.one_axis(6, (0, 180), 60), "z", {"mountings": _VERTICAL},
        50, 49, 7.0, 7.9, 5.2,
    ),
    "horizontal, 3 exact mountings": (
        lambda: sequences.one_axis(3, _EIGHT, 20), "x", {"mountings": _LYING_3},
        50, 50, 9.9, 11.1, 6.7,
    ),
    "horizontal, 3 unknown mountings": (
        lambda: sequences.one_axis(3, _EIGHT, 20), "x",
        {"mountings": _LYING_3, "exact": False}, 56, 55, 9.9, 15.2, 9.5,
    ),
    "horizontal, 6 unknown mountings": (
        lambda: sequences.one_axis(6, _EIGHT, 20), "x", {"mountings": _LYING, "exact": False},
        65, 64, 7.0, 10.8, 6.7,
    ),
    "tilted 45 deg, 6 unknown mountings": (
        lambda: sequences.one_axis(6, _EIGHT, 20), "x",
        {"mountings": _LYING, "exact": False, "C_nb": axis_rotation(bench.Y, 0.25 * np.pi)},
        65, 64, 7.0, 8.6, 4.9,
    ),
    # Of the published motion only the time (1480 s) is known.
    "two axes": (_two_axes, "xz", {}, 51, 51, 8.6, 9.7, 6.1),
    "three axes, faces only": (sequences.faces_only, "zxy", {}, 53, 53, 7.0, 26, 25),
    "three axes, S1": (sequences.s1, "zxy", {}, 53, 53, 4.8, 6.3, 5.7),
}  # fmt: skip


@pytest.mark.parametrize("name", EQUIPMENT)
def test_equipment_reaches_the_published_rank_and_sigma(name):
    motion, axes, options, parameters, rank, scale, gyro, accel = EQUIPMENT[name]
    tolerance = 0.05 if name == "two axes" else 0.02
    count, found, sigma = _rank(motion(), axes, **options)
    assert (count, found.rank) == (parameters, rank)
    assert sigma[p.N][~_OFF].max() == pytest.approx(scale, rel=tolerance)
    assert sigma[p.N][_OFF].max() == pytest.approx(gyro, rel=tolerance)
    assert sigma[p.M][_OFF].max() == pytest.approx(accel, rel=tolerance)


def test_one_vertical_axis_shows_24_of_50_parameters():
    count, found, sigma = _rank(sequences.one_axis(1, (0, 90, 180, 270), 60), "z")
    assert (count, found.rank) == (50, 24)
    assert sigma[p.N][8] == pytest.approx(9.9, rel=0.02)


def test_unknown_mountings_about_a_vertical_axis_lose_the_nonorthogonality():
    motion = sequences.one_axis(6, (0, 180), 60)
    count, found, sigma = _rank(motion, "z", mountings=_VERTICAL, exact=False)
    assert (count, found.rank) == (65, 63)
    assert sigma[p.M][[3, 6, 7]].max() > 5000.0  # weak: prior alone
    assert sigma[p.N][[0, 4, 8]] == pytest.approx([7.0] * 3, rel=0.02)


def test_tumbles_alone_leave_two_directions_of_the_base():
    count, found, _ = _rank(sequences.tumbles(), "zxy")
    assert (count, found.rank) == (53, 51)
    names = {p.NAMES[bench.problem(bench.three_axes(), WITHOUT_GRAVITY).free[k]]
             for k in np.flatnonzero(np.any(found.null != 0.0, axis=0))}  # fmt: skip
    assert {"base_tilt_east", "base_tilt_north", "outer_middle", "middle_zero"} <= names
    assert {"Kayz", "Kazy", "Kgyz", "Kgzy", "Kaxz", "Kazx", "Kgxz", "Kgzx"} <= names
    assert not {"Kgx", "Kay", "bias_x", "clock_gyro"} & names


def test_one_still_pair_of_outer_angles_gives_the_base_back():
    count, found, _ = _rank(sequences.tumbles(still=True), "zxy")
    assert (count, found.rank) == (53, 53)
    nominal, problem = bench.three_axes(), bench.problem(bench.three_axes(), WITHOUT_GRAVITY)
    blocks = bench.blocks(sequences.tumbles(still=True))
    problem = replace(problem, prior_sigma=p.weak_priors(nominal.mounting_count))
    variance = np.zeros(p.count())
    variance[problem.free] = np.diag(design_covariance(problem, blocks))
    sigma = np.sqrt(variance) * 1e6  # table convention
    assert sigma[p.N][~_OFF].max() == pytest.approx(13.9, rel=0.02)
    assert sigma[p.N][_OFF].max() == pytest.approx(24, rel=0.03)
    assert sigma[p.M][_OFF].max() == pytest.approx(19, rel=0.03)


def test_still_segments_on_faces_lose_the_gyro_matrix():
    count, found, _ = _rank(sequences.still_faces(), "zxy", "N d G M b K2 eps table", still=True)
    assert (count, found.rank) == (42, 39)


def test_gravity_and_a_common_scale_factor_are_never_separate():
    nominal = bench.three_axes()
    problem = bench.problem(nominal)
    R = information_factor(problem, np.zeros(p.count()), bench.blocks(sequences.s1())).R
    found = rank_of(R)
    assert found.rank == 53
    by_name = dict(zip((p.NAMES[k] for k in problem.free), found.null[0], strict=True))
    scale = [by_name[f"Ka{axis}"] for axis in "xyz"]
    # 1e-3 of scale against 3e-4 m/s^2 of gravity, the typical sizes of the columns.
    expected = -by_name["gravity"] * 3e-4 / bench.GRAVITY / 1e-3
    assert scale == pytest.approx([expected] * 3, rel=1e-3)
