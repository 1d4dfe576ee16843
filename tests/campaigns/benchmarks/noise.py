"""The Allan analysis of long still logs next to allantools, as called by a user and as its best."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tests.campaigns.benchmarks.logs import COLUMNS, still_log
from tests.campaigns.benchmarks.measure import (
    ROTCLI,
    Figure,
    Row,
    Settings,
    compared,
    one,
    side_by_side,
)

_SPACED = 111  # times spaced evenly in the logarithm: 100 different lengths in three hours
_DAY_AT_MOST = 2.0  # GB


def rows(settings: Settings) -> Iterator[Row]:
    """Three hours, 100 cluster times, in one process; the same and a day as commands."""
    log = settings.folder / "three_hours.parquet"
    samples = still_log(log, 0.5 if settings.quick else 3.0)
    yield from _deviations(log, samples, settings)
    yield from _default_times(log, samples, settings)
    command = [*ROTCLI, "allan", "--quiet", "-o", str(settings.folder / "allan.json")]
    alone = side_by_side({"ours": [*command, str(log)]}, settings.slow_rounds, warm=False)["ours"]
    yield one(f"rotcli allan, {samples:,} samples, a process", alone)
    if settings.quick:
        return
    day = settings.folder / "day.parquet"
    samples = still_log(day, 24.0)
    run = side_by_side({"ours": [*command, str(day)]}, 1, warm=False)["ours"]
    day.unlink()
    yield one(f"rotcli allan, {samples:,} samples, a process", run)
    peak = Figure.of([(run.peak or np.inf) / 1e9], "GB")
    yield Row("rotcli allan, peak memory at 24 h", peak, at_most=_DAY_AT_MOST, bound_on="rotcli")


def _deviations(log: Path, samples: int, settings: Settings) -> Iterator[Row]:
    """100 cluster times, next to allantools as a user would call it: rates, axis after axis.

    The deviations alone, and the complete analysis: reading, limits, coefficients, Gauss-Markov.
    """
    import allantools
    import pyarrow.parquet as pq

    from rotcli.allan.deviation import deviation, phase_from_rate
    from rotcli.allan.estimate import allan
    from rotcli.logs.imu import read_imu
    from rotcli.rig.rig import default_rig

    factors = np.unique(np.round(np.geomspace(1.0, samples / 3.0, _SPACED))).astype(np.int64)
    taus = [0.01 * factor for factor in factors.tolist()]
    table = pq.read_table(log)
    rates = [table[name].to_numpy() for name in COLUMNS]
    found: dict[str, list[np.ndarray]] = {}

    def one_axis(rate: np.ndarray) -> np.ndarray:
        return deviation(phase_from_rate(rate, 0.01), factors, 0.01, "oadev")

    def ours() -> None:
        found["ours"] = [one_axis(rate) for rate in rates]

    def theirs() -> None:
        found["theirs"] = [
            allantools.oadev(rate, rate=100.0, data_type="freq", taus=taus)[1] for rate in rates
        ]

    def complete() -> None:
        allan(read_imu(log, default_rig(), max_gap=None), taus=taus)

    def read_first() -> None:
        pq.read_table(log)
        theirs()

    times = f"6 axes x {samples:,} samples x {len(taus)} cluster times"
    both = side_by_side({"ours": ours, "theirs": theirs}, settings.rounds)
    at_most = None if settings.quick else 0.5
    peer = "allantools.oadev on rates, axis after axis"
    yield compared(f"deviations of {times}", both["ours"], peer, both["theirs"], at_most=at_most)
    disagreement = float(np.max(np.abs(np.divide(found["ours"], found["theirs"]) - 1.0)))
    yield Row(
        "largest relative disagreement with allantools",
        Figure.of([disagreement], ""),
        at_most=1e-12,
        bound_on="rotcli",
    )
    both = side_by_side({"ours": complete, "theirs": read_first}, settings.rounds, warm=False)
    what = f"read, analyse {times}, fit all coefficients"
    yield compared(what, both["ours"], f"pyarrow, then {peer}", both["theirs"])


def _default_times(log: Path, samples: int, settings: Settings) -> Iterator[Row]:
    """Default cluster times, next to allantools at its best: phases ready."""
    import allantools
    import pyarrow.parquet as pq

    from rotcli.allan.deviation import phase_from_rate
    from rotcli.allan.estimate import allan
    from rotcli.logs.imu import read_imu
    from rotcli.rig.rig import default_rig

    result = allan(read_imu(log, default_rig(), max_gap=None))
    taus, hertz = result.axes["gyro_x"].tau, 1.0 / result.interval
    table = pq.read_table(log)
    phases = [phase_from_rate(table[name].to_numpy(), result.interval) for name in COLUMNS]

    def ours() -> None:
        allan(read_imu(log, default_rig(), max_gap=None))

    def bare(phase: object) -> None:
        allantools.oadev(phase, rate=hertz, data_type="phase", taus=taus)

    def theirs() -> None:
        pq.read_table(log)
        for phase in phases:
            bare(phase)

    found = side_by_side({"ours": ours, "theirs": theirs}, settings.rounds, warm=False)
    what = f"read, analyse 6 axes x {samples:,} samples x {len(taus)} cluster times"
    at_most = None if settings.quick else 1.2
    peer = "pyarrow and allantools.oadev on ready phases"
    yield compared(what, found["ours"], peer, found["theirs"], at_most=at_most)
