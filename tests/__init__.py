"""Tests of rotcli."""

import os

# Before numpy is imported: sums by several threads have other last digits than those of a process
# that works for a batch. `make` sets the same.
for _library in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_library, "1")
