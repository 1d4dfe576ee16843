"""The Allan analysis of a long still log beside allantools as a user would call it."""

from collections.abc import Iterator
from pathlib import Path

from benchmarks.allan import NAMES, write_still_log
from benchmarks.measure import ROTCLI, Figure, Row, Settings, beside, one, side_by_side


def rows(settings: Settings) -> Iterator[Row]:
    """Six axes of three hours, about a hundred cluster times: in one process, and as a command."""
    import allantools
    import numpy as np
    import pyarrow.parquet as pq

    from rotcli.logs.files import read_imu
    from rotcli.logs.rig import default_rig
    from rotcli.stages.allan import allan

    log: Path = settings.folder / "three_hours.parquet"
    samples = write_still_log(log, 0.5 if settings.quick else 3.0)
    result = allan(read_imu(log, default_rig(), max_gap=None))
    taus = result.axes["gyro_x"].tau
    hertz = 1.0 / result.interval

    def ours() -> None:
        allan(read_imu(log, default_rig(), max_gap=None))

    deviations: dict[str, object] = {}

    def theirs() -> None:
        table = pq.read_table(log)
        for name in NAMES:
            rate = table[name].to_numpy()
            deviations[name] = allantools.oadev(rate, rate=hertz, data_type="freq", taus=taus)[1]

    found = side_by_side({"ours": ours, "theirs": theirs}, settings.rounds, warm=False)
    what = f"read, analyse 6 axes x {samples:,} samples x {len(taus)} cluster times"
    at_most = None if settings.quick else 0.5
    peer = "pyarrow and allantools.oadev, axis after axis"
    yield beside(what, found["ours"], peer, found["theirs"], at_most=at_most)
    disagreement = max(
        float(np.max(np.abs(result.axes[name].deviation / deviations[name] - 1.0)))
        for name in NAMES
    )
    yield Row(
        "largest relative disagreement with allantools",
        Figure.of([disagreement], ""),
        at_most=1e-12,
        bound_on="rotcli",
    )
    command = [*ROTCLI, "allan", str(log), "--quiet", "-o", str(settings.folder / "allan.json")]
    alone = side_by_side({"ours": command}, 1 if settings.quick else 3, warm=False)["ours"]
    yield one(f"rotcli allan, {samples:,} samples, a process", alone)
