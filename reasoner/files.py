"""Files written whole or not at all."""

from __future__ import annotations

import errno
import fcntl
import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path


def write_whole(path: Path, content: str | bytes | Iterable[str]) -> None:
    """Write a file so that a reader, or a crash, sees the old content or the new: temporary file, fsync, replace.

    The content can come in pieces.

    Raises
    ------
    OSError
        The folder can't be written to.
    """
    pieces: Iterable[str | bytes] = [content] if isinstance(content, str | bytes) else content
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "is a folder; wanted the name of a file", str(path))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise OSError(error.errno, f"can't be written: {error.strerror}", str(path)) from error
    try:
        with os.fdopen(handle, "wb") as file:
            for piece in pieces:
                file.write(piece.encode("utf-8") if isinstance(piece, str) else piece)
            file.flush()
            os.fsync(file.fileno())
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Let nobody else who asks for it rewrite a file until this is done; its folder is locked, so that nothing is left behind.

    Raises
    ------
    OSError
        There is no such folder, and it can't be made.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)
