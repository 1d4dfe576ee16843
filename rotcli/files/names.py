"""Did you mean: the known name that an unknown one was most likely meant to be."""

from collections.abc import Iterable
from itertools import islice


def nearest(name: str, known: Iterable[str]) -> str:
    """Return the known name most like `name` (there always is one)."""
    import difflib  # only for a fault

    some = list(islice(known, 1000))  # looking through a million names takes minutes
    return difflib.get_close_matches(name[:100].lower(), some, n=1, cutoff=0.0)[0]
