"""No process outlives the process that started it, and every process has its own limit."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from confab.reasoner.workers import LAUNCHER, WorkerError, call, end, start

SLEEP = "import subprocess, time; subprocess.Popen(['sleep', '60']); print('up', flush=True); time.sleep(60)"
PARENT = f"""
import ctypes, os, signal, subprocess, sys, threading, time
from confab.reasoner.workers import start
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores the signal in background jobs
found = []
def begin():
    found.append(start([sys.executable, "-c", {SLEEP!r}], stdout=subprocess.PIPE))
thread = threading.Thread(target=begin)  # which ends before the process that it starts
thread.start()
thread.join()
found[0].stdout.readline()
print(found[0].pid, flush=True)
if sys.argv[1] == "crash":
    ctypes.string_at(0)
elif sys.argv[1] == "abort":
    os.abort()
elif sys.argv[1] == "exit":
    sys.exit()
time.sleep(60)
"""


def group(number: int) -> list[str]:
    """Return the running processes of a group."""
    listed = subprocess.run(["ps", "-eo", "pgid=,stat=,args="], capture_output=True, text=True, check=True).stdout
    rows = (line.split(None, 2) for line in listed.splitlines())
    return [row[2] for row in rows if row[0] == str(number) and not row[1].startswith("Z")]


def ended(number: int) -> bool:
    """Return whether a group ends within two seconds."""
    for _ in range(40):
        if not group(number):
            return True
        time.sleep(0.05)
    return False


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel's part is Linux's")
@pytest.mark.parametrize("how", ["kill", "crash", "abort", "exit", "ctrl-c"])
def test_a_process_and_its_children_end_when_its_parent_ends_in_any_way(how: str) -> None:
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, how], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert parent.stdout is not None
    number = int(parent.stdout.readline())
    if how in ("kill", "ctrl-c"):
        assert len(group(number)) == 2
        parent.send_signal(signal.SIGKILL if how == "kill" else signal.SIGINT)
    parent.communicate(timeout=20)
    assert ended(number)


def test_ending_a_process_ends_all_its_children() -> None:
    process = start([sys.executable, "-c", SLEEP], stdout=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.readline()
    end(process)
    assert ended(process.pid)
    end(process)  # a second call does nothing


def test_a_command_with_an_already_closed_pipe_never_begins(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.close(writing)
    command = [sys.executable, "-ISs", LAUNCHER, str(reading), "1", "touch", str(tmp_path / "begun")]
    done = subprocess.run(command, pass_fds=[reading], start_new_session=True, check=False)
    os.close(reading)
    assert done.returncode == 1
    assert not (tmp_path / "begun").exists()


def endless(_: object = None) -> None:
    while True:
        pass


def test_every_process_has_a_limit_of_cpu_time_and_memory() -> None:
    with pytest.raises(WorkerError) as late:
        call(endless, seconds=0.0)
    assert late.value.late
    with pytest.raises(WorkerError) as large:
        call(bytearray, 10**10, megabytes=500)
    assert large.value.too_large
    with pytest.raises(subprocess.TimeoutExpired):
        call(time.sleep, 60, timeout=0.3)


def test_a_call_has_the_result_or_error_of_its_function_and_prints_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    assert call(sorted, [2, 1]) == [1, 2]
    assert call(print, "aside") is None
    with pytest.raises(KeyError, match="'b'"):
        call(dict.__getitem__, {"a": 1}, "b")
    assert capfd.readouterr().out == ""


def test_a_missing_command_gives_an_exit_code(tmp_path: Path) -> None:
    process = start([str(tmp_path / "none")], stderr=subprocess.PIPE)
    said = process.communicate()[1]
    assert process.returncode and b"No such file" in said


def test_a_thread_may_end_before_the_process_that_it_started() -> None:
    found: list[subprocess.Popen[bytes]] = []
    thread = threading.Thread(target=lambda: found.append(start(["sleep", "60"])))
    thread.start()
    thread.join()
    time.sleep(0.1)
    assert found[0].poll() is None
    end(found[0])
