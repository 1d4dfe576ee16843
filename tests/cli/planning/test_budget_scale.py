"""`rotcli budget --scale`: sigmas of a test before the test."""

import json

import pytest

RATES = "0,10,20,50,100,100,50,20,10,0,-10,-20,-50,-100,-100,-50,-20,-10,0"


def test_alternating_signs_are_recommended_with_the_published_sigmas(rotcli, tmp_path):
    outcome = rotcli("budget", "--imu", "nav440", "--scale", RATES)
    assert outcome.status == 0
    assert "Alternate the signs" in outcome.out
    path = tmp_path / "design.json"
    outcome = rotcli("budget", "--imu", "nav440", "--scale", RATES, "-o", path)
    assert outcome.status == 0
    doc = json.loads(path.read_text())
    assert doc["planned"]["scale_ppm"] == pytest.approx(29.51, rel=0.01)
    assert doc["recommended"]["scale_ppm"] == pytest.approx(12.57, rel=0.01)
    assert doc["planned"]["bias_dph"] == pytest.approx(14.11, rel=0.01)
    assert doc["planned"]["bias_own_span_dph"] == pytest.approx(0.740, rel=0.01)
    assert doc["recommended"]["duration_s"] == 18 * 64 - 4
    # The range of the profile's gyros; without a profile the largest rate.
    assert doc["full_scale"] == {"value": pytest.approx(400.0), "sigma": None, "unit": "deg/s"}
    assert rotcli("budget", "--angle-random-walk", 0.4, "--scale", RATES, "-o", path).status == 0
    assert json.loads(path.read_text())["full_scale"]["value"] == pytest.approx(100.0)
    assert "12.6 ppm" in outcome.err


def test_short_segments_need_little_time(rotcli, tmp_path):
    path = tmp_path / "design.json"
    arguments = ("--imu", "nav440", "--scale", RATES, "--segment", 15, "-o", path)
    assert rotcli("budget", *arguments).status == 0
    doc = json.loads(path.read_text())
    assert doc["recommended"]["scale_ppm"] == pytest.approx(15.12, rel=0.01)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--scale", "0,50"), "use --imu, --rig or --angle-random-walk"),
        (("--scale", "50,50", "--imu", "nav440"), "two different rates"),
        (("--scale", "a,b", "--imu", "nav440"), "give rates such as"),
    ],
)
def test_impossible_designs_are_usage_errors(rotcli, arguments, message):
    outcome = rotcli("budget", *arguments)
    assert outcome.status == 2
    assert message in outcome.err
