"""Scenario files of voyages."""

import numpy as np
import pytest

from rotcli.errors import RigError
from rotcli.srins.reciprocation import RotationScheme
from rotcli.srins.voyage.scenario import (
    ARCSEC,
    MICRO_G,
    Maneuver,
    SrinsScenario,
    read_srins_scenario,
    scenario_from_dict,
)
from rotcli.srins.voyage.simulate import Voyage, reciprocation
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR, HOUR, PPM


def test_the_word_srins_is_the_papers_set_up():
    paper = read_srins_scenario("srins")
    assert paper.duration == 34 * HOUR
    assert paper.latitude == pytest.approx(42.3 * DEG)
    np.testing.assert_allclose(paper.gyro.bias, 0.003 * DEG_PER_HOUR)
    np.testing.assert_allclose(paper.accel.bias, 20 * MICRO_G)
    assert paper.gyro.noise["white"] == pytest.approx(0.0005 * DEG_PER_ROOT_HOUR)
    assert paper.accel.noise["white"] == pytest.approx(MICRO_G)  # ug/sqrt(Hz) is m/s/sqrt(s)
    assert paper.gyro.matrix[0, 0] == pytest.approx(10 * PPM)
    assert paper.accel.matrix[2, 1] == pytest.approx(2 * ARCSEC)
    assert reciprocation(paper) == RotationScheme()


def test_what_a_file_leaves_out_is_the_papers_too(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        'scenario = "srins"\nrate = 50.0\n[gyro]\nbias = [1, 2, 3]\n[rotation]\nkind = "two-stop"\n'
        "[[maneuver]]\nstart = 2.0\na_north = 0.2\n[gnss]\noutages = [[1.0, 1.5]]\n"
    )
    mine, paper = read_srins_scenario(str(path)), SrinsScenario()
    assert (mine.rate, mine.rotation_kind) == (50.0, "two-stop")
    np.testing.assert_allclose(mine.gyro.bias, np.array([1, 2, 3]) * DEG_PER_HOUR)
    np.testing.assert_array_equal(mine.accel.matrix, paper.accel.matrix)
    maneuver = mine.maneuvers[0]
    assert (maneuver.start, maneuver.a_north, maneuver.doppler) == (2 * HOUR, 0.2, "follows")
    assert mine.outages == ((3600.0, 5400.0),)


@pytest.mark.parametrize(
    ("follow", "gained"),
    [("follows", [0, 5, 20, 20]), ("frozen", [0, 0, 0, 20]), ("held", [0, 0, 0, 0])],
)
def test_a_doppler_log_follows_a_maneuver_or_keeps_the_old_speed(follow, gained):
    maneuver = Maneuver(1000.0, 20.0, 0.1, -0.2, follow)
    voyage = Voyage(SrinsScenario(v_east=1.0, v_north=2.0, maneuvers=(maneuver,)))
    time = np.array([999.0, 1005.0, 1020.0 - 1e-9, 1020.0])
    for doppler, seconds in ((True, gained), (False, [0, 5, 20, 20])):
        v = voyage.velocity(time, doppler=doppler)
        np.testing.assert_allclose(v[0], 1.0 + 0.1 * np.array(seconds), atol=1e-8)
        np.testing.assert_allclose(v[1], 2.0 - 0.2 * np.array(seconds), atol=1e-8)


def test_a_turntable_scenario_is_no_voyage(tmp_path):
    path = tmp_path / "table.toml"
    path.write_text('profile = "mti-g"\n[[leg]]\nduration = 60\n')
    with pytest.raises(RigError, match="profile: unknown key"):
        read_srins_scenario(str(path))


@pytest.mark.parametrize(
    ("data", "text"),
    [
        ({"speed": 1}, "speed: unknown key"),
        ({"gyro": {"drift": 1}}, r"\[gyro\] drift: unknown key; "),
        ({"rate": 200.0}, "rate: 200.0 is out of range; allowed: 1 to 100 Hz"),
        ({"rate": "fast"}, "'fast' is not a number"),
        ({"gnss": {"rate": 0}}, r"\[gnss\] rate: 0 is out of range; allowed: above 0"),
        ({"site": {"latitude": 89.0}}, "too near a pole"),
        ({"rotation": {"kind": "odd"}}, "'odd' is none of one-stop, two-stop, still"),
        ({"maneuver": [{"doppler": "lost"}]}, r"\[\[maneuver\]\] 1 doppler: 'lost' is none of"),
        ({"maneuver": {"start": 1}}, r"maneuver: write it as \[\[maneuver\]\]"),
        ({"gyro": {"bias": [1, 2]}}, r"\[gyro\] bias: .* is not a list of 3 numbers"),
        ({"gnss": {"outages": [[2, 1]]}}, "ends before it starts"),
        ({"gnss": {"outages": [1]}}, r"must be a list of \[start, end\] pairs"),
        ({"gnss": 5}, r"\[gnss\] must be a table of keys"),
        ({"seed": -1}, "-1 is out of range"),
        ({"duration": 0}, "duration: 0 is out of range; allowed: above 0, at most 1000 h"),
        ({"doppler": {"noise": -0.1}}, "-0.1 is out of range"),
    ],
)
def test_what_makes_no_sense_is_named(data, text):
    with pytest.raises(RigError, match=text):
        scenario_from_dict(data, "mine.toml")
