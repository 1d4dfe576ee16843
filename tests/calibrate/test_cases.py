"""Recorded and simulated cases with known answers, read from the shared folder where present."""

import gzip
import json

import pytest

from tests.recorded import shared


@pytest.fixture
def calibrate(rotcli, tmp_path):
    """Return a function that calibrates a case: status, messages and document."""

    def run(folder, *options, table=None):
        imu = next(folder / n for n in ("imu.csv", "imu.parquet") if (folder / n).exists())
        table = table or next(
            folder / n for n in ("table.csv", "table.parquet") if (folder / n).exists()
        )
        out = tmp_path / "c.json"
        done = rotcli("calibrate", imu, table, *options, "-o", out)
        return done, json.loads(out.read_text()) if done.status == 0 else None

    return run


def values(doc):
    return {name: (p["value"], p["sigma"]) for name, p in doc["parameters"].items()}


TRUTH = {"bias_x": 100.0, "bias_y": -50.0, "bias_z": 30.0}
TRUTH |= {"Kgxz": 2000.0, "Kgyz": -1500.0, "Kgz": 3000.0}


@pytest.mark.parametrize(
    "case",
    [
        "01-twelve-bit-encoder-refused",
        "15-uneven-turning",
        "20-angle-in-*-degrees",
        "21-angle-to-a-tenth",
    ],
)
def test_coarse_encoders_and_uneven_motion_give_the_truth_without_named_segments(calibrate, case):
    done, doc = calibrate(shared("cases", "table", case))
    assert done.err.count("warning") == 0, done.err
    for name, (value, sigma) in values(doc).items():
        # Within 4 sigma; the smallest sigma is 1.2 deg/h, the largest scale sigma 70 ppm.
        assert abs(value - TRUTH[name]) < 4.0 * sigma, (name, value, sigma)
        assert sigma < (15.0 if name.startswith("bias") else 100.0)


@pytest.mark.parametrize(
    ("case", "says"),
    [
        ("02-warm-up-drift", "the bias drifts by"),
        ("04-g-sensitivity", "vary once per turn of the table"),
        ("07-accelerometer-reports-gravity", "the accelerometers report gravity"),
        ("22-azimuth-counterclockwise", "azimuth = 90.5 deg would cancel them"),
    ],
)
def test_what_the_log_contradicts_is_named(calibrate, case, says):
    done, _ = calibrate(shared("cases", "table", case))
    assert done.status == 0
    assert says in done.err


@pytest.mark.parametrize(
    ("case", "options", "says"),
    [
        ("03-clipped-throughout", (), "of gyro_z are clipped at gyro_range"),
        ("06-frd-log", (), "the IMU points down; set [imu] mount = [[0, 1, 0], [1, 0, 0]"),
        (
            "09-swinging-table-wrong-direction",
            ("--earth-rate", "ignore"),
            "opposite sense; set [table] direction = 1",
        ),
        ("11-clock-drift", (), "the clocks differ by 49"),
        ("17-dead-gyro", (), "the gyros do not sense the rotation"),
    ],
)
def test_what_cannot_be_calibrated_is_refused_with_its_cause(calibrate, case, options, says):
    done, _ = calibrate(shared("cases", "table", case), *options)
    assert done.status == 1
    assert says in done.err


def test_soft_ramps_do_not_bias_the_scale_factor(calibrate):
    _, doc = calibrate(shared("cases", "table", "05-soft-ramps"))
    # 0.1 ppm of 10 deg/s is 0.004 deg/h; the printed angles end at 1e-7 deg.
    assert doc["parameters"]["Kgy"]["value"] == pytest.approx(-20.0, abs=1.0)


def test_a_simulated_navigation_grade_set_gives_its_published_errors(calibrate, tmp_path):
    folder = shared("data", "psins_19position", "x")
    table = tmp_path / "table.csv"
    table.write_bytes(gzip.decompress((folder / "table.csv.gz").read_bytes()))
    done, doc = calibrate(folder, "--rig", folder / "rig.toml", table=table)
    assert done.status == 0, done.err
    published = {"Kgx": (-10.0, 0.5), "Kgyx": (145.44, 0.5), "Kgzx": (242.41, 0.5)}
    published |= {"bias_x": (-0.1, 0.02), "bias_y": (-0.2, 0.02), "bias_z": (-0.3, 0.02)}
    for name, (value, tolerance) in published.items():
        assert doc["parameters"][name]["value"] == pytest.approx(value, abs=tolerance), name


@pytest.mark.parametrize(
    ("part", "published"),
    [
        ("yaw_slow", {"Kgxz": 12122.0, "Kgyz": 17366.0, "Kgz": 5973.0}),
        ("pitch_slow", {"Kgxy": 26985.0, "Kgy": -15067.0, "Kgzy": 1601.0}),
    ],
)
def test_a_swinging_mems_gyro_agrees_with_an_independent_fit(calibrate, part, published):
    folder = shared("data", "uiuc_mpu6050_swing", part)
    done, doc = calibrate(folder, "--earth-rate", "ignore")
    assert done.status == 0, done.err
    for name, value in published.items():
        assert doc["parameters"][name]["value"] == pytest.approx(value, abs=250.0), name
    assert abs(doc["lag"]["value"]) == pytest.approx(12.0, abs=1.5)  # ms
