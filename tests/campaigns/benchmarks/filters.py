"""The Kalman filters: as processes, and the long one by itself."""

import subprocess
from collections.abc import Iterator

from tests.campaigns.benchmarks.logs import simulate, words
from tests.campaigns.benchmarks.measure import (
    PYTHON,
    ROTCLI,
    Row,
    Settings,
    compared,
    one,
    side_by_side,
)


def zero_velocity(settings: Settings) -> Iterator[Row]:
    """`rotcli observe` on a log of ten minutes, next to the bare imports."""
    log = simulate(
        settings.folder / "ten_minutes",
        *words("--imu mti-g --rate 10 --axis y --static 0 --rotation 0 --navigation 600"),
    )
    command = [*ROTCLI, "observe", str(log / "imu.parquet"), str(log / "table.parquet")]
    bare = "import click, numpy, pyarrow.parquet"
    found = side_by_side(
        {
            "ours": [*command, "-o", str(log / "observe.json"), "--quiet"],
            "bare": [PYTHON, "-c", bare],
        },
        settings.slow_rounds,
    )
    yield compared("rotcli observe, a log of 10 minutes", found["ours"], bare, found["bare"])


def voyage(settings: Settings) -> Iterator[Row]:
    """Ten hours of the SRINS filter, and `rotcli srins calibrate` on 34 h at 10 Hz."""
    import numpy as np

    from rotcli.srins.filter import FilterSettings, build_filter_model, gain_sequence, run_filter
    from rotcli.srins.reciprocation import RotationScheme
    from rotcli.units import DEG

    reported = FilterSettings()
    seconds = np.arange(36_001.0)
    theta, latitude = RotationScheme().angle(seconds), np.full(len(seconds), 42.3 * DEG)
    velocity = np.stack([np.ones(len(seconds)), np.zeros(len(seconds))])
    epochs = np.ones(36_000, dtype=np.int64)
    P0 = np.diag(reported.initial_sigma(42.3 * DEG) ** 2)

    def ten_hours() -> None:
        steps = build_filter_model(theta, velocity, latitude, 1.0, reported, epochs)
        run_filter(steps, gain_sequence(steps, P0), np.zeros((3600, 8)))

    found = side_by_side({"ours": ten_hours}, settings.slow_rounds)
    yield one("SRINS filter, 10 h, its model from blocks of 1 s and its gains", found["ours"])
    log = settings.folder / "voyage"
    subprocess.run([*ROTCLI, "srins", "simulate", "--quiet", "-o", str(log)], check=True)
    command = [*ROTCLI, "srins", "calibrate", str(log / "imu.parquet")]
    command += [str(log / "table.parquet"), "--reference", str(log / "gnss.parquet")]
    command += ["--speed", str(log / "doppler.parquet"), "-o", str(log / "c.json"), "--quiet"]
    bare = "import click, numpy, pyarrow.parquet"
    found = side_by_side({"ours": command, "bare": [PYTHON, "-c", bare]}, settings.slow_rounds)
    what = "rotcli srins calibrate, 34 h at 10 Hz"
    yield compared(what, found["ours"], bare, found["bare"])
