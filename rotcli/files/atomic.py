"""Atomic writes: a file is written completely or not at all; drafts of killed writers are removed.

A file is written as a draft next to its target, `.NAME.12345678.part`, and renamed. Its writer
locks the draft, and the system releases the lock when the writer ends, however it ends: the next
writer of the same target removes the drafts without a lock and leaves the others alone.
"""

import os
import re
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

try:
    import fcntl
except ImportError:  # a system without these locks
    fcntl = None  # type: ignore[assignment]

_OLD = 86400.0  # s; where locks do not work, a draft untouched for a day is litter


@contextmanager
def atomic_write(path: str | Path, *, sync: bool = True) -> Iterator[BinaryIO]:
    """Open a temporary file next to `path` for writing and rename it to `path` on success.

    When the block ends in any exception (an interrupt too), or the file system refuses, the
    temporary file is removed and a file that was there before stays as it was. What a killed
    writer of the same target left is removed first. sync: file and folder reach the disk before
    the function returns, so that a loss of power leaves the old file or the new one.

    Raises OSError when the directory cannot be written.
    """
    target = Path(path)
    if target.is_dir():
        raise IsADirectoryError(21, "Is a directory", str(target))
    if target.exists() and not target.is_file():  # /dev/null, a pipe: nothing to replace
        with target.open("wb") as plain:
            yield plain
        return
    if target.is_symlink():  # write through a link, as plain writing would
        target = Path(os.path.realpath(target))
    _sweep(target)
    draft, stream, lock = _open_draft(target)
    try:
        with stream:
            yield stream
            if not stream.closed:  # a stream of a compressor closes the file with itself
                stream.flush()
                if sync:
                    os.fsync(stream.fileno())
        if target.exists():
            draft.chmod(target.stat().st_mode & 0o7777)
        os.replace(draft, target)  # noqa: PTH105 (one atomic step on every system)
        if sync:
            _sync_folder(target.parent)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise
    finally:
        if lock is not None:
            os.close(lock)


@contextmanager
def folder_lock(folder: Path) -> Iterator[None]:
    """Lock of a folder whose files belong together: two writers would mix theirs.

    Raises BlockingIOError where another process has it. The lock leaves nothing behind.
    """
    if fcntl is None:
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise
        except OSError:  # a file system without locks
            pass
        yield
    finally:
        os.close(descriptor)


def _open_draft(target: Path) -> tuple[Path, BinaryIO, int | None]:
    """Make a draft; return it with its stream and the descriptor that keeps its lock."""
    while True:
        draft = target.with_name(f".{target.name}.{os.urandom(4).hex()}.part")
        stream = draft.open("xb")
        if fcntl is None:
            return draft, stream, None
        with suppress(OSError):  # a file system without locks
            fcntl.flock(stream, fcntl.LOCK_EX)
        # Another writer may have swept it between the two steps.
        with suppress(FileNotFoundError):
            if os.path.samestat(draft.stat(), os.fstat(stream.fileno())):
                return draft, stream, os.dup(stream.fileno())  # stays when the stream is closed
        stream.close()


def _sync_folder(folder: Path) -> None:
    """Write the entries of a folder to the disk, where the system can."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _sweep(target: Path) -> None:
    """Remove the drafts of a target without a lock; those that cannot be checked remain."""
    draft = re.compile(re.escape(f".{target.name}.") + r"[0-9a-f]{8}\.part")
    with suppress(OSError):
        for name in os.listdir(target.parent):  # noqa: PTH208 (names are all that is needed)
            if draft.fullmatch(name):
                with suppress(OSError):
                    _remove_if_left(target.with_name(name))


def _remove_if_left(draft: Path) -> None:
    if not stat.S_ISREG(draft.lstat().st_mode):  # a link, or a pipe whose opening would wait
        return
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    with open(os.open(draft, flags), "rb") as stream:  # noqa: PTH123 (of a descriptor)
        if fcntl is not None:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                return
            except OSError:
                if time.time() - draft.stat().st_mtime < _OLD:
                    return
        elif time.time() - draft.stat().st_mtime < _OLD:
            return
        draft.unlink()
