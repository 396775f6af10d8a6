"""The effect of each command on an existing file at its output path: a table for docs/figures/promises.md.

python -m benchmarks outputs

For each output of each command, a file of each kind is put at the output path before the command runs.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from functools import cache
from http.server import BaseHTTPRequestHandler, HTTPServer
from io import StringIO
from itertools import pairwise
from pathlib import Path
from shutil import copy, copytree
from threading import Thread

from confab.authoring import new_domain
from confab.cli import main as confab
from confab.history import RECORD, record
from confab.page.data import page_data
from confab.reasoner.kinds import (
    CONSTRUCTED,
    CONVERTED,
    DOMAIN,
    EPISODE,
    FILM,
    GENERATED,
    IMPORTED,
    MEMORY,
    OBSERVED,
    PICTURE,
    PLAN,
    PROBLEM,
    REPORT,
    ROWS,
    RUN,
    TRAJECTORIES,
    TREE,
    TRIPLES,
    VERDICTS,
)
from confab.reasoner.vocabulary import OWL
from confab.scene import load

SCENE, FOLDER = "tearoom-scene.ttl", "HERE"
"""The scene of the commands, and the word that stands for their folder."""
COLUMNS = "SELECT ?thing WHERE { ?thing a owl:NamedIndividual } ORDER BY ?thing"
CONSTRUCTION = "CONSTRUCT WHERE { ?thing a owl:NamedIndividual }"


@dataclass(frozen=True)
class Door:
    """An output of a command.

    Parameters
    ----------
    call : str
        The words of the call, with OUT for the output file.
    file : str
        The name of the output file.
    kind : str
        The kind of the output file.
    physics : bool
        Whether the command executes a rollout. For such commands, only refusals are tried, since rollouts are slow.
    new : bool
        Whether the command replaces no existing file, not even an earlier output.
    """

    call: str
    file: str
    kind: str
    physics: bool = False
    new: bool = False

    @property
    def name(self) -> str:
        """The name of the command with its option."""
        command, *words = self.call.split()
        middle = [word for word in words if word in ("merge", "trust", "migrate")]
        into = [f"{option} {'' if place == 'OUT' else Path(self.file).name}".strip() for option, place in pairwise(words)
                if option.startswith("-") and place in ("OUT", FOLDER, "into")]  # fmt: skip
        return " ".join([command, *middle, *into])


DOORS = (
    Door(f"plan {SCENE} --report OUT", "out.html", REPORT),
    Door(f"plan {SCENE} -o OUT", "out.json", PLAN),
    *(
        Door("run one-arm-serving --memory memory.ttl -o HERE", file, kind, physics=True)
        for file, kind in {
            "plan.json": PLAN,
            "report.html": REPORT,
            "verify.json": VERDICTS,
            "observed.ttl": OBSERVED,
            "run.mp4": FILM,
            RECORD: RUN,
        }.items()
    ),
    Door("run one-arm-serving --memory OUT -o kept", "out.ttl", MEMORY, physics=True),
    Door(f"report {SCENE} -o OUT", "out.html", REPORT),
    Door("runs kept -o OUT", "out.html", REPORT),
    Door("verify one-arm-serving plan.json -o OUT", "out.json", VERDICTS, physics=True),
    Door("verify one-arm-serving plan.json --video OUT", "out.mp4", FILM, physics=True),
    Door("verify one-arm-serving plan.json --memory OUT", "out.ttl", MEMORY, physics=True),
    Door(f"execute {SCENE} --save OUT", "out.ttl", EPISODE),
    Door(f"execute {SCENE} --report OUT", "out.html", REPORT),
    Door(f"execute {SCENE} --learn --memory OUT", "out.ttl", MEMORY),
    Door(f"explain {SCENE} --memory memory.ttl --plot OUT", "out.png", PICTURE),
    Door(f"query {SCENE} QUERY -o OUT", "out.csv", ROWS),
    Door(f"query {SCENE} CONSTRUCT --format turtle -o OUT", "out.txt", TRIPLES),
    Door(f"query {SCENE} CONSTRUCT -o OUT", "out.ttl", CONSTRUCTED),
    Door(f"learn {SCENE} --memory OUT", "out.ttl", MEMORY),
    Door(f"learn {SCENE} --memory other.ttl --rounds 1 --plot OUT", "out.png", PICTURE),
    Door("memory merge memory.ttl -o OUT", "out.ttl", MEMORY),
    Door("memory trust OUT all", "out.ttl", MEMORY),
    Door("memory migrate OUT B1_CARRY=B1_BRING", "out.ttl", MEMORY),
    Door(f"picture {SCENE} --classes -o OUT", "out.png", PICTURE),
    Door("generate served -o OUT", "out.ttl", GENERATED),
    Door("convert tearoom.ttl --behaviors sparql -o OUT", "out.ttl", CONVERTED),
    Door("import domain.pddl problem.pddl -o OUT", "out.ttl", IMPORTED),
    Door(f"export {SCENE} -o HERE", "domain.pddl", DOMAIN),
    Door(f"export {SCENE} -o HERE", "problem.pddl", PROBLEM),
    Door(f"export {SCENE} --bt -o HERE", "tree.xml", TREE),
    Door(f"export {SCENE} --bt -o HERE", "tree.py", TREE),
    Door("export one-arm-serving --trajectory -o OUT", "out.json", TRAJECTORIES, physics=True),
    Door("new workshop -o into", "into/workshop.ttl", "a new domain", new=True),
    Door("new workshop -o into", "into/workshop-scene.ttl", "a new scene", new=True),
    Door("new workshop -o into", "into/catalog-v001.xml", "a new catalog", new=True),
    Door("fetch ADDRESS -o HERE", "fetched.ttl", "a fetched ontology", new=True),
)
MADE = {  # the commands that create the files of each kind
    MEMORY: f"learn {SCENE} --memory memory.ttl",
    PLAN: f"plan {SCENE} -o plan.json",
    EPISODE: f"execute {SCENE} --save episode.ttl",
    REPORT: f"plan {SCENE} --report report.html",
    GENERATED: "generate served -o generated.ttl",
    DOMAIN: f"export {SCENE} -o .",
}
FILES = {
    "scene": SCENE,
    "ontology": "tearoom.ttl",
    "memory": "memory.ttl",
    "plan": "plan.json",
    "episode": "episode.ttl",
}
FILES |= {"report": "report.html", "generated": "generated.ttl", "edited": "edited.ttl"}
LINKS = ("link", "hard link")
"""Kinds of links to the scene that the command reads."""
OTHERS = ("folder", "pipe", "read-only", "its own", "empty", "none")
THERE = (*FILES, *LINKS, *OTHERS)
KIND_OF = {"memory": MEMORY, "plan": PLAN, "episode": EPISODE, "report": REPORT, "generated": GENERATED}


@contextmanager
def inside(folder: Path) -> Iterator[None]:
    """Change the working directory until the end of the block."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def call(words: str) -> int:
    """Run a command in this process and return its exit code."""
    said = {"QUERY": COLUMNS, "CONSTRUCT": CONSTRUCTION, FOLDER: "."}
    if "ADDRESS" in words:
        said["ADDRESS"] = f"http://127.0.0.1:{web().server_port}/fetched"
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        try:
            confab([said.get(word, word) for word in words.split()])
        except SystemExit as end:
            return int(end.code or 0)
    return 0


class Ontologies(BaseHTTPRequestHandler):
    """Request handler that answers every request with an ontology whose IRI is the requested address."""

    def do_GET(self) -> None:
        """Respond with an ontology."""
        self.send_response(200)
        self.send_header("Content-Type", "text/turtle")
        self.end_headers()
        self.wfile.write(f"<http://{self.headers['Host']}{self.path}> a <{OWL}Ontology> .\n".encode())

    def log_message(self, format: str, *args: object) -> None:
        """Discard log messages."""


@cache
def web() -> HTTPServer:
    """Return a local HTTP server of ontologies."""
    server = HTTPServer(("127.0.0.1", 0), Ontologies)
    Thread(target=server.serve_forever, daemon=True).start()
    return server


def prepare(folder: Path) -> None:
    """Write a scene and a file of every kind into a folder."""
    new_domain("tearoom", folder)
    with inside(folder):
        for words in MADE.values():
            if code := call(words):
                raise RuntimeError(f"'{words}' ends with {code}")
        Path("edited.ttl").write_text(Path("generated.ttl").read_text().replace("@prefix", "# mine\n@prefix", 1))
        os.mkfifo("pipe")
        Path("folder").mkdir()
        Path("into").mkdir()
        Path("kept/001").mkdir(parents=True)
        loaded = load(SCENE)
        record(Path("kept/001"), page_data(loaded, loaded.plan()), {}, "")


def answers(door: Door, whole: Path, there: tuple[str, ...] = THERE) -> Iterator[tuple[str, str]]:
    """Yield the result of a command for each kind of existing file, which is ``refused``, ``replaced``, ``made`` or a fault."""
    for what in there:
        if door.physics and (what in ("its own", "empty", "none") or KIND_OF.get(what) == door.kind):
            continue
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name) / "here"
            copytree(whole, folder, ignore=lambda *_: ["pipe"])
            with inside(folder):
                yield what, _answer(door, what)


def _answer(door: Door, what: str) -> str:
    out = Path(door.file)
    words = door.call.replace("OUT", door.file)
    own = what in ("its own", "read-only")
    if own and door.physics:
        out.write_text("another's")
    elif own and door.kind == MEMORY and "learn" not in door.call.split()[0] and "merge" not in door.call:
        _put("memory", out)  # these commands change an existing memory
    elif own:
        call(words)
    else:
        _put(what, out)
    if what == "read-only":
        out.chmod(0o444)
    before = _state(out)
    code = call(words)
    after = _state(out)
    if code == 2:
        return "refused" if after == before else f"exit 2, but {out} was changed"
    if after == before and what != "its own":
        return f"exit {code}, and {out} stays"
    return f"exit {code}" if code else "made" if before is None else "replaced"


def _put(what: str, out: Path) -> None:
    """Put a file, link, folder or pipe at the output path of a command."""
    with suppress(FileNotFoundError):
        out.unlink()
    if what in FILES:
        copy(FILES[what], out)
    elif what == "link":
        out.symlink_to(Path(SCENE).absolute())
    elif what == "hard link":
        out.hardlink_to(SCENE)
    elif what == "folder":
        out.mkdir()
    elif what == "pipe":
        os.mkfifo(out)
    elif what == "empty":
        out.touch()


def _state(file: Path) -> tuple[int, bytes | None] | None:
    """Return the identity and the content of a file."""
    if not os.path.lexists(file):
        return None
    return file.lstat().st_ino, file.read_bytes() if file.is_file() else None


def main() -> int:
    """Print the table; return 1 if a result is neither a refusal, a replacement nor a new file."""
    wrong = 0
    print("| command and output | writes | replaces, or makes | refuses |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        prepare(Path(name))
        for door in DOORS:
            found = dict(answers(door, Path(name)))
            wrong += sum(answer not in ("refused", "replaced", "made") for answer in found.values())
            yes = [what for what, answer in found.items() if answer != "refused"]
            no = [what for what, answer in found.items() if answer == "refused"]
            print(
                f"| `{door.name}` | {door.kind} | {', '.join(yes) or 'not tried: physics'} | {', '.join(no)} |",
                flush=True,
            )
            for what, answer in found.items():
                if answer not in ("refused", "replaced", "made"):
                    print(f"{door.call}: {what}: {answer}", file=sys.stderr)
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
