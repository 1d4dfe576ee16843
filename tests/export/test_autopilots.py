"""Temperature polynomials evaluated as the autopilots do, and the matrices of three axes."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rotcli.export.figures import collect
from rotcli.export.formats import render
from rotcli.export.intrinsics import intrinsics, lower_times_rotation
from rotcli.export.numbers import Settings
from rotcli.export.polynomials import recentre, to_order
from tests.export import documents

DEG_PER_HOUR = np.pi / 180 / 3600


def parameters(name: str, *docs, **settings) -> dict[str, float]:
    text = render(name, collect(docs), Settings(**settings)).text
    if name == "px4":
        rows = re.findall(r"^1\t1\t(\w+)\t(\S+)\t[69]$", text, re.MULTILINE)
    else:
        rows = re.findall(r"^(\w+),(\S+)$", text, re.MULTILINE)
    return {key: float(value) for key, value in rows}


def b1(T: np.ndarray) -> np.ndarray:
    x = (T - 20.0) / 40.0
    return (60 + 400 * x - 150 * x**2 + 80 * x**3) * DEG_PER_HOUR


def test_ardupilot_coefficients_of_set_b1_equal_the_table() -> None:
    values = parameters("ardupilot", documents.thermal())
    assert f"{values['INS_GYROFFS_X']:.6e}" == "9.362964e-04"
    assert f"{values['INS_TCAL1_GYR1_X']:.7f}" == "38.9365988"
    assert f"{values['INS_TCAL1_GYR2_X']:.9f}" == "-0.181805130"
    assert f"{values['INS_TCAL1_GYR3_X']:.11f}" == "0.00606017101"
    assert values["INS_GYR1_CALTEMP"] == 35.0
    assert (values["INS_TCAL1_TMIN"], values["INS_TCAL1_TMAX"]) == (-20.0, 60.0)


def test_ardupilot_correction_is_the_bias_over_temperature() -> None:
    values = parameters("ardupilot", documents.thermal(), instance=2)
    T = np.linspace(-20.0, 60.0, 9)

    def p(dT: np.ndarray) -> np.ndarray:
        return 1e-6 * sum(values[f"INS_TCAL2_GYR{n}_Y"] * dT**n for n in (1, 2, 3))

    caltemp = values["INS_GYR2_CALTEMP"]
    removed = p(T - 35.0) - p(caltemp - 35.0) + values["INS_GYR2OFFS_Y"]
    assert removed == pytest.approx(b1(T), abs=1e-12)  # ten digits of 1e-3 rad/s


def test_px4_correction_is_the_bias_over_temperature_and_counts_it_once() -> None:
    values = parameters("px4", documents.thermal(), documents.triad(), device=1310988)
    T = np.linspace(-20.0, 60.0, 9)
    dT = T - values["TC_G0_TREF"]
    removed = sum(values[f"TC_G0_X{n}_1"] * dT**n for n in range(4)) + values["CAL_GYR0_YOFF"]
    assert removed == pytest.approx(b1(T), abs=1e-12)
    assert values["TC_G0_ID"] == 1310988
    assert values["CAL_GYR0_XOFF"] == 0.0


def test_matlab_has_bias_and_slopes_at_25_degrees() -> None:
    docs = [documents.allan(), documents.thermal()]
    text = render("matlab", collect(docs), Settings()).text
    T = np.array([24.999, 25.0, 25.001])
    low, middle, high = b1(T)

    def values(name: str) -> list[float]:
        row = re.search(rf"'{name}', \[([^\]]*)\]", text)[1]
        return [float(part) for part in row.split(",")]

    assert values("ConstantBias") == pytest.approx([middle] * 3, rel=1e-9)
    assert values("TemperatureBias") == pytest.approx([(high - low) / 0.002] * 3, rel=1e-6)
    slope = 100e-6 * (documents.B1_SCALE[1] + 2 * documents.B1_SCALE[2] * 5.0)  # %/degC, gyro z
    assert values("TemperatureScaleFactor") == pytest.approx([0.0, 0.0, slope], rel=1e-9)


def test_forward_right_down_is_a_rotation_of_right_forward_up() -> None:
    sensor = parameters("ardupilot", documents.triad())
    turned = parameters("ardupilot", documents.triad(), frame="frd")
    x, y, z = (sensor[f"INS_GYROFFS_{a}"] for a in "XYZ")
    assert [turned[f"INS_GYROFFS_{a}"] for a in "XYZ"] == [y, x, -z]


def test_an_order_above_three_is_refitted_and_the_residual_stated() -> None:
    fourth = (1e-6,)  # deg/h/degC^4
    text = render("px4", collect([documents.thermal(fourth)]), Settings()).text
    residual = float(re.search(r"added residual up to (\S+) deg/h", text)[1])
    # T^4 on a range of +-40 degC: least Chebyshev residual is 40^4/8 of the coefficient.
    assert residual == pytest.approx(1e-6 * 40.0**4 / 8.0, rel=0.02)
    assert "max |K(T) - K(T_ref)| is 1900 ppm" in text  # 1500 + 400 at 60 degC


@settings(max_examples=30)
@given(
    st.lists(st.floats(-10, 10), min_size=1, max_size=6),
    st.floats(-40, 60),
    st.floats(-40, 60),
)
def test_recentred_polynomials_have_the_same_values(row, old, new) -> None:
    moved = recentre(np.array([row]), old, new)[0]
    T = np.linspace(-40.0, 80.0, 13)
    expected = np.polynomial.polynomial.polyval(T - old, row)
    scale = sum(abs(c) * 120.0**n for n, c in enumerate(row)) + 1.0
    assert np.abs(np.polynomial.polynomial.polyval(T - new, moved) - expected).max() < 1e-10 * scale


def test_a_curve_between_knots_becomes_a_cubic_with_its_residual() -> None:
    """Values of the curve are those of set B-1, a cubic: the residual is rounding alone."""
    source, doc = documents.thermal()
    T = np.linspace(-20.0, 60.0, 41)
    doc["curve"] = {"temperature_degC": T.tolist()}
    for axis in "xyz":
        doc["channels"][f"gyro_{axis}"]["powers"] = None
        bias = (b1(T) / DEG_PER_HOUR).tolist()
        doc["curve"][f"gyro_{axis}"] = {"bias": bias, "unit": "deg/h"}
    thermal = collect([(source, doc)]).thermal
    assert thermal.gyro[1] / DEG_PER_HOUR == pytest.approx(documents.B1_BIAS, rel=1e-9)
    assert thermal.residual[0] < 1e-9 * DEG_PER_HOUR
    knee = np.maximum(T - 20.0, 0.0)
    doc["curve"]["gyro_x"]["bias"] = knee.tolist()
    residual = collect([(source, doc)]).thermal.residual[0] / DEG_PER_HOUR
    # Best cubic of a knee of 40 deg/h on [-1, 1]: |t|/2 has 0.0625 by Chebyshev (quadratic).
    assert 0.9 < residual / (40.0 * 0.0625) < 1.6


def test_three_thermal_tests_give_three_scale_factors() -> None:
    docs = [documents.thermal(axis=axis) for axis in "xyz"]
    scale = collect(docs).thermal.scale
    assert scale == pytest.approx(1e-6 * np.array([documents.B1_SCALE] * 3))
    alone = collect(docs[:1]).thermal.scale
    assert np.isnan(alone[1:]).all()


def test_a_cubic_is_not_refitted() -> None:
    cubic = np.array([[1.0, -2.0, 0.5, 0.1]])
    assert to_order(cubic, 20.0, 35.0, -20.0, 60.0).residual == 0.0


@settings(max_examples=30)
@given(st.lists(st.floats(-0.2, 0.2), min_size=9, max_size=9))
def test_lower_times_rotation_is_exact(elements) -> None:
    matrix = np.eye(3) + np.reshape(elements, (3, 3))
    lower, rotation = lower_times_rotation(matrix)
    assert lower @ rotation == pytest.approx(matrix, abs=1e-14)
    assert np.triu(lower, 1) == pytest.approx(np.zeros((3, 3)), abs=1e-15)
    assert (np.diag(lower) > 0).all()
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-14)
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-14)


def test_both_triads_refer_to_the_accelerometers_frame() -> None:
    """A common rotation of all sensors must vanish: only the difference of the triads remains."""
    angle = 2e-3
    turn = np.array([[1, -angle, 0], [angle, 1, 0], [0, 0, 1]]) / np.array(
        [[np.hypot(1, angle)] * 2 + [1]]
    )
    source, doc = documents.triad()
    for a, row in zip("xyz", turn, strict=True):
        for b, value in zip("xyz", row, strict=True):
            element = a if a == b else a + b
            for sensor in ("Kg", "Ka"):
                ppm = 1e6 * (value - (a == b))
                doc["parameters"][sensor + element] = documents.quantity(ppm, 1.0, "ppm")
    known = intrinsics(collect([(source, doc)]))
    assert known.accel == pytest.approx(np.eye(3), abs=1e-12)
    assert known.gyro == pytest.approx(np.eye(3), abs=1e-12)


def test_a_missing_accelerometer_matrix_is_the_identity_and_said() -> None:
    text = render("kalibr", collect([documents.allan(), documents.triad()]), Settings()).text
    assert "the accelerometer matrix is not known: the identity is written" in text
    text = render("kalibr", collect([documents.allan()]), Settings()).text
    assert "model:" not in text
    assert "calibrated sensors assumed" in text


@pytest.mark.parametrize(("program", "prefix"), [("px4", "CAL_ACC1_"), ("ardupilot", "INS_ACC2")])
def test_the_accelerometer_scale_undoes_the_scale_factor(program, prefix) -> None:
    source, doc = documents.triad()
    factors = {"x": 2e4, "y": -1e4, "z": 5e3}
    for axis, ppm in factors.items():
        doc["parameters"][f"Ka{axis}"] = documents.quantity(ppm, 1.0, "ppm")
    values = parameters(program, (source, doc), instance=2)
    name = "{}SCALE" if program == "px4" else "SCAL_{}"
    for axis, ppm in factors.items():
        written = values[prefix + name.format(axis.upper())]
        assert written * (1.0 + 1e-6 * ppm) == pytest.approx(1.0, rel=1e-9)


def test_the_residual_of_a_curve_between_knots_is_stated() -> None:
    source, doc = documents.thermal()
    T = np.linspace(-20.0, 60.0, 41)
    doc["curve"] = {"temperature_degC": T.tolist()}
    for axis in "xyz":
        doc["channels"][f"gyro_{axis}"]["powers"] = None
        bias = np.maximum(T - 20.0, 0.0).tolist()
        doc["curve"][f"gyro_{axis}"] = {"bias": bias, "unit": "deg/h"}
    figures = collect([(source, doc)])
    text = render("px4", figures, Settings()).text
    stated = float(re.search(r"added residual up to (\S+) deg/h", text)[1])
    assert stated == pytest.approx(figures.thermal.residual[0] / DEG_PER_HOUR, rel=5e-3)
    # The cubic that is written is that far from the knee at most, and so far somewhere.
    values = parameters("px4", (source, doc))
    dT = T - values["TC_G0_TREF"]
    cubic = sum(values[f"TC_G0_X{n}_0"] * dT**n for n in range(4)) / DEG_PER_HOUR
    left = np.abs(cubic - np.maximum(T - 20.0, 0.0)).max()
    assert left == pytest.approx(stated, rel=5e-3)


def test_the_rig_gives_ranges_and_the_gravity_of_its_latitude() -> None:
    source, doc = documents.triad()
    doc["rig"] = {"site": {"latitude": 45.0, "height": 0.0}, "imu": {"accel_range": 40.0}}
    figures = collect([(source, doc)])
    assert figures.accel_range == 40.0
    # WGS 84, normal gravity at 45 deg: 9.806199 m/s^2.
    assert figures.gravity == pytest.approx(9.806199, abs=2e-6)


def test_a_refitted_polynomial_deviates_by_its_residual() -> None:
    row = np.array([[3.0, -0.2, 0.01, 2e-4, -5e-6]])
    found = to_order(row, 20.0, 30.0, -10.0, 55.0)
    T = np.linspace(-10.0, 55.0, 500)
    before = np.polynomial.polynomial.polyval(T - 20.0, row[0])
    after = np.polynomial.polynomial.polyval(T - 30.0, found.coefficients[0])
    assert np.abs(after - before).max() == pytest.approx(found.residual, rel=0.02)
    # The fourth Chebyshev polynomial: an eighth of the coefficient over the half range.
    assert found.residual == pytest.approx(5e-6 * 32.5**4 / 8.0, rel=0.02)
