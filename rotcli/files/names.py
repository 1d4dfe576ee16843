"""Known names that resemble an unknown one, for messages."""

from collections.abc import Iterable
from itertools import islice

from rotcli.lazy import lazily

with lazily():
    import difflib

# Share of equal letters (difflib) below which a name is a coincidence, not a misspelling.
MIN_SIMILARITY = 0.6
_MAX_NAMES = 1000  # a comparison with a million names takes minutes
_MAX_LISTED = 60  # names of the longest section of a rig


def closest_match(name: str, known: Iterable[str]) -> str | None:
    """Return the known name most similar to `name`, None where no name is similar.

    >>> closest_match("ratte", ["skip", "rate"]), closest_match("zzz", ["skip", "rate"])
    ('rate', None)
    """
    names = list(islice(known, _MAX_NAMES))
    lower = {n.lower(): n for n in reversed(names)}
    found = difflib.get_close_matches(name[:100].lower(), lower, n=1, cutoff=MIN_SIMILARITY)
    return lower[found[0]] if found else None


def suggest(name: str, known: Iterable[str]) -> str:
    """Return advice on an unknown name: the similar one, else all that are known.

    >>> suggest("ratte", ["skip", "rate"]), suggest("zzz", ["skip", "rate"])
    ('similar: rate', 'known: skip, rate')
    """
    names = list(islice(known, _MAX_NAMES))
    found = closest_match(name, names)
    return f"similar: {found}" if found else f"known: {', '.join(names[:_MAX_LISTED])}"
