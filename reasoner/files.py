"""Atomic writing of files: complete, or not at all."""

from __future__ import annotations

import errno
import fcntl
import logging
import os
import re
import stat
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic, sleep
from urllib.parse import quote
from uuid import uuid4

from confab.reasoner.kinds import Kind, kind_of
from confab.reasoner.limits import LimitError

log = logging.getLogger(__name__)
STDOUT = Path("-")
"""In place of a file's name: standard output."""
PATIENCE = 600.0
"""Seconds to wait for other writers of a file. (A lesson in a large scene takes minutes.)"""


def write_whole(
    path: Path, content: str | bytes | Iterable[str], check: Callable[[Path], object] | None = None
) -> None:
    """Write a file atomically: a reader, or a crash, sees either the old content or the new. Errors are those of `written_whole`.

    Parameters
    ----------
    path : Path
    content : str, bytes or iterable of str
    check : callable, optional
        Reads the written file; if it raises an error, no file is replaced.
    """
    pieces: Iterable[str | bytes] = [content] if isinstance(content, str | bytes) else content
    if path == STDOUT:
        sys.stdout.write("".join(piece if isinstance(piece, str) else piece.decode("utf-8") for piece in pieces))
        return
    with written_whole(path) as part:
        with part.open("xb") as file:
            for piece in pieces:
                file.write(piece.encode("utf-8") if isinstance(piece, str) else piece)
        if check is not None:
            check(part)


@contextmanager
def written_whole(path: Path, suffix: str = "") -> Iterator[Path]:
    """Yield the name of a temporary file to be written; at the end of the block it replaces a file, completely or not at all.

    A link is followed: its target is replaced. Permissions stay as they were. Folders, devices, read-only files, and files with
    content of another kind than the new content (`confab.reasoner.kinds`) are never replaced.

    Parameters
    ----------
    path : Path
    suffix : str
        The ending of the temporary file's name, for libraries that look at it.

    Raises
    ------
    OSError
        The file can't be written, or must not be replaced; it names the file.
    """
    target = _behind(path)
    part = target.parent / f".confab-{uuid4().hex}.part{suffix}"
    try:
        old = _replaceable(target)
        target.parent.mkdir(parents=True, exist_ok=True)
        yield part
        if old is not None:
            _same_kind(target, kind_of(part, target.suffix))
        with part.open("rb") as file:
            os.fsync(file.fileno())
        if old is not None:
            part.chmod(stat.S_IMODE(old.st_mode))
            with suppress(PermissionError):  # only root can give a file away
                os.chown(part, old.st_uid, old.st_gid)
        part.replace(target)
    except OSError as error:
        said = (
            (error.strerror or str(error))
            if error.filename in (None, str(path))
            else f"can't be written: {error.strerror}"
        )
        raise OSError(error.errno, said, str(path)) from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def check_replaceable(path: Path, kind: str) -> None:
    """Raise the errors that `written_whole` would raise for content of a kind; called before the content is computed.

    Raises
    ------
    OSError
        The file must not be replaced.
    """
    if path == STDOUT:
        return
    target = _behind(path)
    try:
        if _replaceable(target) is not None:
            _same_kind(target, Kind(kind))
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def has_content(path: Path) -> bool:
    """Return whether a file exists and isn't empty."""
    return path.is_file() and path.stat().st_size > 0


def _replaceable(target: Path) -> os.stat_result | None:
    """Return the status of an ordinary, writable file; None if the file doesn't exist."""
    if target.is_symlink():
        raise OSError(errno.ELOOP, "is a link that leads back to itself; give the name of a file")
    old = target.stat() if target.exists() else None
    if old is not None and not stat.S_ISREG(old.st_mode):
        what = "a folder" if stat.S_ISDIR(old.st_mode) else "no ordinary file"
        raise OSError(errno.EISDIR, f"is {what}; wanted the name of a file")
    if old is not None and not (old.st_mode & 0o222 and os.access(target, os.W_OK)):
        raise OSError(errno.EACCES, "is read-only; make it writable, or give another name")
    return old


def _same_kind(target: Path, new: Kind | None) -> None:
    """Raise `FileExistsError` unless content of a kind may replace a file."""
    old = kind_of(target)
    if old is not None and (new is None or not new.replaces(old)):
        what = "this output" if new is None or new.name == old.name else new.name
        said = f"is {old}, which {what} doesn't replace; give another name, or remove the file first"
        raise FileExistsError(errno.EEXIST, said)


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Lock a file: its folder is locked, so that no lock file is left behind. Other callers of this function wait.

    Links are followed, so that all paths to a file lead to one lock. A caller that has to wait is notified.

    Raises
    ------
    OSError
        There is no such folder, and it can't be made.
    LimitError
        Another process has kept the folder locked for `PATIENCE` seconds.
    """
    folder = _behind(path).parent
    folder.mkdir(parents=True, exist_ok=True)
    opened = os.open(folder, os.O_RDONLY)
    begin, told = monotonic(), False
    try:
        while True:
            try:
                fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if monotonic() - begin > PATIENCE:
                    raise LimitError(
                        f"{path}: another process has been writing in {folder} for {PATIENCE:.0f} s; end it, then try again"
                    ) from None
                if not told:
                    log.warning("confab: %s: waiting for another process that writes in %s", path, folder)
                told = True
                sleep(0.02)
        yield
    finally:
        os.close(opened)


def as_iri_part(name: str) -> str:
    """Return a file's name as the last part of an IRI, with invalid characters escaped.

    >>> as_iri_part("my table"), as_iri_part("Küche-2")
    ('my%20table', 'Küche-2')
    """
    return re.sub(r"[^\w.~-]", lambda match: quote(os.fsencode(match[0]), safe=""), name)


def _behind(path: Path) -> Path:
    """Return the target of a path through all links, even if it doesn't exist yet."""
    return Path(os.path.realpath(path))


@contextmanager
def silent_about_numbers() -> Iterator[None]:
    """Suppress rdflib's warnings, with tracebacks, about literals that don't match their datatypes."""
    spoken = logging.getLogger("rdflib.term")
    before, spoken.disabled = spoken.disabled, True
    try:
        yield
    finally:
        spoken.disabled = before
