"""A scene served on loopback: clients get answers according to the SPARQL 1.1 protocol, and no request harms the server."""

import asyncio
import http.client
import json
import random
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep
from urllib.parse import urlencode

import pytest
import rdflib
import urllib3
from rdflib.plugins.stores.sparqlstore import SPARQLStore

import confab
from confab.reasoner.graph.query_process import QueryLimits
from confab.serving import AT_ONCE, LANES, Server, Service, serving

CUPS = "SELECT ?cup ?where WHERE { ?cup a k:Cup ; k:location ?where } ORDER BY ?cup"
CUP1 = "https://w3id.org/confab/beverage-serving#cup1"
ASSERTED = "urn:confab:graph:asserted"
TURNED = {"facts": {"cup1 LOCATION": "location7"}}
FORM = "application/x-www-form-urlencoded"


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with serving(confab.load("beverage-serving"), 0, QueryLimits(seconds=5, rows=5000)) as served:
        yield served


@pytest.fixture
def pool() -> Iterator[urllib3.PoolManager]:
    with urllib3.PoolManager(retries=False) as manager:
        yield manager


def test_the_three_kinds_of_request_of_the_protocol_have_the_same_answer(
    server: Server, pool: urllib3.PoolManager
) -> None:
    url = server.url + "sparql"
    answers = [
        pool.request("GET", f"{url}?{urlencode({'query': CUPS})}"),
        pool.request("POST", url, body=urlencode({"query": CUPS}), headers={"Content-Type": FORM}),
        pool.request("POST", url, body=CUPS, headers={"Content-Type": "application/sparql-query; charset=utf-8"}),
    ]
    for answer in answers:
        assert answer.status == 200
        assert answer.headers["Content-Type"] == "application/sparql-results+json"
        assert answer.json()["results"]["bindings"][0]["cup"] == {"type": "uri", "value": CUP1}
    assert pool.request("HEAD", f"{url}?{urlencode({'query': CUPS})}").data == b""


@pytest.mark.parametrize(
    ("accept", "kind", "holds"),
    [
        ("application/sparql-results+xml", "application/sparql-results+xml", b"<uri>"),
        ("text/csv", "text/csv", b"cup,where\r\n"),
        ("text/tab-separated-values", "text/tab-separated-values", b"?cup\t?where\n<https"),
        ("text/csv;q=0.1, application/sparql-results+json", "application/sparql-results+json", b'"bindings"'),
        ("text/html, */*;q=0.1", "application/sparql-results+json", b'"bindings"'),
    ],
)
def test_rows_have_the_format_that_the_client_prefers(
    server: Server, pool: urllib3.PoolManager, accept: str, kind: str, holds: bytes
) -> None:
    answer = pool.request("GET", f"{server.url}sparql?{urlencode({'query': CUPS})}", headers={"Accept": accept})
    assert (answer.status, answer.headers["Content-Type"]) == (200, kind)
    assert holds in answer.data


def test_ask_and_construct_queries_are_answered(server: Server, pool: urllib3.PoolManager) -> None:
    asked = pool.request("GET", f"{server.url}sparql?{urlencode({'query': 'ASK { :cup1 a k:Cup }'})}")
    assert asked.json()["boolean"] is True
    built = f"{server.url}sparql?{urlencode({'query': 'CONSTRUCT WHERE { :cup1 ?p ?o }'})}"
    for accept, form in (("*/*", "turtle"), ("application/n-triples", "nt"), ("application/rdf+xml", "xml")):
        answer = pool.request("GET", built, headers={"Accept": accept})
        assert (rdflib.URIRef(CUP1), rdflib.RDFS.label, None) in rdflib.Graph().parse(data=answer.data, format=form)
    assert pool.request("GET", built, headers={"Accept": "text/csv"}).status == 406


def test_the_server_describes_itself_if_a_request_has_no_query(server: Server, pool: urllib3.PoolManager) -> None:
    answer = pool.request("GET", server.url + "sparql", headers={"Accept": "text/turtle"})
    said = rdflib.Graph().parse(data=answer.data, format="turtle")
    service = rdflib.Namespace("http://www.w3.org/ns/sparql-service-description#")
    assert (None, service.endpoint, rdflib.URIRef(server.url + "sparql")) in said
    assert (None, service.supportedLanguage, service.SPARQL11Query) in said


def test_rdflibs_own_client_is_answered(server: Server) -> None:
    remote = rdflib.Graph(SPARQLStore(server.url + "sparql", returnFormat="json"))
    cup1 = rdflib.URIRef(CUP1)
    assert str(remote.value(cup1, rdflib.RDFS.label)) == "cup 1"
    assert len(list(remote.query("SELECT ?b WHERE { ?b a <https://w3id.org/confab/core#Behavior> }"))) == 12
    assert len(remote) > 500


def test_the_first_query_of_protege_is_answered(server: Server, pool: urllib3.PoolManager) -> None:
    asked = """PREFIX rdf: <http://www.w3.org/1999/02/22-rdf-syntax-ns#>
PREFIX owl: <http://www.w3.org/2002/07/owl#>
PREFIX rdfs: <http://www.w3.org/2000/01/rdf-schema#>
PREFIX xsd: <http://www.w3.org/2001/XMLSchema#>
SELECT ?subject ?object
\tWHERE { ?subject rdfs:subClassOf ?object }"""
    for accept in ("application/sparql-results+xml", "application/sparql-results+json"):
        answer = pool.request(
            "POST",
            server.url + "sparql",
            body=urlencode({"query": asked}),
            headers={"Content-Type": FORM, "Accept": accept},
        )
        assert answer.data.count(b"https://w3id.org/confab/tabletop#Bottle") >= 1


def test_a_scene_behind_the_server_can_be_loaded_and_planned(server: Server) -> None:
    there = confab.load(server.url + "sparql", scene="https://w3id.org/confab/beverage-serving")
    assert there.plan().plan.length == {1: 4, 2: 10, 3: 32}


@pytest.mark.parametrize(
    ("method", "path", "body", "kind", "status"),
    [
        ("GET", "sparql?query=SELEKT", None, None, 400),
        ("GET", "sparql?query=SELECT+*+{}&query=ASK+{}", None, None, 400),
        ("GET", "sparql?query=%ff", None, None, 400),
        ("GET", "sparql?update=CLEAR+ALL", None, None, 403),
        ("POST", "sparql", "update=CLEAR+ALL", FORM, 403),
        ("POST", "sparql", "CLEAR ALL", "application/sparql-update", 403),
        ("POST", "sparql", "INSERT DATA { <a:a> <a:a> <a:a> }", "application/sparql-query", 400),
        ("POST", "sparql", "{}", "application/json", 415),
        ("POST", "sparql", "", FORM, 400),
        ("GET", "nothing", None, None, 404),
        ("PUT", "sparql", "x", "text/turtle", 405),
        ("GET", "sparql?query=SELECT+*+{SERVICE+<http://127.0.0.1:9/>{?a+?b+?c}}", None, None, 400),
        ("GET", "sparql?query=SELECT+*+WHERE{?a+?b+?c.?d+?e+?f}", None, None, 500),
        ("GET", "sparql?query=SELECT+*+" + "{" * 3000 + "}" * 3000, None, None, 400),
    ],
)
def test_a_refused_request_has_a_status_and_one_line(
    server: Server, pool: urllib3.PoolManager, method: str, path: str, body: str | None, kind: str | None, status: int
) -> None:
    headers = {"Content-Type": kind} if kind else {}
    answer = pool.request(method, server.url + path, body=body, headers=headers)
    assert answer.status == status, answer.data
    assert answer.data.count(b"\n") == 1
    assert b"Traceback" not in answer.data


def test_only_requests_of_this_machine_are_answered(server: Server, pool: urllib3.PoolManager) -> None:
    url = f"{server.url}sparql?{urlencode({'query': CUPS})}"
    assert pool.request("GET", url, headers={"Host": "evil.example"}).status == 421
    asked = {"Origin": "http://localhost:8080", "Access-Control-Request-Method": "POST"}
    near = pool.request("OPTIONS", url, headers=asked)
    assert (near.status, near.headers["Access-Control-Allow-Origin"]) == (200, "http://localhost:8080")


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Origin": "https://evil.example"}, 403),
        ({"Origin": "http://localhost.evil.example"}, 403),
        ({"Origin": "http://[bad"}, 403),
        ({"Origin": "null"}, 403),
        ({"Sec-Fetch-Site": "cross-site"}, 403),
        ({"Sec-Fetch-Site": "cross-site", "Origin": "http://localhost:8080"}, 200),
        ({"Sec-Fetch-Site": "same-site", "Origin": "http://127.0.0.1:8080"}, 200),
        ({"Sec-Fetch-Site": "same-origin"}, 200),
        ({"Sec-Fetch-Site": "none"}, 200),
    ],
)
def test_pages_of_other_sites_are_refused(
    server: Server, pool: urllib3.PoolManager, headers: dict[str, str], status: int
) -> None:
    url = f"{server.url}sparql?{urlencode({'query': CUPS})}"
    assert pool.request("GET", url, headers=headers).status == status
    assert pool.request("POST", server.url + "sparql", fields={"query": CUPS}, headers=headers).status in (403, 415)


@pytest.mark.parametrize(
    ("request_head", "status"),
    [
        ("GET http://[bad/sparql HTTP/1.1\r\nHost: localhost", 421),
        ("GET http://evil.example/sparql HTTP/1.1\r\nHost: localhost", 421),
        ("GET http://localhost/page.json HTTP/1.1\r\nHost: evil.example", 200),
        ("GET nowhere HTTP/1.1\r\nHost: localhost", 400),
        (f"POST /sparql HTTP/1.1\r\nHost: localhost\r\nContent-Length: {'9' * 5000}", 400),
        ("POST /sparql HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999", 413),
        ("POST /sparql HTTP/1.1\r\nHost: localhost\r\nContent-Length: -5", 400),
        ("GET /sparql?default-graph-uri=a%20b&query=ASK%7B%7D HTTP/1.1\r\nHost: localhost", 400),
        ("GET /sparql HTTP/1.1\r\nHost: localhost\r\nHost: localhost", 400),
        ("GET /sparql HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade", 200),
        ("GET /%00%ff HTTP/1.1\r\nHost: localhost", 404),
    ],
)
def test_malformed_requests_have_a_status_and_leave_nothing_in_the_log(
    server: Server, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str], request_head: str, status: int
) -> None:
    assert status_of(server, f"{request_head}\r\n\r\n".encode()) == status
    assert (caplog.text, *capfd.readouterr()) == ("", "", "")


def status_of(server: Server, request: bytes) -> int:
    with socket.create_connection(("127.0.0.1", server.port), timeout=10.0) as client:
        client.sendall(request)
        return int(client.recv(12).split()[1])


HEAVY = "SELECT (COUNT(*) AS ?n) WHERE { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i FILTER(?c != ?d && ?f != ?g) }"


def sent(server: Server, query: str) -> socket.socket:
    client = socket.create_connection(("127.0.0.1", server.port), timeout=30.0)
    client.sendall(f"GET /sparql?{urlencode({'query': query})} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
    return client


def running(server: Server) -> int:
    return sum(AT_ONCE - lane.qsize() for lane in server.service.lanes)


def test_a_client_that_leaves_ends_its_query(server: Server) -> None:
    client = sent(server, HEAVY)
    until(lambda: running(server) == 1)
    client.close()
    until(lambda: running(server) == 0)


def test_a_worker_is_free_only_after_its_query_has_ended_even_if_the_client_left() -> None:
    begun, ended = threading.Event(), threading.Event()

    def slow(_: object) -> None:
        begun.set()
        ended.wait(5.0)

    async def left() -> tuple[int, int]:
        service = Service(confab.load("beverage-serving"), QueryLimits())
        client = asyncio.create_task(service.run(slow))
        await asyncio.to_thread(begun.wait)
        await asyncio.sleep(2 * LANES[0])  # the first time limit has passed
        client.cancel()
        await asyncio.gather(client, return_exceptions=True)
        busy = service.lanes[0].qsize()
        ended.set()
        await asyncio.sleep(0.2)
        service.close()
        return busy, service.lanes[0].qsize()

    assert asyncio.run(left()) == (AT_ONCE - 1, AT_ONCE)


def until(condition: Callable[[], bool]) -> None:
    begin = monotonic()
    while not condition():
        assert monotonic() - begin < 4.0, "it didn't come in time"
        sleep(0.01)


def test_short_queries_do_not_wait_for_long_ones_whose_clients_stay(
    pool: urllib3.PoolManager,
) -> None:
    with serving(confab.load("living-room"), 0) as served:
        patient = [sent(served, HEAVY) for _ in range(8)]
        url = f"{served.url}sparql?{urlencode({'query': 'ASK {}'})}"
        assert all(pool.request("GET", url, timeout=5.0).json()["boolean"] for _ in range(5))
        assert pool.request("GET", served.url + "page.json", timeout=5.0).status == 200
        for client in patient:
            client.close()


@pytest.mark.parametrize(
    ("fields", "answer"),
    [
        ({"query": "ASK FROM <urn:confab:graph:asserted> { :cup1 a k:Cup }"}, True),
        ({"query": "ASK FROM <urn:confab:graph:memory> { :cup1 a k:Cup }"}, False),
        ({"query": "ASK FROM NAMED <urn:confab:graph:asserted> { :cup1 a k:Cup }"}, False),
        ({"query": "ASK FROM NAMED <urn:confab:graph:asserted> { GRAPH ?g { :cup1 a k:Cup } }"}, True),
        ({"query": "ASK from # a comment\n<urn:confab:graph:memory> { ?from ?a 'FROM <x:y>' }"}, False),
        ({"query": "PREFIX g: <urn:confab:graph:> ASK FROM g:asserted { :cup1 a k:Cup }"}, True),
        ({"query": "ASK FROM <https://example.org/> { :cup1 a k:Cup }"}, 400),
        ({"query": "ASK FROM <relative> { :cup1 a k:Cup }"}, 400),
        ({"query": "ASK { :cup1 a k:Cup }", "default-graph-uri": "urn:confab:graph:memory"}, False),
        ({"query": "ASK FROM <urn:confab:graph:memory> {:cup1 a k:Cup}", "default-graph-uri": ASSERTED}, True),
        ({"query": "ASK { GRAPH ?g { :cup1 a k:Cup } }", "named-graph-uri": ASSERTED}, True),
        ({"query": "ASK { GRAPH ?g { :cup1 a k:Cup } }", "default-graph-uri": ASSERTED}, False),
        ({"query": "ASK {}", "default-graph-uri": "https://example.org/"}, 400),
    ],
)
def test_a_named_dataset_is_queried_or_refused(
    server: Server, pool: urllib3.PoolManager, fields: dict[str, str], answer: bool | int
) -> None:
    got = pool.request("GET", f"{server.url}sparql?{urlencode(fields)}")
    if isinstance(answer, bool):
        assert got.json()["boolean"] is answer
    else:
        assert (got.status, b"no graph is named" in got.data) == (answer, True)


def test_the_server_survives_a_thousand_broken_and_concurrent_requests(
    server: Server, pool: urllib3.PoolManager
) -> None:
    chance, path = random.Random(7), f"/sparql?{urlencode({'query': CUPS})}"
    good = f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
    long = b"POST /sparql HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/sparql-query\r\nContent-Length: "

    def broken(number: int) -> None:
        text = bytearray(good)
        for _ in range(chance.randrange(1, 9)):
            text[chance.randrange(len(text))] = chance.randrange(256)
        texts = [
            bytes(text),
            good[: chance.randrange(len(good))],
            long + b"-5\r\n\r\n",
            long + b"99999999\r\n\r\n",
            b"\0" * 400,
        ]
        with socket.socket() as client:
            client.settimeout(20)
            client.connect(("127.0.0.1", server.port))
            client.sendall(texts[number % len(texts)])
            client.shutdown(socket.SHUT_WR)
            while client.recv(4096):
                pass

    def whole(_: int) -> int:
        connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
        connection.request("GET", path)
        answer = connection.getresponse()
        answer.read()
        connection.close()
        return answer.status

    with ThreadPoolExecutor(32) as many:
        breaking = [many.submit(broken, number) for number in range(700)]
        asking = [many.submit(whole, number) for number in range(300)]
        for task in breaking:
            error = task.exception()
            assert error is None or isinstance(error, ConnectionError), error
        assert {task.result() for task in asking} == {200}
    assert pool.request("GET", f"{server.url}sparql?{urlencode({'query': CUPS})}").status == 200
    assert threading.active_count() < 120


def test_the_longest_idle_connection_is_closed_if_there_are_too_many(
    monkeypatch: pytest.MonkeyPatch, pool: urllib3.PoolManager
) -> None:
    monkeypatch.setattr("confab.serving.MOST", 3)
    with serving(confab.load("living-room"), 0) as server:
        slow = [socket.create_connection(("127.0.0.1", server.port), timeout=5.0) for _ in range(5)]
        slow[-1].sendall(b"GET / HT")
        assert pool.request("GET", server.url, timeout=10.0).status == 200
        with suppress(ConnectionError):
            assert slow[0].recv(1) == b""
        slow[-1].sendall(b"TP/1.1\r\nHost: localhost\r\n\r\n")
        assert slow[-1].recv(12) == b"HTTP/1.1 200"
        for connection in slow:
            connection.close()


@pytest.mark.parametrize(
    "begun", [b"GET / HT", b"POST /sparql HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99\r\n\r\n"]
)
def test_a_slow_request_has_one_time_limit_for_all_its_parts(monkeypatch: pytest.MonkeyPatch, begun: bytes) -> None:
    monkeypatch.setattr("confab.serving.SLOWEST", 0.5)
    with (
        serving(confab.load("living-room"), 0) as server,
        socket.create_connection(("127.0.0.1", server.port), timeout=10.0) as slow,
    ):
        slow.sendall(begun)
        begin, answer = monotonic(), b""
        with suppress(OSError):
            while monotonic() - begin < 5.0 and b"\n" not in answer:
                slow.send(b"x")
                slow.settimeout(0.1)
                with suppress(TimeoutError):
                    answer += slow.recv(1000)
                    if not answer:
                        break
        assert monotonic() - begin < 5.0
        assert answer == b"" or b" 408 " in answer


def test_the_server_ends_even_if_connections_are_open_and_queries_run() -> None:
    with serving(confab.load("living-room"), 0) as server:
        waiting = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(4)]
        asking = [sent(server, HEAVY) for _ in range(4)]
        until(lambda: running(server) > 0)
        begin = monotonic()
    assert monotonic() - begin < 3.0
    for connection in waiting + asking:
        connection.close()


def test_a_client_follows_a_robot_that_acts(pool: urllib3.PoolManager) -> None:
    scene = confab.load("beverage-serving")
    seen: list[str] = []
    query = "SELECT ?value WHERE { ?fact a c:SituatedObjectInstance ; c:about :cup1 ; c:situationType k:LOCATION ; c:value ?value }"
    with serving(scene, 0) as server:
        assert "cup1 LOCATION" in pool.request("GET", server.url + "page.json").data.decode()
        assert "3 / 8 / 26" in pool.request("POST", server.url + "page.json", json=TURNED).json()["headline"]
        assert pool.request("POST", server.url + "page.json", body=b"[").status == 400

        def look(moment: object) -> None:
            server.service.take(moment)  # type: ignore[arg-type]
            if getattr(moment, "what", "") == "end" and len(getattr(moment, "done", ())) % 8 == 0:
                answer = pool.request("GET", f"{server.url}sparql?{urlencode({'query': query})}")
                seen.extend(
                    row["value"]["value"].split("#")[1] for row in json.loads(answer.data)["results"]["bindings"]
                )
                now = pool.request("GET", server.url + "page.json").json()
                assert (now["live"], now["now"]) == (True, getattr(moment, "seconds", None))
                assert pool.request("GET", f"{server.url}page.json?after={now['version']}").status == 204

        assert scene.execute(observer=look).reached
        assert pool.request("GET", server.url + "page.json").json()["status"] == "reached"
    assert seen[-1] == "location7"


def test_a_query_ends_with_the_process_that_sent_it(tmp_path: Path) -> None:
    code = "import sys, confab; print(flush=True); confab.load('living-room').query(sys.argv[1])"
    with subprocess.Popen([sys.executable, "-c", code, HEAVY], stdout=subprocess.PIPE) as asking:
        assert asking.stdout is not None and asking.stdout.readline()
        until(lambda: len(workers(asking.pid)) == 2)
        started = workers(asking.pid)
        asking.kill()
        asking.wait()
        until(lambda: not any(alive(pid) for pid in started))


def workers(parent: int) -> list[int]:
    """Return the child processes of a process."""
    below = [int(pid) for file in Path(f"/proc/{parent}/task").glob("*/children") for pid in file.read_text().split()]
    return below + [pid for child in below for pid in workers(child)]


def alive(pid: int) -> bool:
    stat = Path(f"/proc/{pid}/stat")
    return stat.exists() and stat.read_text().rpartition(")")[2].split()[0] != "Z"
