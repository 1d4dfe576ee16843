"""A quiet sensor and its triad calibration."""

import json

QUIET = "name = 'quiet'\nrate = 100.0\n[gyro]\nangle_random_walk = 0.4\n[accel]\n" + (
    "velocity_random_walk = 0.05\n"
)


def calibrate_triad(rotcli, run, *options):
    out = run / "triad.json"
    done = rotcli("triad", run / "imu.parquet", run / "table.parquet", "-o", out, *options)
    assert done.status == 0, done.err
    return json.loads(out.read_text()), done
