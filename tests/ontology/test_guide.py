"""The authoring guide followed to the letter in an empty folder."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "authoring.md"
BLOCK = re.compile(r"^```(turtle|console)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.slow
def test_the_authoring_guide_works_as_it_stands(tmp_path: Path) -> None:
    said = []
    for kind, where, content in BLOCK.findall(GUIDE.read_text(encoding="utf-8")):
        if kind == "turtle":
            name, *more = where.split()
            file = tmp_path / name
            file.write_text((file.read_text() if more else "") + content)
            continue
        for line in content.splitlines():
            command, *arguments = shlex.split(line.removeprefix("$ "))
            assert command == "confab"
            call = [sys.executable, "-c", "from confab.cli import main; main()", *arguments]
            done = subprocess.run(call, capture_output=True, text=True, cwd=tmp_path)
            said.append(f"$ confab {' '.join(arguments)}\n{done.stdout}")
            assert done.returncode == 0, done.stdout + done.stderr
    text = "\n".join(said)
    print(text)
    assert text.count("nothing is wrong") == 3
    assert "verified" in text
    assert "T1_TIDY toy1 location6" in text
    assert "T1_TAKE_OUT toy2 location2" in text
    assert "the plan is the same" in text
