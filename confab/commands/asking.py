"""The commands `query`, `serve` and `mcp`: they answer SPARQL queries, run an endpoint, and offer tools to agents."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click
from click.exceptions import Exit

from confab.commands.given import QUERY as A_QUERY
from confab.commands.given import TURTLE_EPISODE, load_scene
from confab.commands.options import (
    AS_JSON,
    PATH,
    QUERY_ROWS,
    QUERY_SECONDS,
    QUIET,
    SCENE,
    SCENE_IRI,
    Input,
    Output,
    Text,
    command,
    output_option,
)
from confab.examples import examples
from confab.progress import progress
from confab.reasoner.files import STDOUT
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.table import Table
from confab.terminal import NO, YES, limited, show_result, told


@command(epilog=examples("serve"))
@SCENE
@click.option(
    "--port", type=click.IntRange(0, 65535), default=7879, metavar="N", help="Port on 127.0.0.1; 0 selects a free port."
)
@QUERY_SECONDS
@QUERY_ROWS
@QUIET
def serve(scene: str, port: int, time_limit: float, rows: int) -> None:
    """Serve a scene as a page and a SPARQL endpoint."""
    from threading import Event

    from confab.reasoner.graph.query_process import QueryLimits
    from confab.serving import serving

    with serving(load_scene(scene), port, QueryLimits(seconds=time_limit, rows=rows)) as server:
        show_result(
            f"{server.url} is the page of the scene, {server.url}sparql answers SPARQL 1.1; Ctrl-C ends the server"
        )
        sys.stdout.flush()
        Event().wait()


@command(epilog=examples("mcp"))
@click.argument("folder", type=PATH, default=".", metavar="[FOLDER]")
def mcp(folder: Path) -> None:
    """Serve tools for agents on stdio (Model Context Protocol)."""
    from confab.agents import server

    server(folder).run("stdio")


FORMS = {
    ".ttl": "turtle",
    ".txt": "table",
    ".csv": "csv",
    ".json": "json",
    ".tsv": "tsv",
    ".srj": "sparql-json",
    ".srx": "sparql-xml",
}


@command(epilog=examples("query"))
@SCENE
@click.argument(
    "sparql",
    type=Text(A_QUERY),
    required=False,
    metavar="[QUERY]",
    help="SPARQL text, a .rq file, a shipped query (where-was-it), or - for stdin.",
)
@click.option(
    "--episodes",
    multiple=True,
    type=Input(TURTLE_EPISODE),
    metavar="FILE.ttl",
    help="Also query this saved episode; repeatable.",
)
@click.option("--show", metavar="BEHAVIOR", help="Print the query that quantifies this behaviour.")
@click.option(
    "--applicable", is_flag=True, help="With --show: the query for the arguments with which it is applicable."
)
@click.option("--update", is_flag=True, help="With --show: the behaviour as a SPARQL update.")
@click.option("--affords", metavar="OBJECT", help="List the behaviours that an object affords; 'all' for every object.")
@click.option("--facts", is_flag=True, help="List the initial facts: stated facts, default values and derived amounts.")
@click.option("--derived", is_flag=True, help="List the facts that definitions and rules make true initially.")
@click.option("--format", "form", help="Format: table, csv, json, tsv, sparql-json or sparql-xml.")
@click.option("--iris", is_flag=True, help="Print full IRIs instead of short names.")
@output_option(type=Output(), metavar="FILE", help="File to write; FILE.ttl gets the triples of a CONSTRUCT query.")
@QUERY_SECONDS
@QUERY_ROWS
@click.option("--service", is_flag=True, help="Allow the query to use other endpoints (SERVICE).")
@SCENE_IRI
@AS_JSON
@QUIET
def query(
    scene: str,
    sparql: str | None,
    episodes: tuple[Path, ...],
    show: str | None,
    applicable: bool,
    update: bool,
    affords: str | None,
    facts: bool,
    derived: bool,
    form: str | None,
    iris: bool,
    out: Path | None,
    time_limit: float,
    rows: int,
    service: bool,
    iri: str | None,
    as_json: bool,
) -> None:
    """Query a scene in SPARQL, or list its facts or affordances."""
    from confab.reasoner.graph.query_process import QueryLimits

    limits = QueryLimits(seconds=time_limit, rows=rows, service=service)
    if sparql == "-":
        sparql = sys.stdin.read()
    asked = {
        "QUERY": sparql,
        "--show": show,
        "--affords": affords,
        "--facts": facts or None,
        "--derived": derived or None,
    }
    given = [name for name, value in asked.items() if value is not None]
    if len(given) > 1:
        raise KnowledgeError(f"{' and '.join(given)} exclude each other; give one")
    if applicable and show is None:
        raise KnowledgeError("--applicable selects the query that --show prints; also give --show BEHAVIOR")
    if update and (applicable or show is None):
        raise KnowledgeError(
            "--update shows the behaviour that --show names; give --show BEHAVIOR, and not --applicable"
        )
    with limited(time_limit):
        loaded = load_scene(scene, iri).with_episodes(*episodes)
        if show is not None and update:
            print(loaded.update_of(show), end="")
            return
        if show is not None:
            print(loaded.applicable_query(show) if applicable else loaded.quantifying_query(show))
            return
        if not given:
            from confab.accepting import shipped_queries

            shipped = ", ".join(shipped_queries(loaded.knowledge))
            raise KnowledgeError(
                f"no query; give SPARQL text, a .rq file, a shipped query ({shipped}), --facts, --derived, "
                "--show BEHAVIOR or --affords OBJECT"
            )
        if out is not None and out.suffix.lower() == ".ttl":
            if sparql is None:
                raise KnowledgeError("-o FILE.ttl needs the triples of a CONSTRUCT query; also give the query")
            told(out, f"{loaded.construct(sparql, out, limits)} triples")
            return
        with progress("asking"):
            if facts or derived:
                table = Table(("fact",), tuple((fact,) for fact in (loaded.facts if facts else loaded.derived_facts)))
            else:
                table = loaded.affordances(affords) if sparql is None else loaded.query(sparql, limits)
    form = form or ("json" if as_json else FORMS.get(out.suffix.lower()) if out not in (None, STDOUT) else "table")
    if form is None or form not in FORMS.values():
        wanted = f"wanted a file in {', '.join(FORMS)}" if form is None else f"wanted {', '.join(FORMS.values())}"
        raise KnowledgeError(f"unknown format '{form or out}'; {wanted}")
    _rows(table.iris() if iris else table, form, out, loaded.knowledge.spoken)
    raise Exit(NO if table.truth is False else YES)


def _rows(table: Table, form: str, out: Path | None, prefixes: dict[str, str]) -> None:
    """Print the rows of a query, or write them into a file."""
    if form == "table" and out is None:
        show_result("true" if table.truth else table if table.truth is None else "false")
        return
    if form == "table":
        text = f"{table!r}\n"
    elif form == "csv":
        text = table.csv()
    elif form == "json":
        data = table.records() if table.truth is None else table.truth
        text = json.dumps(data, indent=1, ensure_ascii=False) + "\n"
    elif form == "turtle":
        text = table.turtle(prefixes)
    else:
        text = table.standard(form).decode("utf-8").rstrip("\n") + "\n"
    if out is None:
        print(text, end="")
        return
    from confab.reasoner.files import write_whole
    from confab.reasoner.kinds import TRIPLES, stamped

    write_whole(out, stamped(TRIPLES, [text]) if form == "turtle" else text)
    told(out, f"{len(table)} rows")
