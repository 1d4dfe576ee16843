"""How long a command takes before it works: processes next to bare imports.

Start-up is all that a run of the command imports, in a process that is set up as one of rotcli; its
bare imports are those of the same run without rotcli's own modules: libraries and the standard
library. So that these are no more than it needs, the libraries of each command are listed here. The
run itself, on a log so short that the work hardly counts, and `navigate` on six minutes are next
to it.
"""

import subprocess
from collections.abc import Iterator
from pathlib import Path

from rotcli.__main__ import GC_THRESHOLDS
from rotcli.cli.main import COMMANDS
from tests.campaigns.benchmarks.logs import simulate, words
from tests.campaigns.benchmarks.measure import PYTHON, ROTCLI, Row, Settings, compared, side_by_side

_LIBRARIES = {
    "allantools",
    "click",
    "fastjsonschema",
    "jinja2",
    "matplotlib",
    "numpy",
    "pandas",
    "pyarrow",
    "scipy",
    "tomlkit",
}
_LOGS = "click numpy pyarrow"
# Name: arguments, and the libraries that the command cannot do without.
STARTS = {
    "simulate": (
        "simulate --imu nav440 --rate 100 --static 3 --navigation 1 -o again",
        f"{_LOGS} scipy tomlkit",
    ),
    "inspect": ("inspect imu.parquet table.parquet", _LOGS),
    "convert": ("convert imu.parquet -o imu.csv", _LOGS),
    "correct": (
        "correct imu.parquet --calibration c.json -o corrected.parquet",
        f"{_LOGS} fastjsonschema",
    ),
    "allan": ("allan still/imu.parquet -o allan.json", f"{_LOGS} scipy"),
    "calibrate": ("calibrate imu.parquet table.parquet -o calibration.json", _LOGS),
    "navigate": (
        "navigate imu.parquet table.parquet --calibration c.json -o n.json",
        f"{_LOGS} fastjsonschema",
    ),
    "scale": ("scale curve/imu.parquet curve/table.parquet -o s.json", f"{_LOGS} scipy"),
    "triad": ("triad steps/imu.parquet steps/table.parquet -o t.json", _LOGS),
    "plan": ("plan --table 1 --minutes 20 -o plan.json", "click numpy"),
    "budget": ("budget --imu nav440 --rate 10 -o budget.json", "click numpy"),
    "observe": ("observe --axis z --pitch 30 --rate 10 -o observe.json", "click numpy"),
    "srins observe": ("srins observe -o srins.json", "click numpy"),
    "report": ("report n.json -o report.md", "click numpy fastjsonschema"),
    "certificate": ("certificate c.json -o c.html", "click numpy fastjsonschema jinja2"),
    "fleet": ("fleet ./units -o fleet.json", "click fastjsonschema numpy pandas pyarrow scipy"),
    "export": ("export allan.json --to kalibr -o imu.yaml", "click numpy fastjsonschema"),
}
# What `rotcli.__main__` sets before the first import of a command.
_SETTINGS = f"import gc\ngc.set_threshold{GC_THRESHOLDS}\n"
_CURVE = (
    "profile = 'nav440'\n"
    "[[leg]]\nduration = 20.0\n[[leg]]\nduration = 20.0\nrate = 50.0\n"
    "[[leg]]\nduration = 20.0\nrate = -50.0\n[[leg]]\nduration = 20.0\nrate = 100.0\n"
)


def help_text(settings: Settings) -> Iterator[Row]:
    """`rotcli --help` next to `import click`."""
    found = side_by_side(
        {"ours": [*ROTCLI, "--help"], "bare": [PYTHON, "-c", "import click"]}, settings.rounds
    )
    yield compared("rotcli --help", found["ours"], "import click", found["bare"], at_most=2.0)


def commands(settings: Settings) -> Iterator[Row]:
    """Every command: all that it imports, and a complete run, next to its bare imports."""
    folder = simulate(
        settings.folder / "tiny",
        *words("--imu nav440 --rate 100 --static 3 --rotation 8 --navigation 3"),
    )
    simulate(folder / "still", *words("--imu nav440 --rate 0 --static 30 --navigation 1"))
    (folder / "curve.toml").write_text(_CURVE)
    for arguments in (
        "simulate --scenario curve.toml -o curve",
        "simulate --sequence S1 --imu nav440 -o steps",
        "simulate --fleet 4,2,2 -o units",
        "calibrate imu.parquet table.parquet -o c.json",
        "navigate imu.parquet table.parquet --calibration c.json -o n.json",
    ):
        subprocess.run([*ROTCLI, *arguments.split(), "--quiet"], cwd=folder, check=True)
    for name, (arguments, needed) in STARTS.items():
        if name.split()[0] not in COMMANDS:
            continue
        given = [*(_inside(folder, word) for word in words(arguments)), "--quiet"]
        loaded = _modules_of(given, folder / "modules.txt")
        others = [module for module in loaded if module.partition(".")[0] != "rotcli"]
        libraries = _LIBRARIES & set(others)
        if libraries != set(needed.split()):
            raise RuntimeError(f"rotcli {name} imports {' '.join(sorted(libraries))}")
        bare = f"its bare imports: {', '.join(sorted(libraries))}"
        candidates = {
            "imports": [PYTHON, "-c", _SETTINGS + _imports_of(loaded)],
            "run": [*ROTCLI, *given],
            "bare": [PYTHON, "-c", _imports_of(others)],
        }
        # Milliseconds on a busy machine: what seems to fail is measured again, and longer.
        for rounds in (settings.rounds, 3 * settings.rounds):
            found = side_by_side(candidates, rounds)
            what = f"rotcli {name}, all its imports"
            imports_row = compared(what, found["imports"], bare, found["bare"], at_most=1.5)
            if imports_row.kept:
                break
        yield imports_row
        yield compared(f"rotcli {name}, a tiny input", found["run"], bare, found["bare"])


def _modules_of(arguments: list[str], listing: Path) -> list[str]:
    """Return, in order, all modules with a file that a run of rotcli imported, lazily or not."""
    program = (
        "import sys\nfrom rotcli.cli.main import main\n"
        "try:\n    main(sys.argv[2:])\nexcept SystemExit as stop:\n    assert not stop.code\n"
        "names = [name for name, module in sys.modules.items()\n"
        "         if getattr(getattr(module, '__spec__', None), 'has_location', False)]\n"
        "print(*names, sep='\\n', file=open(sys.argv[1], 'w'))\n"
    )
    command = [PYTHON, "-c", program, str(listing), *arguments]
    subprocess.run(command, capture_output=True, check=True)
    return listing.read_text().split()


def _imports_of(modules: list[str]) -> str:
    """Return a program that imports modules in order."""
    # Parts of a compiled module come with it.
    return (
        f"from importlib import import_module\nfor name in {modules}:\n"
        "    try:\n        import_module(name)\n    except ImportError:\n        pass\n"
    )


def _inside(folder: Path, word: str) -> str:
    """Return an argument with its place in the folder, where it is a file."""
    return str(folder / word) if "." in word or word == "again" else word


def six_minutes(settings: Settings) -> Iterator[Row]:
    """`rotcli navigate` on a six-minute Parquet log as a process."""
    log = simulate(
        settings.folder / "six_minutes",
        *words("--imu nav440 --rate 0 --static 60 --navigation 300 --seed 1"),
    )
    command = [*ROTCLI, "navigate", str(log / "imu.parquet"), str(log / "table.parquet")]
    imports = "numpy, scipy.linalg, pyarrow.parquet, click"
    found = side_by_side(
        {
            "ours": [*command, "-o", str(log / "navigation.json"), "--quiet"],
            "bare": [PYTHON, "-c", f"import {imports}"],
        },
        settings.rounds,
    )
    yield compared(
        "rotcli navigate, a log of 6 minutes",
        found["ours"],
        f"import {imports}",
        found["bare"],
        at_most=1.5,
    )
