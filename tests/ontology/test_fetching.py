"""Downloads from the web: only on request, here on loopback, and malicious files aren't stored."""

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from confab.reasoner.graph import fetching
from confab.reasoner.graph.fetching import fetch
from confab.reasoner.graph.knowledge import KnowledgeError, load

TURTLE = "<{iri}> a <http://www.w3.org/2002/07/owl#Ontology> {more} .\n"
XML = (
    '<?xml version="1.0"?>\n{dtd}<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#" '
    'xmlns:owl="http://www.w3.org/2002/07/owl#"><owl:Ontology rdf:about="{iri}"/></rdf:RDF>'
)
IMPORTS = "; <http://www.w3.org/2002/07/owl#imports> <{}>"
BOMB = '<!DOCTYPE rdf:RDF [ <!ENTITY a "ha"> <!ENTITY b "&a;&a;&a;&a;"> ]>\n'
THIEF = '<!DOCTYPE rdf:RDF [ <!ENTITY secret SYSTEM "file:///etc/hostname"> ]>\n'


def documents(base: str) -> dict[str, tuple[int, dict[str, str], str]]:
    def turtle(name: str, more: str = "", kind: str = "text/turtle") -> tuple[int, dict[str, str], str]:
        return 200, {"Content-Type": kind}, TURTLE.format(iri=f"{base}/{name}", more=more)

    def xml(name: str, dtd: str = "") -> tuple[int, dict[str, str], str]:
        return 200, {"Content-Type": "application/rdf+xml"}, XML.format(iri=f"{base}/{name}", dtd=dtd)

    return {
        "/kitchen": turtle("kitchen", IMPORTS.format("https://w3id.org/confab/core")),
        "/unnamed": turtle("unnamed", kind="application/octet-stream"),
        "/house.owl": xml("house.owl"),
        "/moved": (302, {"Location": f"{base}/kitchen"}, ""),
        "/away": (302, {"Location": "file:///etc/hostname"}, ""),
        "/round": (302, {"Location": f"{base}/round"}, ""),
        "/bomb": xml("bomb", BOMB),
        "/thief": xml("thief", THIEF),
        "/inside": turtle("inside", IMPORTS.format("file:///etc/passwd")),
        "/other": turtle("another"),
        "/page": (200, {"Content-Type": "text/html"}, "<html><body>hello</body></html>"),
        "/large": (200, {"Content-Type": "text/turtle"}, "# " + "x" * 3000),
        "/packed": (200, {"Content-Type": "text/turtle", "Content-Encoding": "gzip"}, "x"),
        "/gone": (404, {}, ""),
    }


@pytest.fixture
def web() -> Iterator[str]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            status, headers, body = served.get(self.path, (404, {}, ""))
            self.send_response(status)
            for name, value in {**headers, "Content-Length": str(len(body))}.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body.encode())

        def log_message(self, *_: object) -> None:
            """Write no log."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    base = f"http://127.0.0.1:{server.server_port}"
    served = documents(base)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield base
    server.shutdown()
    server.server_close()


def test_an_import_by_url_is_reported_then_fetched_then_found_offline(web: str, tmp_path: Path) -> None:
    scene = tmp_path / "mine.ttl"
    scene.write_text(TURTLE.format(iri="https://example.org/mine", more=IMPORTS.format(f"{web}/kitchen")))
    with pytest.raises(KnowledgeError, match=f"confab fetch {web}/kitchen --into"):
        load(scene)
    fetched = fetch(f"{web}/kitchen", tmp_path)
    assert fetched.file == tmp_path / "kitchen.ttl"
    assert fetched.imports == ("https://w3id.org/confab/core",)
    assert f"{web}/kitchen" in load(scene).files
    with pytest.raises(KnowledgeError, match="exists already"):
        fetch(f"{web}/kitchen", tmp_path)


@pytest.mark.parametrize(("name", "file"), [("house.owl", "house.owl"), ("unnamed", "unnamed.ttl")])
def test_the_kind_of_document_is_recognised(web: str, tmp_path: Path, name: str, file: str) -> None:
    assert fetch(f"{web}/{name}", tmp_path).file.name == file
    assert f'name="{web}/{name}"' in (tmp_path / "catalog-v001.xml").read_text()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("bomb", "reads another file or grows"),
        ("thief", "reads another file or grows"),
        ("inside", "a file of this machine"),
        ("other", "import and fetch it by that IRI"),
        ("moved", "import and fetch it by that IRI"),
        ("away", "can't be fetched"),
        ("round", "too many redirects"),
        ("page", "is no ttl document"),
        ("packed", "compressed"),
        ("gone", "404"),
    ],
)
def test_a_download_that_is_no_plain_ontology_is_refused_and_not_stored(
    web: str, tmp_path: Path, name: str, said: str
) -> None:
    with pytest.raises(KnowledgeError, match=said) as error:
        fetch(f"{web}/{name}", tmp_path)
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_a_download_that_is_too_large_or_too_slow_is_refused(
    web: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fetching, "MOST_BYTES", 2000)
    with pytest.raises(KnowledgeError, match="larger than"):
        fetch(f"{web}/large", tmp_path)
    monkeypatch.setattr(fetching, "SECONDS", 0.0001)
    with pytest.raises(KnowledgeError, match=r"can't be fetched|takes longer"):
        fetch(f"{web}/kitchen", tmp_path)


@pytest.mark.parametrize("url", ["file:///etc/hostname", "ftp://example.org/x", "kitchen.ttl", "http:///x"])
def test_only_web_addresses_are_fetched(url: str, tmp_path: Path) -> None:
    with pytest.raises(KnowledgeError, match="wanted the http or https address"):
        fetch(url, tmp_path)
