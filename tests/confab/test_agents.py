"""Twenty sessions of an agent with `confab mcp`, through the official client: answers, refusals and limits, without a traceback."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

import confab
from confab import ontology

pytest.importorskip("mcp")
import anyio
from jsonschema import Draft202012Validator
from mcp import Client, StdioServerParameters
from mcp.client.stdio import stdio_client

SCENE, GOAL = "beverage-serving", "cup2 LOCATION location8"
Session = Callable[[Any], Awaitable[None]]
SESSIONS: dict[str, Session] = {}


def session(scripted: Session) -> Session:
    """Register a session to be run."""
    SESSIONS[scripted.__name__.replace("_", " ")] = scripted
    return scripted


async def said(client: Any, tool: str, refused: bool = False, **arguments: object) -> str:
    """Return the answer of a tool, or its refusal if `refused`. The text has at most 4,100 bytes and no traceback."""
    result = await client.call_tool(tool, arguments)
    text: str = result.content[0].text
    assert result.is_error is refused, text
    assert len(text.encode()) <= 4_100
    assert "Traceback" not in text
    return text


@session
async def the_scenes_are_listed(client: Any) -> None:
    text = await said(client, "scenes")
    assert SCENE in text
    assert "errands-scene.ttl" in text


@session
async def a_plan_has_its_levels(client: Any) -> None:
    text = await said(client, "plan", scene=SCENE)
    assert "22 B1_MOVE cup1 location7" in text
    assert "B3_GRASP" in text


@session
async def a_goal_is_planned_for_and_a_step_explained(client: Any) -> None:
    assert "solved" in await said(client, "plan", scene=SCENE, goals=[GOAL], seconds=4)
    assert "gives" in await said(client, "why", scene=SCENE, step="0", goals=[GOAL], seconds=4)
    assert "L3#" in await said(client, "why", scene=SCENE)


@session
async def something_else_is_compared(client: Any) -> None:
    assert await said(client, "why_not", scene=SCENE, instead=GOAL, seconds=4)
    text = await said(client, "why_not", refused=True, scene=SCENE)
    assert text == "why_not: wrong arguments: instead: missing"
    text = await said(client, "plan", refused=True, scene=SCENE, goal=[GOAL])
    assert text == "plan: no argument 'goal'; wanted scene, goals, mode, seconds"


@session
async def what_is_unsolvable_is_proved(client: Any) -> None:
    text = await said(client, "plan", scene="canteen-small", goals=["trolley BATTERY >=25"])
    assert "unsolvable" in text


@session
async def a_changed_world_is_planned_in_again(client: Any) -> None:
    before = await said(client, "plan", scene=SCENE)
    after = await said(client, "replan", scene=SCENE, facts=["cup1 LOCATION location7"])
    assert "B1_MOVE cup1 location7" in before
    assert "B1_MOVE cup1 location7" not in after


@session
async def an_impossible_change_is_refused(client: Any) -> None:
    assert "location" in await said(client, "replan", True, scene=SCENE, facts=["cup1 LOCATION bottle1"])


@session
async def rows_are_answered(client: Any) -> None:
    text = await said(client, "query", scene=SCENE, sparql="SELECT ?o ?l WHERE { ?o k:location ?l } ORDER BY ?o")
    assert text.splitlines()[:2] == ["o\tl", "bottle1\tlocation4"]


@session
async def a_broken_query_says_where(client: Any) -> None:
    assert "1:" in await said(client, "query", True, scene=SCENE, sparql="SELECT ?o { ?o ?p")


@session
async def an_update_is_refused(client: Any) -> None:
    assert await said(client, "query", True, scene=SCENE, sparql="DELETE WHERE { ?s ?p ?o }")


@session
async def a_file_isnt_taken_for_a_query(client: Any) -> None:
    assert "as text" in await said(client, "query", True, scene=SCENE, sparql="/etc/passwd")


@session
async def a_long_answer_is_cut_and_kept(client: Any) -> None:
    text = await said(client, "query", scene=SCENE, sparql="SELECT * WHERE { ?s ?p ?o } LIMIT 400")
    address = text.split()[-1]
    whole = await client.read_resource(address)
    assert whole.contents[0].text.startswith(text[:1_000])
    assert whole.contents[0].text.endswith("(400 rows)")


@session
async def no_path_leads_out_of_the_folder(client: Any) -> None:
    for name in ("../secret.ttl", "/etc/passwd", "link.ttl", "file:///etc/passwd", "http://127.0.0.1:9/x.ttl"):
        text = await said(client, "plan", True, scene=name)
        assert "outside of the folder" in text, name


@session
async def no_catalog_leads_out_of_the_folder(client: Any) -> None:
    assert "outside of the folder" in await said(client, "plan", True, scene="astray/errands-scene.ttl")


@session
async def an_unknown_scene_is_refused(client: Any) -> None:
    assert "there is no file 'nowhere.ttl'" in await said(client, "validate", True, scene="nowhere.ttl")


@session
async def a_broken_file_says_where(client: Any) -> None:
    assert "broken.ttl" in await said(client, "plan", True, scene="broken.ttl")


@session
async def a_file_of_ones_own_is_planned_in_and_validated(client: Any) -> None:
    assert "solved" in await said(client, "plan", scene="errands-scene.ttl")
    assert (await said(client, "validate", scene="errands-scene.ttl")).startswith("0 errors")


@session
async def arguments_of_another_type_are_refused(client: Any) -> None:
    await said(client, "plan", True, scene=SCENE, goals="no list", mode="quickly")
    await said(client, "plan", True, scene=SCENE, seconds=-1)


@session
async def a_limit_is_obeyed_and_a_cancelled_call_ends(client: Any) -> None:
    endless = "SELECT (COUNT(*) AS ?n) { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i . ?j ?k ?l }"
    assert "gave up" in await said(client, "query", True, scene=SCENE, sparql=endless, seconds=1)
    with anyio.move_on_after(0.5):
        await client.call_tool("query", {"scene": SCENE, "sparql": endless, "seconds": 300})
    assert await said(client, "query", scene=SCENE, sparql="ASK { }") == "true"


@session
async def two_calls_at_once_are_answered(client: Any) -> None:
    found: list[str] = []

    async def one(sparql: str) -> None:
        found.append(await said(client, "query", scene=SCENE, sparql=sparql))

    async with anyio.create_task_group() as group:
        group.start_soon(one, "ASK { :cup1 a k:Cup }")
        group.start_soon(one, "ASK { :cup1 a k:Bottle }")
    assert sorted(found) == ["false", "true"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a user's scene, a broken scene, and a link and a catalog that point outside of the folder."""
    root = tmp_path_factory.mktemp("agents")
    own, astray = root / "mine", root / "mine" / "astray"
    astray.mkdir(parents=True)
    confab.new_domain("errands", own)
    scene = (own / "errands-scene.ttl").read_text(encoding="utf-8")
    for file in (astray / "errands-scene.ttl", root / "secret.ttl"):
        file.write_text(scene, encoding="utf-8")
    (own / "broken.ttl").write_text("@prefix : <urn:x#> .\n:a :b\n", encoding="utf-8")
    return root


def hold(own: Path, scripts: dict[str, Session], errors: Path) -> list[dict[str, Any]]:
    """Run sessions one after another with one server; return the schemas of its tools."""
    command = StdioServerParameters(command=sys.executable, args=["-m", "confab", "mcp", str(own)])

    async def held() -> list[dict[str, Any]]:
        with errors.open("w", encoding="utf-8") as log:
            async with Client(stdio_client(command, errlog=log)) as client:
                for scripted in scripts.values():
                    await scripted(client)
                return [tool.input_schema for tool in (await client.list_tools()).tools]

    return anyio.run(held)


def test_twenty_sessions_end_without_a_traceback_and_all_schemas_are_valid(folder: Path, tmp_path: Path) -> None:
    own, astray = folder / "mine", folder / "mine" / "astray"
    assert len(SESSIONS) == 20
    late = {name: script for name, script in SESSIONS.items() if "path leads" in name or "catalog leads" in name}
    schemas = hold(own, {n: s for n, s in SESSIONS.items() if n not in late and "isnt" not in n}, tmp_path / "log")
    assert len(schemas) == 8
    for schema in schemas:
        Draft202012Validator.check_schema(schema)
    (own / "link.ttl").symlink_to(folder / "secret.ttl")
    shutil.copy(own / ontology.CATALOG, astray / ontology.CATALOG)
    text = (astray / ontology.CATALOG).read_text(encoding="utf-8")
    out = '<uri name="https://example.org/out" uri="../../secret.ttl"/>'
    (astray / ontology.CATALOG).write_text(text.replace("</catalog>", f"{out}</catalog>"), encoding="utf-8")
    hold(own, {**late, "a file isnt taken": SESSIONS["a file isnt taken for a query"]}, tmp_path / "more")
    assert "Traceback" not in (tmp_path / "log").read_text() + (tmp_path / "more").read_text()
