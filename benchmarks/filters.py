"""The Kalman filters as whole processes."""

from collections.abc import Iterator

from benchmarks.logs import simulate, words
from benchmarks.measure import PYTHON, ROTCLI, Row, Settings, beside, side_by_side


def zero_velocity(settings: Settings) -> Iterator[Row]:
    """`rotcli observe` on a log of ten minutes, beside the bare imports."""
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
    yield beside("rotcli observe, a log of 10 minutes", found["ours"], bare, found["bare"])
