"""Draw mutants, run the tests on them, list the survivors, and renew docs/evidence/mutants.md."""

import argparse
import os
import random
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path

from tests.campaigns.mutate import record
from tests.campaigns.mutate.mutants import Mutant, mutants
from tests.campaigns.mutate.trial import ROOT, Child, Tests, copy_tree, preload

HERE = Path(__file__).parent


def main() -> None:
    """Run the campaign; exit 1 if too many mutants survive."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("modules", nargs="*", help="such as models/earth or srins [default: all]")
    parser.add_argument("--each", type=int, default=25, help="mutants of a module; 0: all")
    parser.add_argument("--skip", type=int, default=0, help="mutants of a module to skip first")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--again", action="store_true", help="only survivors of the last runs")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    options = parser.parse_args()
    known = tomllib.loads((HERE / "survivors.toml").read_text(encoding="utf-8"))
    preload()
    results: list[record.Result] = []
    broken: list[str] = []
    with tempfile.TemporaryDirectory() as base:
        trees = [copy_tree(Path(base) / str(k)) for k in range(options.jobs)]
        for module, tests in _modules(options.modules):
            original = (trees[0] / "rotcli" / f"{module}.py").read_text(encoding="utf-8")
            found = mutants(original)
            for name in known.get(module, {}).keys() - {mutant.name for mutant in found}:
                print(f"survivors.toml: {module} has no mutant any more: {name}", flush=True)
            drawn, others = _choose(module, found, options)
            judged = [m for m in drawn if m.name not in known.get(module, {})]
            excused = len(drawn) - len(judged)
            if not drawn and (not options.again or others.same_as_kept):
                continue
            if judged and not tests.seconds and not Child(trees[0], tests).wait():
                print((trees[0] / "output.txt").read_text()[-4000:])
                print(f"{module}: the tests fail without a mutant", flush=True)
                broken.append(module)
                continue
            start = time.monotonic()
            survivors = [m.name for m in _survivors(module, original, judged, tests, trees)]
            counts = others.judged + len(judged), others.excused + excused
            result = record.Result(module, *counts, survivors)
            results.append(result)
            if not options.skip:
                record.keep(result)
            print(f"{result}; {time.monotonic() - start:.0f} s", flush=True)
    record.write_page(known)
    total = record.Result.sum("all", results)
    print(total)
    sys.exit(bool(broken) or not total.enough)


def _modules(requested: list[str]) -> Iterator[tuple[str, Tests]]:
    """Yield the modules that are asked for (a module or a folder) with their tests.

    Modules with the same tests share them, and with them their times and the tests that kill.
    """
    shared: dict[tuple[str, ...], Tests] = {}
    table = tomllib.loads((HERE / "mathematics.toml").read_text(encoding="utf-8"))
    for folder, modules in table.items():
        for name, tests in modules.items():
            module = f"{folder}/{name}"
            if not requested or any(f"{module}/".startswith(f"{r}/") for r in requested):
                path = f"rotcli/{module}.py"
                examples = [path] if ">>>" in (ROOT / path).read_text(encoding="utf-8") else []
                arguments = (*examples, *(f"tests/{path}" for path in tests))
                yield module, shared.setdefault(arguments, Tests(list(arguments)))


def _choose(
    module: str, found: list[Mutant], options: argparse.Namespace
) -> tuple[list[Mutant], record.Result]:
    """Return the mutants of a module to try, and the counts of its last run that remain.

    The order depends on the seed and the module only. `again`: the survivors of the last run.
    """
    none = record.Result(module, 0, 0)
    if options.again:
        last = record.kept().get(module, none)
        drawn = [mutant for mutant in found if mutant.name in last.survivors]
        return drawn, record.Result(module, last.killed, last.excused)
    random.Random(f"{options.seed} {module}").shuffle(found)
    count = options.each or len(found)
    return found[options.skip : options.skip + count], none


def _survivors(
    module: str, original: str, drawn: list[Mutant], tests: Tests, trees: list[Path]
) -> Iterator[Mutant]:
    """Run the tests on each mutant, one child per tree, and yield the mutants that pass them."""
    waiting = list(reversed(drawn))
    children: dict[Path, tuple[Mutant, Child]] = {}
    while waiting or children:
        for tree in trees:
            path = tree / "rotcli" / f"{module}.py"
            if tree not in children:
                if waiting:
                    mutant = waiting.pop()
                    path.write_text(mutant.source, encoding="utf-8")
                    children[tree] = mutant, Child(tree, tests)
                continue
            mutant, child = children[tree]
            passed = child.poll()
            if passed is None:
                continue
            del children[tree]
            path.write_text(original, encoding="utf-8")
            if passed:
                print(f"survived: rotcli/{module}.py:{mutant.line}: {mutant.name}", flush=True)
                yield mutant
        time.sleep(0.02)


if __name__ == "__main__":
    main()
