"""Real SPARQL servers on loopback, started for a test and stopped by their process ID."""

import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

import urllib3

RDFLIB_APP = """
import sys, uvicorn
from rdflib import Dataset, URIRef
from rdflib_endpoint import SparqlEndpoint
data = Dataset(default_union=True)
for file in sys.argv[2:]:
    data.graph(URIRef("urn:file:" + file)).parse(file, format="turtle")
uvicorn.run(SparqlEndpoint(graph=data), host="127.0.0.1", port=int(sys.argv[1]), log_level="error")
"""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def running(command: list[str], port: int) -> Iterator[None]:
    """Run a server until the end of the block; first wait until the server accepts connections."""
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        for _ in range(300):
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    break
            assert server.poll() is None, f"{command[0]} ended with {server.returncode}"
            time.sleep(0.1)
        yield
    finally:
        server.terminate()
        server.wait(10)


@contextmanager
def oxigraph(graphs: Mapping[str, list[Path]], union: bool = False) -> Iterator[str]:
    """Run the Oxigraph server with files in named graphs (the default graph is ""), and yield the address for queries."""
    port = free_port()
    base = f"http://127.0.0.1:{port}"
    command = [str(Path(sys.executable).with_name("oxigraph")), "serve", "--bind", f"127.0.0.1:{port}"]
    with running([*command, *["--union-default-graph"] * union], port):
        for graph, files in graphs.items():
            where = f"graph={quote(graph, safe='')}" if graph else "default"
            for file in files:
                answer = urllib3.request(
                    "POST", f"{base}/store?{where}", body=file.read_bytes(), headers={"Content-Type": "text/turtle"}
                )
                assert answer.status in (200, 201, 204), answer.data
        yield f"{base}/query"


@contextmanager
def rdflib_endpoint(files: list[Path]) -> Iterator[str]:
    """Run rdflib-endpoint, whose SPARQL engine is rdflib's own, with files in its default graph."""
    port = free_port()
    with running([sys.executable, "-c", RDFLIB_APP, str(port), *map(str, files)], port):
        yield f"http://127.0.0.1:{port}/"
