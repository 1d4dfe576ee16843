"""`rotcli` and `python -m rotcli`: from the first import on an interrupt is one line."""

import atexit
import os
import sys
from contextlib import suppress
from typing import NoReturn


def main() -> NoReturn:
    """Run the command line; see `rotcli.cli.main`."""
    status: int | str | None = 0
    try:
        from rotcli.cli.main import main as run

        run()
    except SystemExit as stop:
        status = stop.code
    except (KeyboardInterrupt, Exception) as fault:
        # An interrupt while importing, or after the command was done.
        if not _is_interrupt(fault):
            raise
        sys.stderr.write("rotcli: interrupted; no partial files remain\n")
        status = 130
    _leave(status if isinstance(status, int) else int(status is not None))


def _is_interrupt(fault: BaseException | None) -> bool:
    """Tell whether an interrupt is at the root: in a class's making Python wraps what it meets."""
    while fault is not None and not isinstance(fault, KeyboardInterrupt):
        fault = fault.__cause__ or fault.__context__
    return fault is not None


def _leave(status: int) -> NoReturn:
    """End the process without the destructors of libraries.

    A read that is cut short leaves Arrow's threads work that they never do, and the end of its
    pool would wait for them for ever, one time in many.
    """
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(status)


if __name__ == "__main__":
    main()
