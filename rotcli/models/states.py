"""Names and slices of a state vector: a filter takes its states by name, never by number."""

from typing import TYPE_CHECKING


class StateLayout:
    """The states of a filter in groups; each group is an attribute that contains its slice.

    >>> layout = StateLayout(VELOCITY=("v_east", "v_north"), BIAS=("b_x", "b_y", "b_z"))
    >>> layout.BIAS, len(layout), layout.names[layout.BIAS.start]
    (slice(2, 5, None), 5, 'b_x')
    """

    def __init__(self, **groups: tuple[str, ...]) -> None:
        self.names: tuple[str, ...] = tuple(name for group in groups.values() for name in group)
        start = 0
        for group, names in groups.items():
            setattr(self, group, slice(start, start + len(names)))
            start += len(names)

    if TYPE_CHECKING:  # the groups are set by name

        def __getattr__(self, group: str) -> slice: ...

    def __len__(self) -> int:
        return len(self.names)

    def index(self, name: str) -> int:
        """Return the position of the state of this name."""
        return self.names.index(name)

    def span(self, first: str, last: str) -> slice:
        """Return the slice from the group `first` to the group `last`, both included.

        >>> StateLayout(A=("a",), B=("b1", "b2"), C=("c",)).span("B", "C")
        slice(1, 4, None)
        """
        return slice(getattr(self, first).start, getattr(self, last).stop)
