"""Allan deviations of long still logs against bare allantools calls, side by side in one run.

`python -m benchmarks.allan` prints ratios; `compare` and `peak_memory` give them to others.
"""

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

NAMES = [f"{kind}_{axis}" for kind in ("gyro", "accel") for axis in "xyz"]


def write_still_log(path: Path, hours: float, rate: float = 100.0) -> int:
    """Write a still log of white noise and a slow walk as Parquet; return its rows."""
    n = round(hours * 3600 * rate)
    schema = pa.schema([(name, pa.float64()) for name in ("time", *NAMES)])
    rng = np.random.default_rng(0)
    with pq.ParquetWriter(path, schema, compression="zstd", compression_level=1) as writer:
        for first in range(0, n, 1_000_000):
            k = min(1_000_000, n - first)
            columns = [np.arange(first, first + k) / rate]
            columns += [1e-3 * rng.standard_normal(k) for _ in NAMES]
            writer.write_table(pa.table(dict(zip(schema.names, columns, strict=True)), schema))
    return n


def _timed(function: Callable[[], object], best_of: int = 3) -> float:
    times = []
    for _ in range(best_of):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def compare(path: Path, best_of: int = 3) -> dict[str, float]:
    """Return seconds and ratios of the whole analysis of a log against bare oadev calls.

    `reference_s`: reading the file plus allantools.oadev on ready phase data, two axes at a time.
    `plain_s`: reading plus allantools.oadev on the rates, one axis after another. Both have
    allantools imported and the same cluster times; ours fits the coefficients as well.
    `disagreement`: the largest relative difference of a deviation.
    """
    import allantools

    from rotcli.logs.files import read_imu
    from rotcli.logs.rig import default_rig
    from rotcli.models.allan_variance import phase_from_rate
    from rotcli.stages.allan import allan

    result = allan(read_imu(path, default_rig(), max_gap=None))
    taus = result.axes["gyro_x"].tau
    hertz = 1.0 / result.interval
    table = pq.read_table(path)
    rates = [table[name].to_numpy() for name in NAMES]
    phases = [phase_from_rate(rate, result.interval) for rate in rates]

    def ours() -> None:
        allan(read_imu(path, default_rig(), max_gap=None))

    def bare(phase: object) -> object:
        return allantools.oadev(phase, rate=hertz, data_type="phase", taus=taus)[1]

    def reference() -> None:
        pq.read_table(path)
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(bare, phases))

    def plain() -> None:
        read = pq.read_table(path)
        for name in NAMES:
            rate = read[name].to_numpy()
            allantools.oadev(rate, rate=hertz, data_type="freq", taus=taus)

    # Turn and turn about, so that a busy machine slows all alike.
    rounds = [[_timed(f, 1) for f in (ours, reference, plain)] for _ in range(best_of)]
    mine, theirs, one_by_one = np.min(rounds, axis=0)
    disagreement = max(
        float(np.max(np.abs(result.axes[name].deviation / bare(phase) - 1.0)))
        for name, phase in zip(NAMES, phases, strict=True)
    )
    return {
        "taus": float(len(taus)),
        "ours_s": mine,
        "reference_s": theirs,
        "plain_s": one_by_one,
        "ours_over_reference": mine / theirs,
        "plain_over_ours": one_by_one / mine,
        "disagreement": disagreement,
    }


def peak_memory(path: Path, output: Path) -> dict[str, float]:
    """Run `rotcli allan` on a log as a process of its own; return its peak memory and time."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    start = time.perf_counter()
    command = [sys.executable, "-m", "rotcli", "allan", str(path), "-o", str(output), "--quiet"]
    subprocess.run(command, check=True)
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    if peak == before:
        raise RuntimeError("an earlier child was larger; measure in a fresh process")
    return {"peak_gb": peak * 1024 / 1e9, "process_s": seconds}


def main() -> None:
    """Print both measurements."""
    with tempfile.TemporaryDirectory() as folder:
        day = Path(folder) / "day.parquet"
        rows = write_still_log(day, 24.0)
        memory = peak_memory(day, Path(folder) / "allan.json")
        print(f"24 h, {rows} rows: {memory['peak_gb']:.2f} GB, {memory['process_s']:.1f} s")
        day.unlink()
        short = Path(folder) / "three_hours.parquet"
        rows = write_still_log(short, 3.0)
        found = compare(short)
    print(f"3 h, {rows} rows, 6 axes, {found['taus']:.0f} cluster times:")
    print(f"  rotcli, read and analyse                {found['ours_s']:.2f} s")
    print(f"  read + allantools on phase, 2 at a time {found['reference_s']:.2f} s", end="")
    print(f"   rotcli takes {found['ours_over_reference']:.2f} of it")
    print(f"  read + allantools on rates, one by one  {found['plain_s']:.2f} s", end="")
    print(f"   {found['plain_over_ours']:.1f} times rotcli's")
    print(f"  largest relative disagreement           {found['disagreement']:.1e}")


if __name__ == "__main__":
    main()
