"""Every numeric key of rig, profile, scenario, sequence, SRINS scenario and spec has limits.

Each key gets values that no machine has; the file is refused in one line that names the key.
"""

import contextlib
import math
from pathlib import Path

import pytest

from rotcli.errors import RigError
from rotcli.files import spec
from rotcli.files.toml_schema import Key, to_toml
from rotcli.rig import environment, keys, profile, scenario, sequence
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import rig_from_dict
from rotcli.rig.scenario import read_scenario
from rotcli.rig.sequence import read_sequence
from rotcli.srins.voyage import scenario as srins

NUMERIC = ("number", "figure", "vector", "scale", "offset")
# No key of a file allows any of them: the largest limit is 1e20, of raw counts.
HOSTILE = [
    *(math.nan, math.inf, -math.inf, 1e308, -1e308, 1e30, -1e30, 10**400, -(10**400), 10**30),
    *("", "1e3", "../../../../etc/passwd", "\x1b]0;x\x07", True, [], [[]], ["x"], [1e308] * 3, {}),
    *([math.nan] * 3, [1.0, 2.0], [1.0] * 4, {"all": math.inf}, {"gyro": [1e308] * 3}),
]


def _file(tmp_path, text):
    path = Path(tmp_path) / "file.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


SCENARIO = 'profile = "nav440"\n{top}\n[[leg]]\nduration = 10\nrate = 5\n{leg}\n{more}'
SEQUENCE = "axes = ['z']\n{top}\n[[steps]]\n{step}\n{more}"


def _scenario(top="", leg="", more=""):
    text = SCENARIO.format(top=top, leg=leg, more=more)
    if leg.startswith(("duration", "rate")):
        text = text.replace(f"{leg.split(' ')[0]} = {10 if leg[0] == 'd' else 5}\n", "")
    return text


def _sources():
    """Yield (id, key, function of a value to the text of a file, reader of the file)."""
    for section, table in keys.KEYS.items():
        for name, key in table.items():
            yield f"rig [{section}] {name}", key, ("rig", section, name), None
    for name, key in keys.MOUNTING_KEYS.items():
        yield f"rig [[mountings]] {name}", key, ("mounting", "", name), None
    yield "profile rate", profile._RATE, lambda v: f"rate = {v}", read_profile
    for triad in ("gyro", "accel"):
        for name, (_, key) in profile._NOISE_KEYS[triad].items():
            yield (
                f"profile [{triad}] {name}",
                key,
                lambda v, t=triad, n=name: f"[{t}]\n{n} = {v}",
                read_profile,
            )
        for name, key in profile._OTHERS[triad].items():
            if name == "installation":
                text = lambda v, t=triad: f"[{t}]\ninstallation = {{ xy = {v} }}"  # noqa: E731
            elif name in profile._LIMITS:
                text = lambda v, t=triad, n=name: f"[{t}]\n{n} = {v}"  # noqa: E731
            else:
                text = lambda v, t=triad, n=name: f"[{t}]\n{n} = [0, {v}, 0]"  # noqa: E731
            yield f"profile [{triad}] {name}", key, text, read_profile
    for name, key in scenario.SCENARIO_KEYS.items():
        if key.kind == "number":
            yield f"scenario {name}", key, lambda v, n=name: _scenario(f"{n} = {v}"), read_scenario
    for name, key in scenario.LEG_KEYS.items():
        if key.kind == "number":
            yield (
                f"scenario [[leg]] {name}",
                key,
                lambda v, n=name: _scenario(leg=f"{n} = {v}"),
                read_scenario,
            )
    for section, table in environment.KEYS.items():
        for name, key in table.items():
            yield f"scenario [{section}] {name}", key, _environment(section, name), read_scenario
    for name, key in sequence.NUMBERS.items():
        yield f"sequence {name}", key, _sequence(name), read_sequence
    for section, table in srins.NUMBERS.items():
        for name, (_, key) in table.items():
            head = "[[maneuver]]" if section == "maneuver" else f"[{section}]" if section else ""
            yield (
                f"srins [{section}] {name}",
                key,
                lambda v, h=head, n=name: f"{h}\n{n} = {v}",
                srins.read_srins_scenario,
            )
    for name, (_, key) in srins.BIASES.items():
        text = lambda v, n=name: f"[{n}]\nbias = [0, {v}, 0]"  # noqa: E731
        yield f"srins [{name}] bias", key, text, srins.read_srins_scenario
    for name, key in spec.KEYS.items():
        if key.kind == "number":
            other = "max = 1" if name == "min" else "min = 0"
            text = lambda v, n=name, o=other: f'[limits.bias_x]\nunit = "deg/h"\n{n} = {v}\n{o}'  # noqa: E731
            yield f"spec {name}", key, text, spec.read_spec


def _environment(section, name):
    def text(v):
        body = {
            ("temperature", "time"): f"profile = [[{v}, 20]]",
            ("temperature", "profile"): f"profile = [[0, {v}]]",
            ("nonlinearity", "knee"): f"knee = [{v}, 1]",
            ("nonlinearity", "knee rate"): f"knee = [1, {v}]",
        }.get((section, name))
        if body is None:
            listed = name.startswith(("gyro", "accel"))
            body = f"{name} = [{v}]" if listed else f"{name} = {v}"
            body += "\nprofile = [[0, 20]]" if section == "temperature" else ""
        more = "[temperature]\nprofile = [[0, 20]]\n" if section == "thermal" else ""
        return _scenario(more=f"{more}[{section}]\n{body}")

    return text


def _name(place):
    """Return the name of a key as a message shows it."""
    name = place.rpartition("] ")[2] if "]" in place else place.partition(" ")[2]
    return {"time": "", "knee rate": "knee", "error": "errors"}.get(name, name)


def _sequence(name):
    def text(v):
        if name in ("acceleration", "slew_rate"):
            return SEQUENCE.format(top=f"{name} = {v}", step="hold = 10", more="")
        if name == "error":
            return SEQUENCE.format(top="", step="hold = 10", more=f"[errors]\ngsens_xx = {v}")
        if name in ("rate", "turns"):
            other = "rate = 10\n" if name == "turns" else ""
            return SEQUENCE.format(top="", step=f'spin = "axis"\n{other}{name} = {v}', more="")
        return SEQUENCE.format(top="", step=f"{name} = {[v] if name == 'go' else v}", more="")

    return text


ALL = [
    pytest.param(_name(place), key, how, reader, id=place) for place, key, how, reader in _sources()
]


@pytest.mark.parametrize(("name", "key", "how", "reader"), ALL)
def test_a_value_that_no_machine_has_is_refused_in_one_line(name, key: Key, how, reader, tmp_path):
    assert len(ALL) > 120
    numeric = key.kind in NUMERIC
    if numeric:
        assert math.isfinite(key.low), "give the key a lower limit"
        assert math.isfinite(key.high), "give the key an upper limit"
    beyond = [key.high * 1.001 + 1e-9, key.low - 1e-9 - 0.001 * abs(key.low)] if numeric else []
    beyond += [key.low] if key.above else []
    for value in (*HOSTILE, *beyond):
        read = _reader(how, reader, value, tmp_path)
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if numeric and is_number:
            with pytest.raises(RigError) as error:
                read()
            assert "\n" not in str(error.value)
            assert name in str(error.value)
        else:  # texts of a text key and lists of a figure may be right; a traceback is not
            with contextlib.suppress(RigError):
                read()


def _reader(how, reader, value, tmp_path):
    if isinstance(how, tuple):
        kind, section, name = how
        if kind == "mounting":
            mounting = {"from": 0.0, "to": 1.0, "mount": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
            return lambda: rig_from_dict({"mountings": [{**mounting, name: value}]})
        base = {"latitude": 50.0} if section == "site" else {}
        return lambda: rig_from_dict({section: {**base, name: value}})
    # TOML has no integers above 64 bits and no texts in a number's place here.
    text = how(to_toml(value))
    return lambda: reader(_file(tmp_path, text))
