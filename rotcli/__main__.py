"""`rotcli` and `python -m rotcli`: from the first import on an interrupt is one line."""

import os
import sys


def _import_no_code_from_the_working_directory() -> None:
    """Remove the working directory from the import path, here and in child processes.

    It is the folder of the data: a file `click.py` next to a log must not be executed. If rotcli
    itself is imported from there (a clone), the folder goes to the end of the path.
    """
    os.environ["PYTHONSAFEPATH"] = "1"  # read by child processes at their start
    try:
        here = os.path.realpath(".")  # noqa: PTH
    except FileNotFoundError:  # it was removed: there is no code in it
        return
    package = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))  # noqa: PTH120
    sys.path[:] = [p for p in sys.path if os.path.realpath(p or ".") != here]
    if package == here:
        sys.path.append(here)
        return
    # An empty entry is the working directory too, and `PYTHONPATH=$PYTHONPATH:/lib` makes one.
    entries = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    kept = [p for p in entries if os.path.realpath(p or ".") != here]
    if kept != entries:
        os.environ["PYTHONPATH"] = os.pathsep.join(kept)


if sys.argv[:1] == [__file__] or __name__ == "__main__":
    _import_no_code_from_the_working_directory()

import atexit  # noqa: E402
import gc  # noqa: E402
from contextlib import suppress  # noqa: E402
from typing import NoReturn  # noqa: E402

# Searches for unused cycles among 400 modules take a seventh of the time of a short command.
GC_THRESHOLDS = (200_000, 20, 20)


def main() -> NoReturn:
    """Run the command line; see `rotcli.cli.main`."""
    _import_no_code_from_the_working_directory()
    _open_closed_streams()
    gc.set_threshold(*GC_THRESHOLDS)
    # Arrow's own allocator keeps some 30 MB more of a log of hours than that of the C library.
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    # Sums of several threads have other last digits: the same bytes on any number of cores.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    status: int | str | None = 0
    try:
        # Here, so that an interrupt during these imports is one line as well.
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


def _open_closed_streams() -> None:
    """Open /dev/null as each of the standard streams that is closed (`2>&-`)."""
    for descriptor, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest free descriptor is the closed one
            setattr(sys, name, os.fdopen(descriptor, mode, encoding="utf-8", closefd=False))


def _is_interrupt(fault: BaseException | None) -> bool:
    """Return whether an interrupt is the root cause: Python wraps it while it creates a class."""
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
