"""Samples that were not measured: found with their times, and never in a sensor's own noise."""

import re
from itertools import pairwise

import numpy as np
import pytest

from rotcli.logs.record import ImuLog
from rotcli.run.evidence.repeats import find_repeats
from rotcli.run.evidence.samples import SampleScan


def _log(n: int = 3000, seed: int = 1, resolution: float = 0.0) -> ImuLog:
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((n, 6)) * ([1e-3] * 3 + [1e-2] * 3) + [0, 0, 0.5, 0, 0, 9.8]
    if resolution:
        values = np.round(values / resolution) * resolution
    return ImuLog("imu.csv", 0.01 * np.arange(n), values[:, :3], values[:, 3:], 0.01)


def _findings(log: ImuLog, chunks: int = 1) -> list[str]:
    scan = SampleScan()
    for part in np.array_split(np.arange(log.samples), chunks):
        scan.add(log._part(slice(part[0], part[-1] + 1)))
    found = (*scan.findings("imu.csv"), *find_repeats(log).findings("imu.csv"))
    return [finding.text for finding in found]


@pytest.mark.parametrize("chunks", [1, 7])
def test_a_sensors_noise_is_silent(chunks):
    for seed in range(20):
        assert _findings(_log(seed=seed), chunks) == []


def test_coarse_resolution_is_silent():
    # Gyros of 3 steps, accelerometers of 30: rows repeat, runs of them do not.
    for seed in range(10):
        assert _findings(_log(20000, seed, resolution=1e-3)) == []


def test_a_noise_free_simulation_is_silent():
    log = _log()
    time = log.time[:, None]
    log.gyro[:] = 1e-4 * np.cos(time + np.arange(3.0))
    log.accel[:] = 9.8 + 0.0 * time
    assert _findings(log) == []


@pytest.mark.parametrize("chunks", [1, 7])
@pytest.mark.parametrize(
    ("fault", "text"),
    [
        (
            "line",
            "98 samples lie on a straight line .*: 10.02 to 10.99",
        ),
        ("copy", r"100 rows repeat earlier rows bit for bit \(10 to 10.99 s as from 3 s\)"),
        (
            "frozen",
            "8 samples lie on a straight line .*: 10.02",
        ),
        ("five rows", "3 samples lie on a straight line"),
        ("zero", "1 sample is zero in all channels: 10 s. They were not measured"),
    ],
)
def test_what_was_not_measured_is_named_with_its_time(fault, text, chunks):
    log = _log()
    for values in (log.gyro, log.accel):
        if fault == "line":
            ends = values[1000], values[1099]
            values[1000:1100] = np.linspace(*ends, 100)
        elif fault == "copy":
            values[1000:1100] = values[300:400]
        elif fault == "frozen":
            values[1000:1010] = values[1000]
        elif fault == "five rows":
            values[1000:1005] = values[1000]
        else:
            values[1000] = 0.0
    assert re.search(text, " ".join(_findings(log, chunks)))


def test_known_gaps_are_not_reported_again():
    log = _log()
    missing = np.zeros(log.samples, dtype=bool)
    missing[1000:1100] = True
    for values in (log.gyro, log.accel):
        values[999:1101] = np.linspace(values[999], values[1100], 102)
    known = ImuLog("imu.csv", log.time, log.gyro, log.accel, 0.01, missing=missing)
    assert _findings(known) == []


@pytest.mark.parametrize(
    ("times", "share", "rate"), [(3, "67", "33.33"), (4, "75", "25"), (6, "83", "16.67")]
)
def test_a_logger_faster_than_the_sensor_is_named_with_the_rate_of_the_sensor(times, share, rate):
    log = _log()
    for values in (log.gyro, log.accel):
        values[:] = values[times * (np.arange(3000) // times)]
    repeats = find_repeats(log)
    (finding,) = repeats.findings("imu.csv")
    assert (finding.value, finding.limit) == pytest.approx((1.0 - 1.0 / times, 0.2))
    assert f"{share} % of the rows" in finding.text
    assert f"measures at {rate} Hz, and each reading is logged {times} times" in finding.text
    assert repeats.delay == pytest.approx(0.01 * times)  # s


def test_a_few_rows_written_twice_do_not_conceal_a_copy():
    log = _log()
    for values in (log.gyro, log.accel):
        values[100:110:2] = values[99:109:2]
        values[1000:1100] = values[300:400]
    repeats = find_repeats(log)
    assert repeats.repeated_share == pytest.approx(5 / 3000)
    assert (repeats.repeating, repeats.delay) == (False, 0.0)
    ((count, first, last, original),) = [
        (c.count, c.first, c.last, c.original) for c in repeats.copies
    ]
    assert (count, first, last, original) == pytest.approx((100, 10.0, 10.99, 3.0))


def test_rows_on_a_line_are_found_row_by_row_as_in_one_piece():
    log = _log()
    for values in (log.gyro, log.accel):
        values[1000:1020] = np.linspace(values[1000], values[1019], 20)
    found = []
    for edges in ([0, 3000], [0, 990, *range(991, 1040), 3000]):
        scan = SampleScan()
        for first, last in pairwise(edges):
            scan.add(log._part(slice(first, last)))
        found.append(scan.findings("imu.csv"))
    assert found[0] == found[1]
    assert "18 samples lie on a straight line" in found[0][0].text
