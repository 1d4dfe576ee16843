"""Long logs next to an older rotcli: ROTCLI_OLDER names its program, such as that of 0.1.0."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from tests.campaigns.benchmarks.logs import simulate, words
from tests.campaigns.benchmarks.measure import ROTCLI, Figure, Row, Settings, compared, side_by_side

_SIX_HOURS, _ONE_HOUR = 21600, 3600  # s
_MEMORY = 0.35e9  # bytes that calibrate needs at most
# Name: IMU and motion of the log, command, largest ratio of CPU times.
_COMMANDS = {
    "navigate, 6 h": ("nav440 --static 3600", 18000, "navigate --mode conventional", 0.5),
    "navigate, 6 h, height hold": (
        "nav440 --static 3600",
        18000,
        "navigate --mode conventional --height hold",
        0.45,
    ),
    "observe, 6 h": ("mti-g --static 0", _SIX_HOURS, "observe", 0.55),
    "observe, 1 h": ("mti-g --static 0", _ONE_HOUR, "observe", 0.7),
    "observe --smooth, 6 h": ("mti-g --static 0", _SIX_HOURS, "observe --smooth", 0.6),
    "calibrate, 6 h": ("nav440 --static 3600 --rotation 18000", 0, "calibrate", 0.6),
}


def rows(settings: Settings) -> Iterator[Row]:
    """Each command in both versions, turn and turn about."""
    older = os.environ.get("ROTCLI_OLDER") or shutil.which("rotcli-0.1.0")
    for name, (motion, seconds, command, at_most) in _COMMANDS.items():
        what, peer = f"rotcli {name}", "rotcli 0.1.0"
        if older is None or settings.quick:
            yield Row(what, peer=peer, note="skipped: ROTCLI_OLDER names no program, or --quick")
            continue
        log = _log(settings.folder / "older", motion, seconds)
        arguments = [*command.split(), str(log / "imu.parquet"), str(log / "table.parquet")]
        arguments += ["-o", str(log / "result.json"), "--quiet"]
        candidates = {"ours": [*ROTCLI, *arguments], "older": [older, *arguments]}
        found = side_by_side(candidates, settings.slow_rounds)
        size = sum((log / f"{n}.parquet").stat().st_size for n in ("imu", "table"))
        note = f"{size / 1e6:.0f} MB are read"
        yield compared(what, found["ours"], peer, found["older"], at_most=at_most, note=note)
        if command == "calibrate":
            peak = Figure.of([(found["ours"].peak or 0.0) / 1e9], "GB")
            yield Row(f"{what}, peak memory", peak, at_most=_MEMORY / 1e9, bound_on="rotcli")


def _log(folder: Path, motion: str, seconds: int) -> Path:
    """Return the folder of a log, simulated once."""
    rotation = "" if "--rotation" in motion else " --rotation 0"
    place = folder / f"{motion.replace(' ', '')}{seconds}"
    if place.exists():
        return place
    given = f"--imu {motion}{rotation} --rate 10 --navigation {seconds} --seed 1"
    log = simulate(place, *words(given))
    rig = log / "rig.toml"
    lines = rig.read_text(encoding="utf-8").splitlines(keepends=True)
    known = [line for line in lines if not line.startswith("clock_rate")]  # 0.1.0 has no such key
    rig.write_text("".join(known), encoding="utf-8")
    return log
