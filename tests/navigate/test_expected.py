"""Expected errors of navigated logs: clean runs are silent, each fault is found by its test.

One clean run is simulated and calibrated; each fault changes the log or the rig in memory and
writes it again. Figures of the clean run: those of the table in
tests/models/expected/test_errors.py.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import tomlkit
from scipy.stats import norm

from rotcli import public
from rotcli.navigate.api import NavigateOptions, NavigationResult
from rotcli.simulate.api import SimulateOptions
from rotcli.units import DEG, DEG_PER_HOUR

RATE = 30.0  # deg/s
GYRO, ACCEL = (
    [f"{kind} [{unit}]" for kind in (f"{name}_x", f"{name}_y", f"{name}_z")]
    for name, unit in (("gyro", "rad/s"), ("accel", "m/s^2"))
)


@dataclass(frozen=True)
class Folder:
    """A run folder: clean logs, rig and calibration."""

    path: Path

    def navigate(self, mode: str = "full", **options: object) -> NavigationResult:
        """Navigate the logs of the folder."""
        logs = self.path / "imu.parquet", self.path / "table.parquet"
        calibration = None if mode == "conventional" else self.path / "c.json"
        settings = NavigateOptions((mode,), **options)
        results = public.navigate(*logs, calibration=calibration, options=settings)
        return results[mode]

    def changed(
        self,
        to: Path,
        imu: Callable[[dict[str, np.ndarray]], None] | None = None,
        rig: Callable[[dict], None] | None = None,
        table: Callable[[dict[str, np.ndarray]], None] | None = None,
    ) -> "Folder":
        """Write a copy with a changed log or rig."""
        to.mkdir(exist_ok=True)
        for name, change in (("imu.parquet", imu), ("table.parquet", table)):
            log = pq.read_table(self.path / name)
            columns = {column: log[column].to_numpy().copy() for column in log.column_names}
            if change:
                change(columns)
            pq.write_table(pa.table(columns), to / name)
        settings = tomlkit.parse((self.path / "rig.toml").read_text()).unwrap()
        if rig:
            rig(settings)
        (to / "rig.toml").write_text(tomlkit.dumps(settings))
        (to / "c.json").write_bytes((self.path / "c.json").read_bytes())
        return Folder(to)


@pytest.fixture(scope="module")
def clean(tmp_path_factory) -> Folder:
    path = tmp_path_factory.mktemp("clean")
    public.simulate(SimulateOptions(imu="nav440", rate=RATE, seed=1)).write(str(path))
    logs = path / "imu.parquet", path / "table.parquet"
    public.calibrate(*logs).write(str(path / "c.json"))
    return Folder(path)


def codes(result: NavigationResult) -> set[str]:
    return {finding["code"] for finding in result.document["findings"]}


def test_a_clean_run_is_silent_and_shows_the_expected_errors(clean):
    doc = clean.navigate().document
    assert doc["warnings"] == []
    assert doc["findings"] == []
    horizontal = doc["expected"]["horizontal_m"]
    assert horizontal["rms"] == pytest.approx(308.0, rel=0.01)
    assert horizontal["ratio"] == pytest.approx(
        doc["rms"]["horizontal_m"] / horizontal["rms"], rel=1e-9
    )
    assert 0.0 < horizontal["p_value"] <= 1.0
    assert horizontal["q999"] == pytest.approx(2.62 * horizontal["rms"], rel=0.01)
    assert doc["p_run"] > 0.01
    assert doc["basis"]["accel_bias"] == "measured"
    assert doc["basis"]["dominating"]["height_m"] == "accelerometer"
    assert doc["basis"]["dominating"]["azimuth_deg"] == "drift"


def test_the_mean_corrected_output_has_its_sigma(clean):
    mean = clean.navigate().document["mean_after"]
    for axis in "xyz":
        assert mean[axis]["sigma"] * DEG / DEG_PER_HOUR == pytest.approx(16.72, rel=2e-3)
        assert abs(mean[axis]["value"]) < 4.0 * mean[axis]["sigma"]


def test_partial_leaves_in_the_known_column_and_judges_about_it(clean):
    doc = clean.navigate("partial").document
    assert doc["findings"] == []
    # Kgz of some 1300 ppm at 30 deg/s for 300 s: 7 deg RMS, known to the calibration's sigma.
    assert doc["expected"]["azimuth_deg"]["rms"] == pytest.approx(
        doc["rms"]["azimuth_deg"], rel=0.3
    )
    assert doc["expected"]["azimuth_deg"]["rms"] > 5.0
    # Less that column, the seconds scatter as those of `full`, which removes it.
    seconds, full = doc["residual_1s"]["gyro"], clean.navigate().document["residual_1s"]["gyro"]
    assert (seconds["at_s"], seconds["axis"]) == (full["at_s"], full["axis"])
    assert seconds["max"] == pytest.approx(full["max"], rel=1e-2)


def _spike(log: dict[str, np.ndarray]) -> None:
    log[GYRO[0]][20000:20010] += 1.0


def _zeros(log: dict[str, np.ndarray]) -> None:
    for name in GYRO + ACCEL:
        log[name][20000:20010] = 0.0


def _noise(log: dict[str, np.ndarray]) -> None:
    rng = np.random.default_rng(3)
    for name in GYRO:
        log[name][20000:23000] += 2.0 * DEG * rng.standard_normal(3000)


def _bias(size: float, *channels: str) -> Callable[[dict[str, np.ndarray]], None]:
    def change(log: dict[str, np.ndarray]) -> None:
        for name in channels:
            log[name] += size * DEG_PER_HOUR

    return change


def _flip(log: dict[str, np.ndarray]) -> None:
    log[GYRO[0]] *= -1.0


def _ten_times(log: dict[str, np.ndarray]) -> None:
    log[ACCEL[0]] *= 10.0


def _attitude(name: str, value: float) -> Callable[[dict], None]:
    def change(rig: dict) -> None:
        rig["attitude"][name] = value

    return change


def _lever_arm(rig: dict) -> None:
    rig["imu"]["lever_arm"] = [0.5, 0.0, 0.0]


FAULTS = {
    "spike of a gyro": (_spike, None, {"window-disturbed", "rms-unexpected"}, "200 to 201 s"),
    "rows of zeros": (
        _zeros,
        None,
        {"window-disturbed", "samples-not-measured"},
        "10 samples are zero",
    ),
    "noise for 30 s": (_noise, None, {"window-disturbed", "rms-unexpected"}, "200 to 230 s"),
    "bias along the axis": (
        _bias(150.0, GYRO[2]),
        None,
        {"rms-unexpected", "gyro-bias-changed"},
        "gyro bias along the vertical",
    ),
    "bias across the axis": (_bias(200.0, GYRO[0]), None, {"gyro-bias-changed"}, "gyro_x reads 1"),
    "flipped gyro": (
        _flip,
        None,
        {"rms-unexpected", "residual-harmonics"},
        "gyro_x has the wrong sign",
    ),
    "scaled accelerometer": (_ten_times, None, {"noise-unexpected"}, "accel_x scatters 1"),
    "wrong pitch": (
        None,
        _attitude("pitch", 1.0),
        {"rms-unexpected", "level-unexpected"},
        "accelerometers find pitch 0.000 deg",
    ),
    "wrong azimuth": (
        None,
        _attitude("azimuth", 180.0),
        {"rms-unexpected", "residual-harmonics"},
        "would cancel them",
    ),
    "wrong lever arm": (None, _lever_arm, {"accel-bias-changed"}, "An IMU 0.5 m next to the axis"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_exceeds_its_limit_and_is_named(clean, tmp_path, fault):
    imu, rig, expected, text = FAULTS[fault]
    result = clean.changed(tmp_path / "run", imu, rig).navigate()
    assert codes(result) == expected
    shown = (
        " ".join(result.document["warnings"])
        .replace("199.995", "200")
        .replace("200.995", "201")
        .replace("229.995", "230")
    )
    assert text in shown


def test_noise_figures_that_the_rig_lacks_are_named_and_nothing_is_judged(clean, tmp_path):
    def drop(rig: dict) -> None:
        del rig["imu"]["rate_random_walk"]
        del rig["imu"]["velocity_random_walk"]

    result = clean.changed(tmp_path / "run", rig=drop).navigate()
    assert result.document["expected"] is None
    reason = "[imu] lacks rate_random_walk, velocity_random_walk"
    assert result.document["expected_reason"] == reason
    (table,) = result.tables()
    assert table.headings == ["error", "RMS", "final", "max"]
    assert "rotcli allan" in table.note
    assert result.document["warnings"] == []


def test_a_calibration_of_another_log_needs_the_turn_on_sigma(clean, tmp_path):
    def shorter(log: dict[str, np.ndarray]) -> None:
        for name in log:
            log[name] = log[name][:-100]

    def stages(rig: dict) -> None:
        rig["stages"]["navigation"] = [121.0, 419.0]

    def known(rig: dict) -> None:
        stages(rig)
        rig["imu"]["turn_on_sigma"] = 100.0

    def spiked(log: dict[str, np.ndarray]) -> None:
        shorter(log)
        _spike(log)

    found = clean.changed(tmp_path / "c", spiked, stages).navigate()
    assert codes(found) == {"window-disturbed"}  # also where the RMS is not judged
    # Of 3 x 300 residuals the largest exceeds it in one of a thousand logs.
    assert found.document["findings"][0]["limit"] == pytest.approx(norm.isf(0.5e-3 / 900.0))
    unknown = clean.changed(tmp_path / "a", shorter, stages).navigate().document
    assert unknown["findings"] == []
    assert unknown["p_run"] is None
    assert "another log" in unknown["expected"]["azimuth_deg"]["reason"]
    assert unknown["expected"]["azimuth_deg"]["rms"] is not None
    judged = clean.changed(tmp_path / "b", shorter, known).navigate().document
    # 100 deg/h along the vertical: 100 / 3600 x 298 / sqrt(3) = 4.8 deg.
    assert judged["expected"]["azimuth_deg"]["rms"] == pytest.approx(4.85, rel=0.02)
    assert judged["p_run"] > 1e-3
    sigma = judged["mean_after"]["x"]["sigma"] * DEG / DEG_PER_HOUR
    assert sigma == pytest.approx(np.hypot(100.0, 16.7), rel=0.02)


def test_the_time_of_another_log_does_not_matter(clean, tmp_path):
    # Its calibration counts as made just before the window, whatever its clock says.
    def late(by: float) -> dict:
        def log(columns: dict[str, np.ndarray]) -> None:
            columns["time [s]"] += by

        def rig(settings: dict) -> None:
            settings["stages"] = {"navigation": [121.0 + by, 421.0 + by]}

        return {"imu": log, "rig": rig, "table": log}

    rms = [
        clean.changed(tmp_path / f"{by}", **late(by)).navigate().document["expected"]
        for by in (10.0, 40_000.0)
    ]
    for name in ("horizontal_m", "azimuth_deg"):
        assert rms[0][name]["rms"] == pytest.approx(rms[1][name]["rms"], rel=1e-6)
        # Flicker and walk of the minute between calibration and window are all that is added.
        own = clean.navigate().document["expected"][name]["rms"]
        assert 1.0 < rms[0][name]["rms"] / own < 1.2


def test_a_still_table_that_is_not_level_is_compared_with_the_bias_sigma(clean, tmp_path):
    def change(rig: dict) -> None:
        rig["attitude"]["pitch"] = 1.5
        rig["imu"]["accel_bias_sigma"] = 0.03
        rig["stages"]["static"] = [0.0, 30.0]
        rig["stages"]["navigation"] = [30.0, 60.0]

    folder = clean.changed(tmp_path / "run", rig=change)
    assert codes(folder.navigate("conventional")) == {"level-unexpected"}


def test_a_wrong_attitude_within_its_sigma_is_no_finding(clean, tmp_path):
    def change(rig: dict) -> None:
        rig["attitude"] |= {"azimuth": 5.0, "azimuth_sigma": 5.0}

    doc = clean.changed(tmp_path / "run", rig=change).navigate().document
    assert doc["findings"] == []
    assert doc["basis"]["attitude_sigma_deg"]["azimuth"] == 5.0
    # 13.27 m per degree.
    assert doc["expected"]["horizontal_m"]["rms"] == pytest.approx(np.hypot(308, 66), rel=0.02)


def test_an_azimuth_error_is_continuous_beyond_half_a_turn(clean, tmp_path):
    result = clean.changed(tmp_path / "run", _bias(5000.0, GYRO[2])).navigate()
    # 5000 deg/h over 300 s: 417 deg, clockwise azimuth falls.
    final = result.document["final"]["azimuth_deg"]
    assert final == pytest.approx(-417.0, abs=5.0)


def test_the_plot_has_the_expected_band(clean):
    result = public.navigate(
        clean.path / "imu.parquet", clean.path / "table.parquet", calibration=clean.path / "c.json"
    )["full"]
    figure = result.figure()
    assert "dotted: expected" in figure.axes[-1].get_xlabel()
    dotted = [line for line in figure.axes[0].lines if line.get_linestyle() == ":"]
    assert len(dotted) == 6  # two limits of three errors


def test_conventional_navigation_of_a_turning_table_counts_the_unknown_column(clean):
    doc = clean.navigate("conventional", window=(121.0, 421.0)).document
    # scale_sigma of the rig, 800 ppm at 30 deg/s over 300 s: 4.2 deg RMS.
    assert doc["expected"]["azimuth_deg"]["rms"] == pytest.approx(4.2, rel=0.05)
    assert "the table turns in the window" in doc["warnings"][0]
    assert {finding["code"] for finding in doc["findings"]} <= {"conventional-turning"}
