"""Faults that were found by hand, with the present answers; each case is built from shipped files and run as a command.

python -m benchmarks.found    print the table of docs/figures/promises.md; exit with 1 on an unexpected answer
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from confab.authoring import new_domain
from confab.memory import Memory
from confab.scene import load

START = "from confab.cli import main; import sys; main(sys.argv[1:])"
RDF = 'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"'
FEW = 3_000_000
"""Maximum address space of a command in kilobytes."""
Case = tuple[str, str, tuple[int, ...]]
"""Description of the input, the command line, and the allowed exit codes."""


def bomb(before: str = "") -> str:
    """Return RDF/XML with nested entities, whose expansion doubles thirty times."""
    entities = '<!ENTITY a0 "x">' + "".join(f'<!ENTITY a{i} "&a{i - 1};&a{i - 1};">' for i in range(1, 31))
    return f'<?xml version="1.0"?>{before}<!DOCTYPE r [{entities}]><rdf:RDF {RDF}><x>&a30;</x></rdf:RDF>'


def cases(folder: Path) -> Iterator[Case]:
    """Write the files, and yield the cases."""

    def file(name: str, text: str) -> str:
        (folder / name).write_text(text, encoding="utf-8")
        return name

    def tea(part: str, old: str, new: str) -> str:
        place = folder / f"case{len(list(folder.iterdir()))}"
        new_domain("tearoom", place)
        broken = place / f"tearoom{part}.ttl"
        assert old in broken.read_text()
        broken.write_text(broken.read_text().replace(old, new, 1))
        return f"{place.name}/tearoom-scene.ttl"

    scene = load("living-room")
    for name, replica in (("m.ttl", "me"), ("odd.ttl", "robot 1;\r\n")):
        memory = Memory.of(scene)
        memory.experience.replica = replica
        memory.teach(scene, scene.plan())
        memory.save(folder / name)
    yield "1 a replica with a blank and a line's end in its name is merged", "memory merge m.ttl odd.ttl -o m.ttl", (0,)
    yield "1 … and the memory learns", "learn living-room --memory m.ttl", (0,)
    yield "1 … and is read", "memory show m.ttl --most 1", (0,)
    yield "2 entities that double themselves", f"validate {file('bomb.owl', bomb())}", (1,)
    yield "2 … behind a comment that looks like the root", f"plan {file('behind.owl', bomb('<!-- <rdf:RDF -->'))}", (2,)
    (folder / "link.ttl").symlink_to("m.ttl")
    yield "3 learning through a link", "learn living-room --memory link.ttl", (0,)
    yield "3 … the link's target has learned", "memory show m.ttl --most 1", (0,)
    yield "4 10,000 objects with a limit of one second", "generate served --objects 10000 -o large.ttl", (0,)
    yield "4 …", "plan large.ttl --time-limit 1", (3,)
    yield "5 a text in place of an individual", "plan " + tea("-scene", "d:isAt :table", 'd:isAt "table"'), (2,)
    for old, new in (("c:index 1", 'c:index "one"'), ("c:level 1", "c:level 1.5"), ("c:level 1", "c:level 0")):
        yield f"5 {new}", f"plan {tea('', old, new)}", (2,)
    for cost in ('"x"', "-1", '"NaN"^^<http://www.w3.org/2001/XMLSchema#double>'):
        yield (
            f"5 c:cost {cost[:5]}",
            f"plan {tea('', 'c:level 1', f'c:level 1 ; c:cost {cost}')} --optimal --json",
            (2,),
        )
    circle = tea("", ":B1_CARRY.free ;", ":N . :N a c:AnyOf ; c:alternative :N . :B1_CARRY")
    yield "5 a condition that contains itself", f"plan {circle}", (2,)
    yield "5 … validated", f"validate {circle}", (1,)
    yield "5 a triple about a triple", f"plan {tea('-scene', 'd:isAt :table', 'd:isAt <<( :a :b :c )>>')}", (2,)
    for name in ("µCup", "Cup²"):
        place = (folder / tea("", ":Place ", ":Place ")).parent
        for part in place.glob("*.ttl"):
            part.write_text(re.sub(r"(?<!\w)d?:Place\b", f"<https://example.org/tearoom#{name}>", part.read_text()))
        yield f"5 a class called {name}", f"plan {place.name}/tearoom-scene.ttl", (0,)
    for name, text in (("5", '{"steps": 5}'), ("deep", "[" * 100_000), ("long", f'{{"steps": [{"9" * 5000}]}}')):
        yield f"5 an invalid plan ({name})", f"execute living-room --plan {file(f'{name}.json', text)}", (2,)
    yield "5 a name with a blank", "execute living-room --save ep_1.ttl", (0,)
    yield "5 an invalid address", "plan http://[bad", (2,)
    braces = "{" * 3000 + "}" * 3000
    yield "6 3,000 nested braces", f"query living-room SELECT_*_WHERE_{braces}", (2,)
    yield "6 an unbounded cross product", "query living-room SELECT_*_WHERE_{?a_?b_?c_._?d_?e_?f_._?g_?h_?i}", (3,)
    yield "6 SERVICE", "query living-room SELECT_*_WHERE_{SERVICE_<http://127.0.0.1:9/>_{?a_?b_?c}}", (2,)
    same = tea("-scene", "d:isAt :table", "owl:sameAs :table ; d:isAt :table")
    yield "7 two objects related by owl:sameAs", f"validate {same}", (1,)
    counts = (folder / "m.ttl").read_text().replace(":episodes ", ":episodes -")
    yield "7 a negative count", f"memory show {file('negative.ttl', counts)}", (2,)
    yield "8 a scene name with a control character", "plan \x1b[2J", (2,)


def main() -> int:
    """Print the table."""
    wrong = 0
    print("| what broke | exit | what it answers now |\n|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for what, line, foreseen in cases(folder):
            words = [word.replace("_", " ") if "WHERE" in word or "ep_1" in word else word for word in line.split(" ")]
            call = ["bash", "-c", f'ulimit -v {FEW}; exec "$@"', "-", sys.executable, "-c", START, *words]
            ended = subprocess.run(
                call, cwd=folder, capture_output=True, text=True, check=False, timeout=300, errors="replace"
            )
            said = (
                [one for one in ended.stderr.splitlines() if one.startswith("confab: ")]
                or ended.stdout.splitlines()
                or [""]
            )
            fine = ended.returncode in foreseen and "Traceback" not in ended.stdout + ended.stderr
            wrong += not fine
            answer = said[0].removeprefix("confab: ").replace(f"{folder.resolve()}/", "").replace("|", "\\|")
            print(f"| {what} | {ended.returncode}{'' if fine else ' **not foreseen**'} | {answer[:150]} |", flush=True)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
