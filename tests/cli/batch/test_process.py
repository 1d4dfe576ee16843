"""A process for many runs keeps its memory and its results."""

import platform
import subprocess
import sys

import pytest

_PAGE_FAULTS = """
import gc, resource
import numpy as np
from rotcli.cli.batch.process import prepare_for_many_runs

prepare_for_many_runs()

def work():
    return [np.ones(500_000) for _ in range(4)]  # 16 MB

work()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(10):
    work()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
print(gc.get_threshold()[0], gc.get_freeze_count())
"""


def _page_faults() -> tuple[int, int, int]:
    command = [sys.executable, "-c", _PAGE_FAULTS]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    faults, threshold, frozen = done.stdout.split()
    return int(faults), int(threshold), int(frozen)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="mallopt is of glibc")
def test_a_prepared_process_does_not_map_the_memory_of_each_run_again():
    # A run has 16 MB, 3900 pages of 4 KiB: ten times as many are mapped where none is kept.
    faults, threshold, frozen = _page_faults()
    assert faults < 3900
    assert threshold == 200_000
    assert frozen > 1000
