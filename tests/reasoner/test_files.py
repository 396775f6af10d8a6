"""A file is written completely or not at all, by one process at a time, whatever its owner and its path."""

import os
import stat
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from confab.reasoner import files
from confab.reasoner.files import alone, as_iri_part, made_folder, write_whole
from confab.reasoner.limits import LimitError

ROWS = "thing\n"
"""The columns of a query result; new rows replace rows with the same columns."""


def left(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_texts_bytes_and_pieces_are_written_as_they_are(tmp_path: Path) -> None:
    folder = made_folder(tmp_path / "new")
    contents: tuple[tuple[str | bytes | Iterator[str], bytes], ...] = (
        ("häß", "häß".encode()),
        (b"\xff\x00", b"\xff\x00"),
        (iter(["a", "b"]), b"ab"),
        ("", b""),
    )
    for number, (content, wanted) in enumerate(contents):
        write_whole(folder / str(number), content)
        assert (folder / str(number)).read_bytes() == wanted
    assert left(folder) == ["0", "1", "2", "3"]


def test_a_content_that_fails_while_it_is_made_or_read_back_replaces_no_file(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    file.write_text(ROWS + "old")

    def broken() -> Iterator[str]:
        yield "half"
        raise ValueError("no more")

    def refuse(part: Path) -> None:
        assert part.read_text() == ROWS + "new"
        assert part.parent == tmp_path
        raise ValueError("can't be read")

    with pytest.raises(ValueError, match="no more"):
        write_whole(file, broken())
    with pytest.raises(ValueError, match="can't be read"):
        write_whole(file, ROWS + "new", refuse)
    assert file.read_text() == ROWS + "old"
    assert left(tmp_path) == ["a.txt"]
    seen: list[str] = []
    write_whole(file, ROWS + "new", lambda part: seen.append(file.read_text()))
    assert (seen, file.read_text()) == ([ROWS + "old"], ROWS + "new")


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664])
def test_permissions_stay_and_new_files_have_those_of_the_umask(tmp_path: Path, mode: int) -> None:
    old, new = tmp_path / "old", tmp_path / "new"
    old.touch()
    old.chmod(mode)
    before = os.umask(0o027)
    try:
        write_whole(old, "x")
        write_whole(new, "x")
    finally:
        os.umask(before)
    assert [stat.S_IMODE(file.stat().st_mode) for file in (old, new)] == [mode, 0o640]


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a file away")
def test_a_rewritten_file_keeps_its_owner(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    file.write_text(ROWS + "old")
    os.chown(file, 1234, 2345)
    write_whole(file, ROWS + "new")
    assert (file.stat().st_uid, file.stat().st_gid) == (1234, 2345)


def test_links_to_missing_files_are_followed_and_circular_links_are_refused(tmp_path: Path) -> None:
    (tmp_path / "one").symlink_to("two")
    (tmp_path / "two").symlink_to("three")
    write_whole(tmp_path / "one", "x")
    assert (tmp_path / "three").read_text() == "x"
    assert (tmp_path / "one").is_symlink() and (tmp_path / "two").is_symlink()
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(OSError, match="leads back to itself"):
        write_whole(tmp_path / "a", "x")


def test_a_path_to_a_folder_a_pipe_or_a_read_only_file_is_named_and_not_replaced(tmp_path: Path) -> None:
    folder, pipe, locked = tmp_path / "folder", tmp_path / "pipe", tmp_path / "locked"
    folder.mkdir()
    os.mkfifo(pipe)
    locked.write_text("old")
    locked.chmod(0o444)
    for path, said in ((folder, "is a folder"), (pipe, "is no ordinary file"), (locked, "is read-only")):
        with pytest.raises(OSError, match=said) as error:
            write_whole(path, "new")
        assert error.value.filename == str(path)
    assert locked.read_text() == "old"
    assert left(tmp_path) == ["folder", "locked", "pipe"]
    with pytest.raises(OSError, match="is a file; wanted a folder") as error:
        write_whole(locked / "inside", "new")
    assert error.value.filename == str(locked / "inside")


def test_a_second_writer_waits_for_the_first_and_says_so_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "link").symlink_to("a.txt")
    order: list[str] = []

    def second() -> None:
        with alone(tmp_path / "link"):
            order.append("second")

    waiting = threading.Thread(target=second)
    with alone(tmp_path / "a.txt"):
        waiting.start()
        waiting.join(0.2)
        order.append("first")
    waiting.join()
    assert order == ["first", "second"]
    assert caplog.text.count("waiting for another process that writes in") == 1
    with alone(made_folder(tmp_path / "b") / "c.txt"):  # a lock concerns one folder only
        assert (tmp_path / "b").is_dir()


def test_a_writer_gives_up_waiting_after_a_time_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "PATIENCE", 0.05)
    with alone(tmp_path / "a.txt"), pytest.raises(LimitError, match="has been writing in"), alone(tmp_path / "b.txt"):
        pass
    with alone(tmp_path / "a.txt"):
        pass


def test_a_name_becomes_part_of_an_iri() -> None:
    assert as_iri_part("my table/ä%") == "my%20table%2Fä%25"


def test_a_file_in_the_place_of_a_folder_is_named_as_the_fault(tmp_path: Path) -> None:
    (tmp_path / "out").touch()
    with pytest.raises(NotADirectoryError, match="is a file; wanted a folder"):
        made_folder(tmp_path / "out")
