"""Faults made on purpose: logs that lie, files that attack, writers that are killed.

`python -m tests.campaigns.faults` (`make faults`) tries them all and writes
docs/evidence/faults.md; the tests try some.
"""
