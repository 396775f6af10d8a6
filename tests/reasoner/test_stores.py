"""A scene is the same in memory, on disk and behind an endpoint; a failing endpoint is reported in one sentence."""

import base64
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from urllib.parse import urlencode
from urllib.request import Request, urlopen

import pytest

from confab.planner.paper.hierarchy import plan
from confab.reasoner.generate import write_scene
from confab.reasoner.graph import stores
from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph, load
from confab.reasoner.graph.stores import RemoteEndpoint, connect, on_disk
from confab.reasoner.reading.problem import read
from confab.reasoner.reading.relevance import recognise
from confab.reasoner.vocabulary import CORE
from tests.reasoner.servers import free_port, oxigraph, rdflib_endpoint

PAPER = "https://w3id.org/confab/beverage-serving"


def files_of(*sources: str | Path) -> list[Path]:
    """Return the files of some scenes, each file once, including the files of reach facts."""
    found: dict[Path, None] = {}
    for source in sources:
        graph = load(source)
        found |= dict.fromkeys(graph.files.values())
        reach = graph.files[graph.scene].with_name(f"{graph.files[graph.scene].stem}.reach.ttl")
        found |= dict.fromkeys([reach] if reach.is_file() else [])
    return list(found)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scenes") / "table.ttl"
    write_scene(path, "served", clutter=40)
    return path


@pytest.fixture(scope="module")
def server(scene: Path) -> Iterator[str]:
    with oxigraph({"": files_of(scene)}) as url:
        yield url


def test_a_scene_behind_an_oxigraph_server_is_read_and_planned_as_from_files(server: str, scene: Path) -> None:
    graph = connect(server)
    assert graph.scene.endswith("generated/table")
    assert read(graph).problem == read(load(scene)).problem
    graph = connect(server)
    problem = recognise(graph).problem
    assert graph.round_trips <= 12
    assert problem == recognise(load(scene)).problem
    assert plan(problem).plan == plan(recognise(load(scene)).problem).plan


def test_a_scene_behind_rdflib_s_own_engine_is_read_as_from_files(tmp_path: Path) -> None:
    path = tmp_path / "table.ttl"
    write_scene(path, "swap", clutter=3)
    with rdflib_endpoint(files_of(path)) as url:
        graph = connect(url)
        problem = recognise(graph).problem
    assert problem == recognise(load(path)).problem
    assert graph.round_trips <= 12


def test_a_named_graph_per_ontology_lets_one_endpoint_hold_several_scenes(scene: Path) -> None:
    files = files_of("beverage-serving", scene)
    graphs = {next(iter(load_iri(file))): [file] for file in files}
    with oxigraph(graphs) as url:
        with pytest.raises(KnowledgeError, match=r"several scenes .*choose one \(scene=\)"):
            connect(url)
        with pytest.raises(KnowledgeError, match=r"no ontology <https://example.org/x> \(there are: .*tabletop"):
            connect(url, "https://example.org/x")
        assert read(connect(url, PAPER)).problem == read(load("beverage-serving")).problem


def load_iri(file: Path) -> list[str]:
    probe = KnowledgeGraph("")
    from confab.reasoner.graph.knowledge import read_into

    read_into(probe, file, "asserted")
    return [str(row[0].value) for row in probe.select("SELECT ?o { ?o a owl:Ontology }") if row[0]]


def test_every_form_of_query_is_answered(server: str) -> None:
    graph = connect(server)
    assert bool(graph.query("ASK { ?s a :Task }")) is True
    assert graph.select("SELECT ?task ?goal WHERE { ?task :goal ?goal } ORDER BY ?goal", task=f"{graph.scene}#task")
    assert graph.select("SELECT ?task ?goal WHERE { ?task :goal ?goal }", task=f"{graph.scene}#cup1") == []
    assert b"beverage" in graph.ntriples()
    with pytest.raises(KnowledgeError, match=r"not SPARQL 1.1 for this store.* It says: "):
        graph.select("SELECT nonsense")
    with pytest.raises(KnowledgeError, match="only read"):
        graph.add("inferred", [])


def test_a_scene_on_disk_is_loaded_once_and_again_when_a_file_changed(tmp_path: Path, scene: Path) -> None:
    path, folder = tmp_path / "scene.ttl", tmp_path / "store"
    write_scene(path, "served", clutter=5)
    first = on_disk(path, folder)
    whole = read(first).problem
    assert whole == read(load(path)).problem
    with pytest.raises(KnowledgeError, match="can't be used as a store"):
        on_disk(path, folder)
    first.store.extend([])
    del first
    begin = time.perf_counter()
    again = on_disk(path, folder)
    assert read(again).problem == whole
    assert again.prefixes == load(path).prefixes
    assert again.files == load(path).files
    assert time.perf_counter() - begin < 5
    del again
    write_scene(path, "served", clutter=6)
    assert len(read(on_disk(path, folder)).problem.classes["Movable"]) == 10


# --------------------------------------------------------------------------------------------------------- what goes wrong

GOOD = b'{"head":{"vars":["x"]},"results":{"bindings":[]}}'
Reply = Callable[[BaseHTTPRequestHandler, int], tuple[int, bytes]]


@contextmanager
def stub(reply: Reply) -> Iterator[str]:
    """Run a server with artificial answers: `reply` gets the request and its number."""
    seen: list[str] = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            self.rfile.read(int(self.headers["Content-Length"]))
            seen.append(self.path)
            try:
                status, body = reply(self, len(seen))
            except BrokenPipeError:  # the server has answered by itself
                self.close_connection = True
                return
            self.send_response(status)
            self.send_header("Content-Type", getattr(self, "kind", ""))
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            with suppress(BrokenPipeError):  # the client may have stopped waiting
                self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/query"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def ask(url: str, **options: float) -> list[object]:
    endpoint = RemoteEndpoint(url, timeout=options.get("timeout", 5.0), retries=int(options.get("retries", 3)))
    return list(endpoint.query("SELECT ?x { ?x ?y ?z }", {}, {}))  # type: ignore[arg-type]


def test_a_request_to_a_busy_server_is_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stores, "BACKOFF", 0.01)
    with stub(lambda _, number: (503, b"") if number < 3 else (200, GOOD)) as url:
        assert ask(url) == []
    with stub(lambda _, number: (503, b"later")) as url, pytest.raises(KnowledgeError, match=r"busy .*It says: later"):
        ask(url)


def test_a_request_is_repeated_after_a_lost_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stores, "BACKOFF", 0.01)

    def reply(request: BaseHTTPRequestHandler, number: int) -> tuple[int, bytes]:
        if number == 1:
            request.connection.shutdown(socket.SHUT_RDWR)
        return 200, GOOD

    with stub(reply) as url:
        assert ask(url) == []


def test_a_server_that_is_down_or_slow_is_reported() -> None:
    with pytest.raises(KnowledgeError, match=r"nothing answers there .*is the server running") as caught:
        ask(f"http://user:secret@127.0.0.1:{free_port()}/query", retries=0)
    assert "secret" not in str(caught.value)

    def slow(_: BaseHTTPRequestHandler, number: int) -> tuple[int, bytes]:
        time.sleep(0.5)
        return 200, GOOD

    with stub(slow) as url, pytest.raises(KnowledgeError, match=r"no answer within 0.1 s"):
        ask(url, timeout=0.1, retries=0)


@pytest.mark.parametrize(
    ("status", "body", "message"),
    [
        (401, b"", "CONFAB_SPARQL_AUTHORIZATION"),
        (404, b"", "often ends in /query or /sparql"),
        (500, b"broken", r"failed \(status 500\). It says: broken"),
        (200, b"<html>hello</html>", "no SPARQL 1.1 result"),
    ],
)
def test_a_wrong_answer_of_a_server_is_explained(status: int, body: bytes, message: str) -> None:
    with stub(lambda *_: (status, body)) as url, pytest.raises(KnowledgeError, match=message):
        ask(url)


def test_an_answer_in_another_form_of_results_is_read_by_its_media_type() -> None:
    xml = b"""<?xml version="1.0"?><sparql xmlns="http://www.w3.org/2005/sparql-results#"><head><variable name="x"/></head>
    <results><result><binding name="x"><uri>https://example.org/a</uri></binding></result></results></sparql>"""

    def says(kind: str, body: bytes) -> Reply:
        def reply(request: BaseHTTPRequestHandler, _: int) -> tuple[int, bytes]:
            request.kind = kind  # type: ignore[attr-defined]
            return 200, body

        return reply

    with stub(says("application/sparql-results+xml", xml)) as url:
        assert len(ask(url)) == 1
    for kind, body in (("application/sparql-results+xml", GOOD), ("text/html", b"<html>"), ("no type;;", xml)):
        with stub(says(kind, body)) as url, pytest.raises(KnowledgeError, match=r"no SPARQL 1.1 result"):
            ask(url)


@pytest.mark.parametrize("drops", [1, 9])
def test_an_answer_that_breaks_off_is_requested_again_and_then_reported(drops: int) -> None:
    def reply(request: BaseHTTPRequestHandler, number: int) -> tuple[int, bytes]:
        if number <= drops:
            request.send_response(200)
            request.send_header("Content-Length", "1000000")
            request.end_headers()
            request.wfile.write(GOOD)
            request.connection.shutdown(socket.SHUT_RDWR)
            raise BrokenPipeError
        return 200, GOOD

    with stub(reply) as url:
        if drops == 1:
            assert ask(url) == []
        else:
            with pytest.raises(KnowledgeError, match=r"(?i)incomplete"):
                ask(url, retries=2)


def test_an_answer_that_trickles_is_ended_by_the_time_limit() -> None:
    def reply(request: BaseHTTPRequestHandler, _: int) -> tuple[int, bytes]:
        request.send_response(200)
        request.end_headers()
        with suppress(OSError):
            for _ in range(600):
                request.wfile.write(b" ")
                time.sleep(0.05)
        raise BrokenPipeError

    begin = time.monotonic()
    with stub(reply) as url, pytest.raises(KnowledgeError, match=r"no answer within 0.2 s"):
        ask(url, timeout=0.2, retries=0)
    assert time.monotonic() - begin < 5


def test_data_that_change_while_they_are_read_are_never_used_for_planning(
    scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import confab

    with oxigraph({"": files_of(scene)}) as url:
        steady = confab.load(url)
        assert steady.plan().plan
        steady.query("SELECT (RAND() AS ?x) {}")  # a query of a user isn't repeated
        assert steady.plan().plan
        sent: list[bytes] = []
        post = RemoteEndpoint._post

        def meddled(self: RemoteEndpoint, body: bytes, accept: str) -> tuple[bytes, str]:
            sent.append(body)
            if len(sent) == 5:
                change = f"DELETE WHERE {{ ?task <{CORE}goal> ?goal }}"
                answer = urlopen(Request(url.replace("query", "update"), urlencode({"update": change}).encode()))
                assert answer.status == 204
            return post(self, body, accept)

        monkeypatch.setattr(RemoteEndpoint, "_post", meddled)
        with pytest.raises(KnowledgeError, match=r"changed since they were read; load the scene again"):
            confab.load(url).plan()
        with pytest.raises(KnowledgeError, match="no task with goals"):
            confab.load(url).plan()


def test_authentication_is_sent_and_never_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[str | None] = []

    def reply(request: BaseHTTPRequestHandler, _: int) -> tuple[int, bytes]:
        sent.append(request.headers["Authorization"])
        return 200, GOOD

    with stub(reply) as url:
        ask(url.replace("//", "//me:pass%20word@"))
        assert "pass" not in repr(RemoteEndpoint(url.replace("//", "//me:pass@")))
        monkeypatch.setenv("CONFAB_SPARQL_AUTHORIZATION", "Bearer token")
        with pytest.raises(KnowledgeError, match="there is no scene"):
            connect(url)
    assert sent == [f"Basic {base64.b64encode(b'me:pass word').decode()}", "Bearer token"]
