"""What a motion reveals, against the closed-form nullspaces and the paper's five properties."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.errors import RotcliError
from rotcli.observe.errors_ins import zupt_error_dynamics
from rotcli.observe.observability import TableMotion, analyse, sweep
from rotcli.units import DEG

G = 9.81
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
TEN = 10.0 * DEG
EU, DU = np.eye(12)[5], np.eye(12)[11]


def vector(**values):
    names = ("vE", "vN", "vU", "eE", "eN", "eU", "gE", "gN", "gU", "dE", "dN", "dU")
    return np.array([values.get(name, 0.0) for name in names])


def closed_form(motion):
    """Nullspace vectors (q, 12) of the simplified model at rest, by hand."""
    if not motion.turning:
        return np.array([EU, DU, vector(gE=1, eN=-1 / G), vector(gN=1, eE=1 / G)])
    a = motion.w_ns_n / motion.rate
    if np.hypot(a[0], a[1]) < 1e-9:
        W = motion.rate * np.sign(a[2])
        return np.array(
            [EU, DU, vector(gE=1, eN=-1 / G, dE=W / G), vector(gN=1, eE=1 / G, dN=W / G)]
        )
    if abs(a[2]) < 1e-9:
        return np.array([EU, vector(gE=a[0], gN=a[1], eE=a[1] / G, eN=-a[0] / G)])
    return EU[None]


def assert_same_span(nullspace, expected, rate):
    """Compare spans in natural units, where every entry is of order one."""
    T = 1.0 / abs(rate) if rate else 1.0
    units = np.repeat([G * T, 1.0, G, 1.0 / T], 3)
    A, _ = np.linalg.qr(nullspace / units[:, None])
    B, _ = np.linalg.qr((expected / units).T)
    assert A.shape == B.shape
    # The projector of a computed nullspace is off by rounding over the gap of the singular
    # values, and that is at worst 1e-3 for a random axis 0.1 deg from level.
    np.testing.assert_allclose(A @ A.T, B @ B.T, atol=1e-9)


@pytest.mark.parametrize(
    ("axis", "pitch", "roll", "rank"),
    [
        (None, 0, 0, 8),
        (None, 20, 50, 8),
        (X, 0, 0, 10),
        (X, 0, 30, 11),  # roll is a turn about y: it tilts the x axis
        (Y, 0, 0, 10),
        (Y, 30, 0, 11),
        (Z, 0, 0, 8),
        (Z, 30, 0, 11),
        (Z, 0, -30, 11),
        (X, 0, 90, 8),
        (Y, 90, 0, 8),
        (X, 90, 0, 10),
        (Z, 90, 0, 10),
        (Z, 0, 90, 10),
    ],
)
def test_ranks_of_the_papers_cases(axis, pitch, roll, rank):
    motion = TableMotion(
        axis, TEN if axis else 0.0, pitch=pitch * DEG, roll=roll * DEG, azimuth=0.7
    )
    result = analyse(replace(motion, gravity=G))
    assert result.rank == rank
    for view in (result.n, result.s):
        assert len(view.observable) + len(view.combinations) == rank
    assert_same_span(result.n.nullspace, closed_form(motion), motion.rate)


def random_motions(count, seed):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        pitch, roll, azimuth = rng.uniform([-90, -180, -180], [90, 180, 180]) * DEG
        rate = rng.choice([-1, 1]) * 10 ** rng.uniform(-1, np.log10(300.0)) * DEG
        yield TableMotion(None, rate, pitch, roll, azimuth, rng.uniform(-80, 80) * DEG, G)


@pytest.mark.parametrize("count", [60, pytest.param(1000, marks=pytest.mark.campaign)])
def test_random_attitudes_and_rates_give_the_closed_form_nullspace(count):
    rng = np.random.default_rng(3)
    seen = set()
    for motion in random_motions(count, 4):
        u = rng.normal(size=3)
        oblique = tuple(u / np.linalg.norm(u))
        level = tuple(motion.C_nb.T @ (np.cos(u[0]), np.sin(u[0]), 0.0))  # a_U = 0 by design
        upright = tuple(motion.C_nb.T @ (0.0, 0.0, np.sign(u[0])))
        for axis in (X, Y, Z, None, oblique, level, upright):
            m = replace(motion, axis=axis, rate=motion.rate if axis else 0.0)
            result = analyse(m)
            expected = closed_form(m)
            assert result.rank == 12 - len(expected)
            assert_same_span(result.n.nullspace, expected, m.rate)
            seen.add(result.rank)
    assert seen == {8, 10, 11}


def test_combinations_are_independent_and_orthogonal_to_the_nullspace():
    for k, motion in enumerate(random_motions(60, 5)):
        axis = (None, X, Y, Z, tuple(motion.C_nb.T @ Z), tuple(motion.C_nb.T @ X))[k % 6]
        result = analyse(replace(motion, axis=axis))
        for view in (result.n, result.s):
            rows = np.zeros((len(view.combinations), 12))
            for row, combination in zip(rows, view.combinations, strict=True):
                for name, value in combination.coefficients.items():
                    row[view.states.index(name)] = value
            size = np.abs(rows) @ np.abs(view.nullspace)
            assert (np.abs(rows @ view.nullspace) <= 1e-7 * size + 1e-12).all()
            if len(rows):
                assert np.linalg.matrix_rank(rows / np.abs(rows).max(axis=1)[:, None]) == len(rows)
            assert len(view.observable) + len(rows) == result.rank


def test_full_model_ranks_are_formal_and_said_to_be_weak():
    ranks = {}
    for name, motion in {
        "still": TableMotion(),
        "x level, along east": TableMotion(X, TEN),
        "y level, along east": TableMotion(Y, TEN, azimuth=90 * DEG),
        "y level, along north": TableMotion(Y, TEN),
        "z level": TableMotion(Z, TEN),
        "z tilted": TableMotion(Z, TEN, pitch=30 * DEG),
        "x tilted": TableMotion(X, TEN, roll=30 * DEG),
    }.items():
        result = analyse(replace(motion, model="full"))
        ranks[name] = result.rank
        assert result.weak == (result.rank in (9, 12))
    assert ranks == {
        "still": 9,
        "x level, along east": 10,
        "y level, along east": 10,
        "y level, along north": 12,
        "z level": 12,
        "z tilted": 12,
        "x tilted": 12,
    }


def test_one_acceleration_hides_the_error_about_the_force_and_two_show_all():
    one = analyse(TableMotion(Y, TEN, pitch=0.5, gravity=G, accelerations=((1.0, -0.5, 0.2),)))
    assert one.rank == 11
    f = np.array([1.0, -0.5, 0.2 + G])
    assert_same_span(one.n.nullspace, vector(eE=f[0], eN=f[1], eU=f[2])[None] / G, TEN)
    assert "attitude error about the force" in one.advice
    two = analyse(TableMotion(Y, TEN, pitch=0.5, accelerations=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))))
    assert (two.rank, two.weak) == (12, False)
    assert two.advice.startswith("All 12 error states")
    assert analyse(TableMotion(accelerations=((1.0, 0.0, 0.0),))).rank == 8
    assert analyse(TableMotion(accelerations=((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)))).rank == 11
    assert analyse(TableMotion(accelerations=((1.0, 0, 0), (0, 1.0, 0), (0, 0, 0)))).rank == 12


GOLDEN = """\
still
  alone: dv_E dv_N dv_U gamma_U d_E d_N
  reported together: gamma_N - g*eps_E; gamma_E + g*eps_N
  hidden: eps_U d_U
about x, roll 0
  alone: dv_E dv_N dv_U eps_E gamma_N gamma_U d_E d_N d_U
  reported together: gamma_E + g*eps_N
  hidden: eps_U
about x, roll 30
  alone: dv_E dv_N dv_U eps_E eps_N gamma_E gamma_N gamma_U d_E d_N d_U
  reported together:
  hidden: eps_U
about y, pitch 0
  alone: dv_E dv_N dv_U eps_N gamma_E gamma_U d_E d_N d_U
  reported together: gamma_N - g*eps_E
  hidden: eps_U
about y, pitch 30
  alone: dv_E dv_N dv_U eps_E eps_N gamma_E gamma_N gamma_U d_E d_N d_U
  reported together:
  hidden: eps_U
about z, level
  alone: dv_E dv_N dv_U gamma_U
  reported together: gamma_N - g*eps_E; gamma_E + g*eps_N; gamma_E - (g/w)*d_E; gamma_N - (g/w)*d_N
  hidden: eps_U d_U
about z, pitch 30
  alone: dv_E dv_N dv_U eps_E eps_N gamma_E gamma_N gamma_U d_E d_N d_U
  reported together:
  hidden: eps_U
"""


def test_the_papers_five_properties_read_as_equations():
    text = ""
    for title, motion in {
        "still": TableMotion(),
        "about x, roll 0": TableMotion(X, TEN),
        "about x, roll 30": TableMotion(X, TEN, roll=30 * DEG),
        "about y, pitch 0": TableMotion(Y, TEN),
        "about y, pitch 30": TableMotion(Y, TEN, pitch=30 * DEG),
        "about z, level": TableMotion(Z, TEN),
        "about z, pitch 30": TableMotion(Z, TEN, pitch=30 * DEG),
    }.items():
        view = analyse(motion).n
        together = "; ".join(c.text for c in view.combinations)
        lines = (
            title,
            "  alone: " + " ".join(view.observable),
            f"  reported together: {together}",
            "  hidden: " + " ".join(view.unobservable),
        )
        text += "".join(line.rstrip() + "\n" for line in lines)
    assert text == GOLDEN


def test_turning_the_other_way_changes_the_sign_of_the_gyro_combination():
    texts = [c.text for c in analyse(TableMotion(Z, -TEN)).n.combinations]
    assert "gamma_E + (g/w)*d_E" in texts
    assert analyse(TableMotion((0.0, 0.0, -1.0), TEN)).n.combinations[2].text == texts[2]


def test_the_sensor_frame_names_the_biases_of_the_sensor():
    view = analyse(TableMotion(Y, TEN)).s
    assert [c.text for c in view.combinations] == ["accel_bias_y - g*eps_E"]
    assert view.combinations[0].coefficients == pytest.approx({"accel_bias_y": 1, "eps_E": -9.81})
    # Turned by 90 deg of azimuth the sensor's y axis looks east.
    turned = analyse(TableMotion(Y, TEN, azimuth=90 * DEG)).s
    assert [c.text for c in turned.combinations] == ["accel_bias_y + g*eps_N"]


def test_degrees_show_what_the_rank_hides():
    shallow = analyse(TableMotion(Z, TEN, pitch=2 * DEG))
    steep = analyse(TableMotion(Z, TEN, pitch=30 * DEG))
    assert shallow.rank == steep.rank == 11
    assert shallow.weak
    assert not steep.weak
    assert shallow.n.degrees["d_U"] < 0.3 < 0.9 < steep.n.degrees["d_U"]
    assert steep.n.degrees["eps_U"] == pytest.approx(0.0, abs=1e-9)
    assert all(0.0 <= d <= 1.0 for d in steep.s.degrees.values())


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        (TableMotion(), "Turn the table about an axis tilted by at least 10 deg"),
        (
            TableMotion(Z, TEN),
            "Tilt the axis by at least 10 deg: this separates vertical gyro bias",
        ),
        (TableMotion(Y, TEN), "Tilt the axis by at least 10 deg out of level: this separates"),
        (TableMotion(Z, TEN, pitch=1 * DEG), "but weakly (smallest singular value 0.0"),
        (TableMotion(Z, TEN, pitch=30 * DEG), "Only the azimuth error is unobservable"),
        (TableMotion(Z, TEN, pitch=0.5, model="full"), "do not rely on eps_U. Only the azimuth"),
        (TableMotion(accelerations=((1.0, 0, 0), (0, 1.0, 0))), "Accelerate in one more direction"),
    ],
)
def test_advice_says_in_words_what_to_change(motion, words):
    assert words in analyse(motion).advice


@pytest.mark.parametrize(("axis", "pitch", "roll"), [(Z, 10, 0), (Y, 10, 0), (X, 0, 10)])
def test_the_ten_degrees_of_the_advice_are_enough(axis, pitch, roll):
    result = analyse(TableMotion(axis, TEN, pitch=pitch * DEG, roll=roll * DEG))
    assert (result.rank, result.weak) == (11, False)


def test_sweep_of_pitch_finds_the_level_case_and_its_neighbours():
    result = sweep(TableMotion(Z, TEN), "pitch", -10 * DEG, 10 * DEG, 1 * DEG)
    assert len(result.values) == 21
    np.testing.assert_allclose(result.values[[0, -1]], [-10 * DEG, 10 * DEG])
    assert result.rank.tolist() == [11] * 10 + [8] + [11] * 10
    assert result.weak.tolist() == [0 < abs(v) < 2.5 for v in range(-10, 11)]
    assert result.degrees.shape == (21, 12)
    np.testing.assert_allclose(
        result.degrees[0], list(analyse(TableMotion(Z, TEN, pitch=-10 * DEG)).n.degrees.values())
    )


def test_sweep_of_the_rate_covers_standing_still():
    result = sweep(TableMotion(Y, 0.0), "rate", 0.0, 30 * DEG, 10 * DEG)
    assert result.rank.tolist() == [8, 10, 10, 10]


def test_an_axis_of_any_length_is_made_a_unit_vector():
    long, unit = analyse(TableMotion((0, 3, 4), TEN)), analyse(TableMotion((0, 0.6, 0.8), TEN))
    np.testing.assert_allclose(long.singular_values, unit.singular_values, atol=1e-15)


@pytest.mark.parametrize(
    ("motion", "text"),
    [
        (TableMotion((0, 0, 0), TEN), r"axis \(0, 0, 0\): no direction; set x, y, z, none"),
        (TableMotion(latitude=2.0), "latitude 114.592 deg: outside -90 to 90 deg"),
        (TableMotion(Z, float("nan")), "motion: a rate or an angle is not a finite number"),
        (TableMotion(accelerations=((0, 0, -9.81),)), "acceleration: in free fall no tilt"),
    ],
)
def test_a_motion_without_sense_is_refused_in_one_line(motion, text):
    with pytest.raises(RotcliError, match=text):
        analyse(motion)


@pytest.mark.parametrize(
    ("parameter", "limits", "text"),
    [
        ("pitch", (0, 1, 0), "the step does not lead from start to end"),
        ("pitch", (0, 1, -0.1), "the step does not lead from start to end"),
        ("roll", (0, 1, 1e-6), "1000001 points; the limit is 20000"),
        ("rate", (0, 1, 0.1), "the table is still; set a rotation axis"),
    ],
)
def test_a_sweep_that_leads_nowhere_is_refused(parameter, limits, text):
    with pytest.raises(RotcliError, match=text):
        sweep(TableMotion(), parameter, *limits)


def test_the_nullspace_never_reaches_the_measurement():
    """An independent check of the rank: simulate the linear system from a hidden state."""
    from scipy.linalg import expm

    motion = TableMotion(Z, TEN, azimuth=0.4)
    result = analyse(motion)
    F = zupt_error_dynamics(motion.latitude, motion.forces_n[0], motion.w_ns_n)
    for t in (1.0, 7.0, 30.0):
        reached = (expm(F * t) @ result.n.nullspace)[:3]
        # 1e-12 of gT = 60 m/s: rounding of hidden parts that cancel.
        assert np.abs(reached).max() < 1e-10
