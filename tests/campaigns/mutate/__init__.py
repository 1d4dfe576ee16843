"""Mutation tests of the mathematics: change one operator, expect a test to fail.

`python -m tests.campaigns.mutate` (`make mutate`) draws mutants of the modules in mathematics.toml
with a seeded generator, runs the tests of the module on each, and lists the survivors. A survivor
that does not change behaviour, or only beyond rounding, is listed in survivors.toml with the
reason; at least 95 % of the others must be killed. A mutant that takes more than five times the
time of the original code counts as killed. `--each 25` draws 25 mutants of a module, always the
same ones; `--skip 25` the next; `--again` the survivors of the last runs, after a test was added.
record.json keeps the last result of each module, of which docs/evidence/mutants.md is made.
"""
