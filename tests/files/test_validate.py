"""A result document that breaks the contract is rejected in one line that names the key."""

import json

import pytest

from rotcli.allan.document import coefficient_units
from rotcli.errors import ResultError
from rotcli.files.results.validate import unique_keys, validate
from rotcli.models.triad.parameters import names, unit_names


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A calibration and a navigation, as the commands write them."""
    from rotcli.calibrate.api import calibrate_logs
    from rotcli.logs.imu import read_imu
    from rotcli.logs.table import read_table
    from rotcli.navigate.api import prepare_navigation
    from rotcli.rig.rig import read_rig
    from tests.conftest import FIXTURES

    place = FIXTURES / "nav440_rate_60"
    rig = read_rig(str(place / "rig.toml"))
    logs = read_imu(place / "imu.parquet", rig), read_table(place / "table.parquet", rig)
    folder = tmp_path_factory.mktemp("results")
    calibration = calibrate_logs(*logs, rig)
    calibration.write(str(folder / "c.json"))
    prepared = prepare_navigation(*logs, rig)
    prepared.navigate("conventional").finish().write(str(folder / "n.json"))
    return folder


def set_at(document, place, value):
    """Set a value at a place such as `parameters.Kgz.unit`; None removes the key."""
    *above, last = place.split(".")
    for key in above:
        document = document[int(key) if isinstance(document, list) else key]
    key = int(last) if isinstance(document, list) else last
    if value is None:
        del document[key]
    else:
        document[key] = value


def test_what_the_commands_write_is_valid(results):
    for path in results.glob("*.json"):
        validate(json.loads(path.read_text()), str(path))


@pytest.mark.parametrize(
    ("place", "value", "text"),
    [
        ("parameters.bias_x.unit", "deg/s", 'parameters.bias_x.unit: "deg/s": must be deg/h'),
        ("parameters.bias_x.unit", None, "parameters.bias_x: "),
        ("parameters.bias_x.sigma", -5.0, "parameters.bias_x.sigma: -5.0: must be bigger"),
        ("parameters.bias_x.value", 1e150, "parameters.bias_x.value: 1e+150: must be smaller"),
        ("parameters.bias_x.value", "a", 'parameters.bias_x.value: "a": must be number or null'),
        ("parameters.Kgz.value", 1e6, "parameters.Kgz.value: 1000000.0"),
        ("parameters.Kgz.value", -1e6, "parameters.Kgz.value: -1000000.0"),
        ("parameters.Kgz", None, "parameters: Kgz missing for a rotation about z"),
        ("covariance.matrix.5", None, "covariance.matrix: 5 rows of 6 for 6 parameters"),
        ("covariance.matrix.0.1", 1e4, "covariance.matrix: not symmetric"),
        ("covariance.matrix.0.0", -1.0, "covariance.matrix: the variance of bias_x is negative"),
        ("covariance.matrix.0.0", "a", 'covariance.matrix[0][0]: "a": must be number'),
        ("covariance.units.0", "deg/s", "covariance.units: not those of the parameters"),
        ("covariance.order.0", "bias_q", "covariance.order: bias_q is not a parameter"),
        ("axis", "x", "parameters: Kgx, Kgyx, Kgzx missing for a rotation about x"),
        ("axis", [0.0, 0.0, 10.0], "axis: [0.0, 0.0, 10.0] is not a unit vector"),
        ("left_out", 7, "left_out: 7: must be object"),
        ("left_out", [[1]], "must be object"),
        ("schema", True, "schema: true is not 1"),
        ("warnings", [1], "warnings[0]: 1: must be string"),
    ],
)
@pytest.mark.parametrize("command", ["navigate", "observe", "report", "budget"])
def test_an_edited_calibration_is_rejected_by_every_command(
    results, turning, rotcli, command, place, value, text
):
    document = json.loads((results / "c.json").read_text())
    set_at(document, place, value)
    edited = turning / "edited.json"
    edited.write_text(json.dumps(document))
    logs = (turning / "imu.parquet", turning / "table.parquet")
    lines = {
        "navigate": ("navigate", *logs, "--calibration", edited),
        "observe": ("observe", *logs, "--calibration", edited),
        "report": ("report", edited),
        "budget": ("budget", "--calibration", edited),
    }
    done = rotcli(*lines[command])
    assert (done.status, done.out) == (1, "")
    assert done.err.startswith(f"rotcli: error: {edited}: ")
    assert text in done.err
    assert done.err.count("\n") == 1


@pytest.mark.parametrize(
    ("place", "value", "text"),
    [
        ("rms.horizontal_m", -5.0, "rms.horizontal_m: -5.0: must be bigger"),
        ("duration_s", -5.0, "duration_s: -5.0: must be bigger"),
        ("mode", "best", 'mode: "best"'),
    ],
)
def test_an_edited_navigation_is_rejected(results, tmp_path, rotcli, place, value, text):
    document = json.loads((results / "n.json").read_text())
    set_at(document, place, value)
    (tmp_path / "n.json").write_text(json.dumps(document))
    done = rotcli("report", tmp_path / "n.json")
    assert done.status == 1
    assert text in done.err


@pytest.mark.parametrize("key", ["axis", "bias_x"])
def test_a_key_that_occurs_twice_is_rejected(results, tmp_path, rotcli, key):
    text = (results / "c.json").read_text()
    start = text.index(f'"{key}": ')
    (tmp_path / "c.json").write_text(text[:start] + f'"{key}": 1, ' + text[start:])
    done = rotcli("report", tmp_path / "c.json")
    assert done.status == 1
    assert f"{key}: this key occurs twice" in done.err


@pytest.mark.parametrize(("name", "unit"), list(zip(names(2), unit_names(2), strict=True)))
def test_the_unit_of_every_parameter_of_both_triads_is_part_of_the_contract(name, unit):
    quantity = {"value": 1.0, "sigma": 0.1, "unit": unit}
    document = {"kind": "calibration", "schema": 1, "parameters": {name: quantity}}
    validate(document, "c.json")
    quantity["unit"] = "furlong"
    with pytest.raises(ResultError, match=rf"parameters\.{name}\.unit: \"furlong\": must be "):
        validate(document, "c.json")


@pytest.mark.parametrize("axis", ["gyro_x", "accel_z"])
def test_unit_and_sign_of_every_noise_coefficient_are_part_of_the_contract(axis):
    for name, (unit, *_) in coefficient_units(axis).items():
        quantity = {"value": 1.0, "sigma": 0.1, "unit": unit}
        axes = {axis: {"coefficients": {name: quantity}}}
        document = {"kind": "allan", "schema": 1, "axes": axes}
        validate(document, "a.json")
        for key, value in (("unit", "furlong"), ("value", -1.0), ("sigma", -1.0)):
            quantity[key], right = value, quantity[key]
            with pytest.raises(ResultError, match=rf"axes\.{axis}\.coefficients\.{name}\.{key}: "):
                validate(document, "a.json")
            quantity[key] = right


def test_a_repeated_key_is_found_among_very_many():
    """Counting each name among all others would take minutes."""
    pairs = [(f"k{k}", 0) for k in range(200_000)]
    with pytest.raises(ValueError, match="k199999: this key occurs twice"):
        unique_keys([*pairs, pairs[-1]])
