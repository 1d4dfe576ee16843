"""Draw mutants, run the tests on them, and list the survivors."""

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue

from tests.campaigns.mutate.mutants import Mutant, mutants

ROOT = Path(__file__).parents[3]
SURVIVORS = Path(__file__).with_name("survivors.toml")
MIN_KILLED = 0.95
_TIME_LIMIT = 600.0  # s for the tests of one mutant; a mutant that never ends is killed

_STRAPDOWN = [
    "tests/models/test_strapdown.py",
    "tests/models/test_coning.py",
    "tests/models/test_quadrature.py",
    "tests/models/test_local_gravity.py",
    "tests/models/strapdown",
]
# Module of the mathematics: tests that must notice its mutants.
MODULES = {
    "allan/deviation": ["tests/allan", "tests/reference/test_nist_sp1065.py"],
    "allan/fit/gauss_markov": ["tests/allan"],
    "allan/fit/coefficients": ["tests/allan"],
    "allan/fit/model": ["tests/allan"],
    "allan/fit/solve": ["tests/allan"],
    "allan/pooled": ["tests/allan/test_pooled.py"],
    "allan/survey/autocorrelation": ["tests/allan/survey/test_autocorrelation.py"],
    "budget/estimate": ["tests/budget", "tests/properties/test_budget_closed_form.py"],
    "budget/navigation": ["tests/budget"],
    "calibrate/estimate": ["tests/calibrate"],
    "models/base": ["tests/models/test_base.py", "tests/navigate"],
    "models/earth": ["tests/models", "tests/reference"],
    "models/numerics/chi_squared": ["tests/models/numerics/test_chi_squared.py"],
    "models/expected/companions": ["tests/models/expected"],
    "models/expected/covariance": ["tests/models/expected"],
    "models/expected/distribution": ["tests/models/expected"],
    "models/expected/errors": ["tests/models/expected"],
    "models/expected/motion": ["tests/models/expected"],
    "models/expected/sources": ["tests/models/expected"],
    "models/kalman": ["tests/models/test_kalman.py", "tests/observe"],
    "models/laboratory/environment": ["tests/models/laboratory"],
    "models/laboratory/rate_curve": ["tests/scale/test_figures.py", "tests/run/laboratory"],
    "models/laboratory/thermal_curve": ["tests/thermal/test_fit.py"],
    "models/laboratory/thermometer": ["tests/models/laboratory"],
    "models/least_squares": ["tests/models/test_least_squares.py"],
    "models/mean_covariance": [
        "tests/models/test_mean_covariance.py",
        "tests/models/test_least_squares.py",
    ],
    "models/rotation": ["tests/models/test_rotation.py", "tests/models/test_strapdown.py"],
    "models/sensors": ["tests/models/test_sensors.py"],
    "models/slow_noise": ["tests/models/test_slow_noise.py"],
    "models/strapdown/attitude": _STRAPDOWN,
    "models/strapdown/cells": _STRAPDOWN,
    "models/strapdown/geography": _STRAPDOWN,
    "models/strapdown/groups": _STRAPDOWN,
    "models/strapdown/local_gravity": _STRAPDOWN,
    "models/strapdown/mechanization": _STRAPDOWN,
    "models/strapdown/quadrature": _STRAPDOWN,
    "models/strapdown/translation": _STRAPDOWN,
    "models/turntable": ["tests/models/test_turntable.py"],
    "observe/errors_ins": ["tests/observe"],
    "observe/observability_matrix": ["tests/observe"],
    "srins/filter": ["tests/srins"],
    "srins/level_ins": ["tests/srins"],
    "srins/model": ["tests/srins"],
    "scale/curves": ["tests/scale"],
    "scale/figures": ["tests/scale/test_figures.py", "tests/scale/test_fit.py"],
    "scale/fit": ["tests/scale/test_fit.py"],
    "scale/hysteresis": ["tests/scale/test_figures.py"],
    "scale/prediction": ["tests/scale/test_figures.py"],
    "scale/repeatability": ["tests/scale/test_figures.py"],
    "thermal/basis": ["tests/thermal/test_fit.py"],
    "thermal/fit": ["tests/thermal/test_fit.py"],
    "thermal/lag": ["tests/thermal/test_lag.py"],
    "thermal/validation": ["tests/thermal/test_fit.py"],
    "thermal/warm_up": ["tests/thermal/test_warm_up.py"],
}


def main() -> None:
    """Run the campaign; exit 1 if too many mutants survive."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("modules", nargs="*", help="[default: all]")
    parser.add_argument("--each", type=int, default=14, help="mutants of a module; 0: all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    options = parser.parse_args()
    known = tomllib.loads(SURVIVORS.read_text(encoding="utf-8"))
    drawn: list[tuple[str, Mutant]] = []
    generator = random.Random(options.seed)
    for module in options.modules or MODULES:
        path = ROOT / "rotcli" / f"{module}.py"
        found = mutants(path.read_text(encoding="utf-8"))
        count = options.each or len(found)
        drawn += [(module, m) for m in generator.sample(found, min(count, len(found)))]
    with tempfile.TemporaryDirectory() as base:
        survivors = _run(drawn, Path(base), options.jobs)
    excused = [s for s in survivors if s[1].name in known.get(s[0], {})]
    alive = [s for s in survivors if s not in excused]
    for module, mutant in alive:
        print(f"survived: rotcli/{module}.py:{mutant.line}: {mutant.name}")
    judged = len(drawn) - len(excused)
    killed = judged - len(alive)
    print(f"{killed} of {judged} mutants killed; {len(excused)} more do not change behaviour")
    sys.exit(killed < MIN_KILLED * judged)


def _run(drawn: list[tuple[str, Mutant]], base: Path, jobs: int) -> list[tuple[str, Mutant]]:
    """Return the mutants that all their tests pass; each job works in a copy of the tree."""
    trees: Queue[Path] = Queue()
    for k in range(jobs):
        tree = base / str(k)
        ignored = shutil.ignore_patterns("__pycache__", ".hypothesis")
        for folder in ("rotcli", "tests", "fixtures"):
            shutil.copytree(ROOT / folder, tree / folder, ignore=ignored)
        shutil.copy(ROOT / "pyproject.toml", tree)
        trees.put(tree)

    def survives(task: tuple[str, Mutant]) -> bool:
        tree = trees.get()
        try:
            return _survives(tree, *task)
        finally:
            trees.put(tree)

    with ThreadPoolExecutor(jobs) as pool:
        alive = list(pool.map(survives, drawn))
    return [task for task, survived in zip(drawn, alive, strict=True) if survived]


def _survives(tree: Path, module: str, mutant: Mutant) -> bool:
    """Write a mutant into a copy of the tree, run its tests, and restore the module."""
    path = tree / "rotcli" / f"{module}.py"
    original = path.read_text(encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    environment |= {"OPENBLAS_NUM_THREADS": "1", "HYPOTHESIS_MAX_EXAMPLES": "20"}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    try:
        path.write_text(mutant.source, encoding="utf-8")
        done = subprocess.run(
            [*command, *MODULES[module]],
            cwd=tree,
            env=environment,
            capture_output=True,
            timeout=_TIME_LIMIT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False
    finally:
        path.write_text(original, encoding="utf-8")
    return done.returncode == 0


if __name__ == "__main__":
    main()
