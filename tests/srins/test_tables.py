"""Claims of the level-damping paper and figures of its errors, from documents and voyages."""

import numpy as np
import pytest

from rotcli.files.results.groups import Source
from rotcli.logs.record import TableLog
from rotcli.models import rotation
from rotcli.srins import level_ins
from rotcli.srins.attitude import attitude_errors
from rotcli.srins.claims import claims_table
from rotcli.srins.model import Damping
from rotcli.srins.navigate import SrinsRun
from rotcli.srins.plot import attitude_figure, damping_figure, srins_figures

TIME = np.linspace(0.0, 10.0, 41)


def voyage(mode="damped", maneuver=None, z=(0.0030, 0.00033), velocity=0.1, attitude=True):
    """Return the parts of a result that claims and figures use; drifts in deg/h."""
    history = {
        name: {"estimate": 0.003 + 0.0 * TIME, "sigma": 0.001 / (1.0 + TIME), "unit": unit}
        for name, unit in (
            *((f"gyro_bias_{a}", "deg/h") for a in "xyz"),
            *((f"accel_bias_{a}", "m/s^2") for a in "xy"),
            *((f"phi_{a}", "arcsec") for a in "ENU"),
        )
    }
    if attitude:
        history["phi_E"]["true"] = 0.1 * TIME
    error = {"v_east_mps": velocity * np.cos(TIME), "v_north_mps": 0.5 * velocity * np.sin(TIME)}
    error |= {"east_m": TIME, "north_m": TIME, "time_h": TIME}
    if attitude:
        error |= {f"phi_{c}_arcsec": TIME for c in "ENU"}
    values = {"gyro_bias_x": (0.0018, 0.0031), "gyro_bias_y": (0.0031, 0.0003), "gyro_bias_z": z}
    return {
        "kind": "srins",
        "mode": mode,
        "maneuvers_h": [] if maneuver is None else [maneuver],
        "filter": {"start_s": 0.0, "end_s": 36000.0},
        "estimates": {k: {"value": v, "sigma": s} for k, (v, s) in values.items()},
        "truth": {f"gyro_bias_{a}": 0.003 for a in "xyz"},
        "expected_bias": {"value": 0.00021},
        "ins_error": error,
        "history": {"time_h": TIME, **history},
    }


def verdicts(*docs):
    table = claims_table([Source(f"{k}.json", doc) for k, doc in enumerate(docs)])
    return {row[0]: row[1:] for row in table.rows}


def test_each_claim_is_judged_by_the_results():
    found = verdicts(
        voyage(),
        voyage("undamped", velocity=0.4),
        voyage(maneuver=1.5),
        voyage(maneuver=4.5),
    )
    assert {claim: supported for claim, (supported, _) in found.items()} == {
        "damping keeps the velocity errors small": "yes",
        "the drift along the axis is estimated accurately": "yes",
        "the estimate of the drift needs the damping": "no",
        "an early maneuver leaves a lasting offset": "no",
        "a late maneuver speeds up convergence": "no",
        "the estimates of the x and y drifts are modulated equivalents": "no",
    }
    assert "3.00, true 3.00; sigma 11%, uncalibrated errors 7%" in found[list(found)[1]][1]
    assert "y 3.10 (sigma 0.30), true 3.00 in the sensor frame" in found[list(found)[5]][1]


def test_results_that_support_a_claim_change_its_verdict():
    found = verdicts(
        voyage(),
        voyage("undamped", z=(0.003, 0.0005)),
        voyage(maneuver=1.5, z=(0.0042, 0.00033)),
        voyage(maneuver=4.5, z=(0.003, 0.0002)),
    )
    supported = [verdict for verdict, _ in found.values()]
    assert supported[0] == "no"  # the undamped velocity error is no larger
    assert supported[2:5] == ["yes", "yes", "yes"]


DRIFT, SIGMA = 0.003, 0.00033  # deg/h


@pytest.mark.parametrize(
    ("claim", "docs", "supported"),
    [
        # Half of the undamped error; the north component is half of the east one.
        (0, lambda: [voyage(velocity=0.1), voyage("undamped", velocity=0.201)], "yes"),
        (0, lambda: [voyage(velocity=0.1), voyage("undamped", velocity=0.199)], "no"),
        # Two sigma and the expected error of 0.21: 0.87.
        (1, lambda: [voyage(z=(DRIFT + 0.000866, SIGMA))], "yes"),
        (1, lambda: [voyage(z=(DRIFT - 0.000866, SIGMA))], "yes"),
        (1, lambda: [voyage(z=(DRIFT + 0.000874, SIGMA))], "no"),
        # A hundredth of sigma.
        (2, lambda: [voyage(), voyage("undamped", z=(DRIFT, 1.0098 * SIGMA))], "no"),
        (2, lambda: [voyage(), voyage("undamped", z=(DRIFT, 1.0102 * SIGMA))], "yes"),
        (4, lambda: [voyage(), voyage(maneuver=4.5, z=(DRIFT, 0.9902 * SIGMA))], "no"),
        (4, lambda: [voyage(), voyage(maneuver=4.5, z=(DRIFT, 0.9898 * SIGMA))], "yes"),
        # One sigma, of the worst early maneuver; late is after 40 % of ten hours.
        (3, lambda: [voyage(maneuver=3.98, z=(DRIFT - 0.995 * SIGMA, SIGMA))], "no"),
        (3, lambda: [voyage(maneuver=3.98, z=(DRIFT - 1.005 * SIGMA, SIGMA))], "yes"),
        (3, lambda: [voyage(maneuver=4.02, z=(DRIFT - 1.005 * SIGMA, SIGMA))], None),
    ],
)
def test_the_limits_of_the_claims_are_where_they_are_stated(claim, docs, supported):
    assert list(verdicts(*docs()).values())[claim][0] == supported


@pytest.mark.parametrize(("sigmas", "supported"), [(2.98, "yes"), (3.02, "no")])
def test_a_level_drift_is_real_beyond_three_sigma(sigmas, supported):
    doc = voyage()
    for name, value in (("gyro_bias_x", 0.0), ("gyro_bias_y", -sigmas * 0.0003)):
        doc["estimates"][name] = {"value": value, "sigma": 0.0003}
    assert list(verdicts(doc).values())[5][0] == supported


def test_the_figures_of_the_claims_are_in_thousandths_of_a_degree_per_hour():
    found = list(
        verdicts(
            voyage(z=(0.0035, 0.0004)),
            voyage("undamped", velocity=0.4, z=(DRIFT, 0.0005)),
            voyage(maneuver=1.5, z=(0.0042, SIGMA)),
            voyage(maneuver=4.5, z=(DRIFT, 0.0002)),
        ).values()
    )
    assert [text for _, text in found] == [
        "largest velocity error 0.1 m/s damped, 0.4 m/s undamped",
        "3.50, true 3.00; sigma 13%, uncalibrated errors 7%",
        "sigma 0.4000 with damping, 0.5000 without",
        "at the end off by 3.6 sigma at most",
        "sigma at the end 0.2000, in the other runs 0.3300",
        "x 1.80 (sigma 3.10), y 3.10 (sigma 0.30), true 3.00 in the sensor frame",
    ]


def test_claims_without_results_have_a_dash():
    found = verdicts(voyage("undamped"))
    assert set(found.values()) == {(None, None)}


def test_the_figures_show_velocity_attitude_and_position_and_the_maneuver():
    docs = [voyage(), voyage("undamped"), voyage(maneuver=1.5)]
    titles = [title for title, _ in srins_figures([Source(f"{k}", d) for k, d in enumerate(docs)])]
    for kind in ("velocity", "attitude", "position"):
        assert f"SRINS: INS {kind} error, damped and undamped" in titles
    assert "SRINS: attitude errors through a maneuver, 2" in titles
    lines = damping_figure(docs, "attitude").axes[2].get_lines()
    np.testing.assert_array_equal(lines[0].get_ydata(), TIME)
    panel = attitude_figure(docs[2]).axes[0]
    labels = [line.get_label() for line in panel.get_lines()]
    assert labels == ["estimate", "true", "maneuver"]


def test_without_a_truth_there_is_no_attitude_error():
    titles = [title for title, _ in srins_figures([Source("a", voyage(attitude=False))])]
    assert not [title for title in titles if "attitude" in title]


@pytest.mark.parametrize("azimuth", [0.0, 2.0])
def test_the_attitude_error_is_that_of_the_error_matrix(azimuth):
    # C_hat = (I - [phi x]) C, C level and rotated about up by the table angle less the azimuth.
    phi = np.array([1e-4, -2e-4, 5e-4])
    time = np.arange(4.0)
    angle = np.array([0.0, 1.0, 3.0, 5.0])
    up = np.array([0.0, 0.0, 1.0])
    q = []
    for theta in angle - azimuth:
        C_hat = (np.eye(3) - rotation.skew(phi)) @ rotation.axis_rotation(up, theta)
        u, _, vt = np.linalg.svd(C_hat)
        q.append(rotation.quaternion_from_matrix(u @ vt))
    zero = np.zeros((2, 4))
    solution = level_ins.LevelSolution(zero, zero[0], zero[0], np.zeros((4, 4)), np.array(q).T)
    run = SrinsRun(time, 1.0, solution, Damping())
    table = TableLog("table", time, angle, 1.0, 4)
    found = attitude_errors(run, table, azimuth)
    # Second order in phi: 5e-4 squared.
    np.testing.assert_allclose(found, np.tile(phi[:, None], 4), atol=3e-7)
