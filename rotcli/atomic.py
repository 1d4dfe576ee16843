"""Files written whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def replace_whole(path: str | Path) -> Iterator[BinaryIO]:
    """Open a temporary file beside `path` for writing and rename it to `path` on success.

    When the block ends in any exception (an interrupt too), or the file system refuses, the
    temporary file is removed and a file that was there before stays as it was.

    Raises OSError when the directory cannot be written.
    """
    target = Path(path)
    if target.is_dir():
        raise IsADirectoryError(21, "Is a directory", str(target))
    if target.exists() and not target.is_file():  # a pipe or a device is written, not replaced
        with target.open("wb") as stream:
            yield stream
        return
    if target.is_symlink():  # write through a link, as plain writing would
        target = target.resolve()
    draft = target.with_name(f".{target.name}.{os.urandom(4).hex()}.part")
    try:
        with draft.open("xb") as stream:
            yield stream
        if target.exists():
            draft.chmod(target.stat().st_mode & 0o7777)
        os.replace(draft, target)  # noqa: PTH105 (one atomic step on every system)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise
