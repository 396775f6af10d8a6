"""Atomic writing of files: a file is replaced completely or not at all."""

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
"""File name that stands for the standard output."""
PATIENCE = 600.0
"""Seconds to wait for other writers of a file; learning in a large scene takes minutes."""


def write_whole(
    path: Path, content: str | bytes | Iterable[str], check: Callable[[Path], object] | None = None
) -> None:
    """Write a file atomically: readers see the old or the new content, even after a crash.

    The function raises the errors of `written_whole`.

    Parameters
    ----------
    path : Path
    content : str, bytes or iterable of str
    check : callable, optional
        Function that is called with the path of the temporary file; if it raises an error, the old file is kept.
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
    """Provide a temporary file name in a ``with`` block, and replace `path` by this file at the end of the block.

    Symbolic links are followed, and permissions are kept. Folders, devices, read-only files, and files whose content is of
    another kind than the new content (`confab.reasoner.kinds`) are never replaced.

    Parameters
    ----------
    path : Path
    suffix : str
        Suffix of the temporary file, for libraries that choose a format by the suffix.

    Raises
    ------
    OSError
        The file can't be written or mustn't be replaced; the error names the file.
    """
    target = _behind(path)
    part = target.parent / f".confab-{uuid4().hex}.part{suffix}"
    try:
        old = _replaceable(target)
        check_folder(path)
        target.parent.mkdir(exist_ok=True)
        yield part
        if old is not None:
            _same_kind(target, kind_of(part, target.suffix))
        with part.open("rb") as file:
            os.fsync(file.fileno())
        if old is not None:
            part.chmod(stat.S_IMODE(old.st_mode))
            with suppress(PermissionError):  # only the user root can change the owner of a file
                os.chown(part, old.st_uid, old.st_gid)
        part.replace(target)
    except OSError as error:
        own = error.filename in (None, str(path))
        said = (error.strerror or str(error)) if own else f"can't be written: {error.strerror}"
        raise OSError(error.errno, said, str(path)) from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def check_replaceable(path: Path, kind: str) -> None:
    """Raise the errors that `written_whole` would raise for content of a kind; callers use this before they compute the content.

    Raises
    ------
    OSError
        The file mustn't be replaced.
    """
    if path == STDOUT:
        return
    target = _behind(path)
    try:
        if _replaceable(target) is not None:
            _same_kind(target, Kind(kind))
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def check_folder(path: Path) -> None:
    """Raise an error if a folder other than the last folder of a path is missing, or if a part of the path is a file.

    Raises
    ------
    FileNotFoundError
        A folder is missing; its name may be mistyped.
    NotADirectoryError
        A part of the path is a file.
    """
    folder = _behind(path).parent
    above = folder.parent
    try:
        above.stat()
        if folder.exists() and not folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, f"'{folder}' is a file; wanted a folder", str(path))
    except FileNotFoundError:
        said = f"there is no folder '{above}'; create it, or give another name"
        raise FileNotFoundError(errno.ENOENT, said, str(path)) from None


def made_folder(path: str | Path) -> Path:
    """Create a folder, and the folder that contains it, unless both exist; return the path.

    The function raises the errors of `check_folder`.
    """
    check_folder(Path(path))
    if Path(path).exists() and not Path(path).is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "is a file; wanted a folder", str(path))
    Path(path).parent.mkdir(exist_ok=True)
    Path(path).mkdir(exist_ok=True)
    return Path(path)


def has_content(path: Path) -> bool:
    """Return whether a file exists and isn't empty."""
    return path.is_file() and path.stat().st_size > 0


def _replaceable(target: Path) -> os.stat_result | None:
    """Return the status of a regular, writable file; return None if the file doesn't exist."""
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
    """Raise `FileExistsError` if a file has a kind of content that the new content must not replace."""
    old = kind_of(target)
    if old is not None and (new is None or not new.replaces(old)):
        what = "this output" if new is None or new.name == old.name else new.name
        said = f"is {old}, which {what} doesn't replace; give another name, or remove the file first"
        raise FileExistsError(errno.EEXIST, said)


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Lock a file during a ``with`` block; callers that lock another file in the same folder have to wait.

    The lock is on the folder; therefore, no lock file remains. Symbolic links are followed, so that all paths to a file share one
    lock. A warning is logged if the caller has to wait.

    Raises
    ------
    OSError
        The folder doesn't exist.
    LimitError
        Another process has locked the folder for `PATIENCE` seconds.
    """
    check_folder(path)
    folder = _behind(path).parent
    folder.mkdir(exist_ok=True)
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
    """Return a file name as the last part of an IRI, with invalid characters escaped.

    >>> as_iri_part("my table"), as_iri_part("Küche-2")
    ('my%20table', 'Küche-2')
    """
    return re.sub(r"[^\w.~-]", lambda match: quote(os.fsencode(match[0]), safe=""), name)


def _behind(path: Path) -> Path:
    """Return the path after following all links, even if the target doesn't exist."""
    return Path(os.path.realpath(path))


@contextmanager
def silent_about_numbers() -> Iterator[None]:
    """During a ``with`` block, suppress rdflib's warnings about literals that don't match their datatypes."""
    spoken = logging.getLogger("rdflib.term")
    before, spoken.disabled = spoken.disabled, True
    try:
        yield
    finally:
        spoken.disabled = before
