"""Fuzz the readers, each for a fixed time; what crashes is kept in fuzz/found."""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

FOUND = Path(__file__).parent / "found"


def main() -> None:
    """Fuzz one reader in this process, or all, one after another, in processes of their own."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.fuzz", description=__doc__)
    parser.add_argument(
        "readers",
        nargs="*",
        help="csv formats parquet rig scenario sequence spec result solution [all]",
    )
    parser.add_argument("--seconds", type=int, default=60, help="budget of each reader")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    try:
        import atheris
    except ImportError:
        print("fuzz: atheris is not installed here (pip install '.[fuzz]'): nothing was fuzzed")
        return
    if given.here:
        _fuzz(atheris, given.readers[0], given.seconds)
        return
    from tests.campaigns.fuzz.readers import READERS

    crashed = []
    for reader in given.readers or READERS:
        print(f"fuzz: {reader}, {given.seconds} s", flush=True)
        program = [
            sys.executable,
            "-m",
            "tests.campaigns.fuzz",
            reader,
            "--here",
            "--seconds",
            str(given.seconds),
        ]
        done = subprocess.run(program, capture_output=True, text=True, check=False)
        lines = done.stderr.splitlines()
        reported = [line for line in lines if line.startswith(("Done", "stat::number_of_exec"))]
        print("\n".join(f"  {line}" for line in reported), flush=True)
        if done.returncode:
            crashed.append(reader)
            print("\n".join(lines[-40:]), flush=True)
    if crashed:
        sys.exit(f"fuzz: crashers of {', '.join(crashed)} in {FOUND}")


def _fuzz(atheris: object, reader: str, seconds: int) -> None:
    # The rooms that read files; more of them take minutes to instrument.
    rooms = ["rotcli.files", "rotcli.logs", "rotcli.rig", "rotcli.run.correction", "tomllib"]
    with atheris.instrument_imports(include=rooms):  # type: ignore[attr-defined]
        from tests.campaigns.fuzz.readers import READERS, seeds
    FOUND.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as corpus:
        for k, seed in enumerate(seeds(reader)):
            (Path(corpus) / str(k)).write_bytes(seed)
        flags = [
            f"-max_total_time={seconds}",
            "-timeout=10",  # s an input: more is a hang
            "-rss_limit_mb=2500",
            "-max_len=8192",
            "-print_final_stats=1",
            "-verbosity=1",
            f"-artifact_prefix={FOUND}/{reader}-",
        ]
        atheris.Setup([sys.argv[0], *flags, corpus], READERS[reader])  # type: ignore[attr-defined]
        atheris.Fuzz()  # type: ignore[attr-defined]


if __name__ == "__main__":
    main()
