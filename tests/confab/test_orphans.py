"""No process outlives the command that started it."""

import os
import signal
import sys
import time
from pathlib import Path
from uuid import uuid4

import pytest

from benchmarks.orphans import CROSS, MARK, begun, marked
from confab.authoring import new_domain
from confab.cli import main


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel's part is Linux's")
@pytest.mark.parametrize("sign", [signal.SIGKILL, signal.SIGSEGV, signal.SIGINT])
def test_a_long_query_ends_with_its_command(
    sign: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    new_domain("tearoom", tmp_path)
    monkeypatch.setenv(MARK, mark := uuid4().hex)
    child = begun(lambda: main(["query", str(tmp_path / "tearoom-scene.ttl"), CROSS]))
    until = time.monotonic() + 20
    while (
        len(marked(mark)) < 2 and time.monotonic() < until
    ):  # the process with the graph, and its fork that evaluates the query
        time.sleep(0.02)
    assert len(marked(mark)) == 2
    os.kill(child, sign)
    os.waitpid(child, 0)
    until = time.monotonic() + 2
    while marked(mark) and time.monotonic() < until:
        time.sleep(0.02)
    assert marked(mark) == []
