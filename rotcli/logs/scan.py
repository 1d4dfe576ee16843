"""Checks of the readings of a long log, chunk by chunk, and of stamps that never change."""

import numpy as np

from rotcli.files.channels import AXES
from rotcli.logs import plausible
from rotcli.logs.container.columns import Loaded, Wanted
from rotcli.logs.container.header import Header
from rotcli.logs.container.loading import load_chunks
from rotcli.logs.describe.layout import Layout
from rotcli.logs.imu import clipping_counters, unit_warnings
from rotcli.logs.readings import check_size
from rotcli.logs.record import CHUNK_SAMPLES
from rotcli.logs.timing.stamps import raise_constant_stamps
from rotcli.rig.rig import ImuSettings
from rotcli.units import FloatArray


class ReadingScan:
    """The warnings about the six axes of a log, one for each axis and cause."""

    def __init__(self, layout: Layout, imu: ImuSettings) -> None:
        self._layout = layout
        self._counters = clipping_counters(imu)
        self._axes: dict[str, str] = {}
        self._units: list[str] = []

    def add(self, loaded: Loaded, time: FloatArray, values: FloatArray) -> None:
        """Take a chunk: times (n,), s, values (6, n), SI; raises LogError for impossible ones."""
        check_size(loaded, values, AXES)
        for counter, triad in zip(self._counters, (values[:3], values[3:]), strict=True):
            counter.add(time, triad)
        self._units = self._units or unit_warnings(self._layout, values[:3])
        path = self._layout.path
        for text in plausible.check_axes(path, time, values):
            axis = text.removeprefix(f"{path}: ").partition(" ")[0]
            self._axes.setdefault(axis, text)

    def warnings(self, clock: list[str]) -> tuple[str, ...]:
        """Return all warnings: of the axes and units, the given ones of the clock, of clipping."""
        path = self._layout.path
        clipped = (text for counter in self._counters for text in counter.warnings(path))
        return (*self._axes.values(), *self._units, *clock, *clipped)


def check_stamps_change(header: Header, layout: Layout, section: str) -> None:
    """Raise LogError where all stamps of a log are equal; it is read no further than needed.

    Such a log is not loaded to see this: equal numbers take no room in a Parquet file.
    """
    first, rows = 0.0, 0
    for loaded, _ in load_chunks(header, Wanted(layout.time.columns[:1]), CHUNK_SAMPLES):
        time = np.empty(loaded.rows)
        loaded.fill(time, 0, layout.time.scale[0])
        first = first if rows else float(time[0])
        rows += loaded.rows
        if time.min() != first or time.max() != first:
            return
    raise_constant_stamps(header.path, rows, first, section)
