"""A process for many runs keeps its memory and its results."""

import platform
import subprocess
import sys

import pytest

_PAGE_FAULTS = """
import gc, resource, sys
import numpy as np
from rotcli.cli.batch.process import prepare_for_many_runs

if sys.argv[1] == "prepared":
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


def _page_faults(mode: str) -> tuple[int, int, int]:
    command = [sys.executable, "-c", _PAGE_FAULTS, mode]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    faults, threshold, frozen = done.stdout.split()
    return int(faults), int(threshold), int(frozen)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="mallopt is of glibc")
def test_a_prepared_process_does_not_map_the_memory_of_each_run_again():
    # A run of 16 MB has 3900 pages of 4 KiB.
    faults, threshold, frozen = _page_faults("prepared")
    assert faults < 3900
    assert threshold == 200_000
    assert frozen > 1000
    assert _page_faults("as it is")[0] > 10 * 1900
