"""Options of the command line that belong to the codes of findings."""

from rotcli.errors import RotcliError

_SEGMENT = "option: --static, --rotation or --window"
OPTIONS = {
    "segment-rate": _SEGMENT,
    "segment-records": _SEGMENT,
    "segment-outside": _SEGMENT,
    "segment-moving": _SEGMENT,
    "segment-overlap": "option: --static or --rotation",
    "still-segment-turns": "option: --static",
    "no-still-segment": "option: --static",
    "turning-segment-still": "option: --rotation",
    "no-turning-segment": "option: --rotation",
    "no-window": "option: --window",
    "window-samples": "option: --window",
}


def with_option(error: RotcliError) -> str:
    """Return the text of an error, with the option that belongs to its code, if any."""
    option = OPTIONS.get(getattr(error, "code", ""))
    return f"{error} ({option})" if option else str(error)
