"""An MCP server on stdio, with tools that plan, replan, query, validate, explain and verify for language-model agents.

Each call runs in a separate process. The process ends when the call or the server ends, at the time limit, or when the client
cancels the call. An answer is text of at most `SHOWN` bytes. If an answer was cut, its last line names a resource that has the
complete text. The server reads only files of one folder, and writes only files of reach facts.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from subprocess import Popen, TimeoutExpired
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, ValidationError

from confab import __version__, answers
from confab.planner.solve import Mode
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import LimitError
from confab.reasoner.workers import WorkerError, call, kill

if TYPE_CHECKING:
    from mcp.server.mcpserver import MCPServer

SHOWN, KEPT = 4_000, 50
"""Maximum number of bytes of an answer, and maximum number of cut answers whose complete texts the server keeps."""
MORE, MEGABYTES, MOST_SECONDS = 10.0, 6_000, 600.0
"""Three limits of a process: the seconds by which it may exceed its time limit, its memory in megabytes, and its greatest time
limit in seconds.
"""

SceneName = Annotated[
    str, Field(description="A shipped scene (tool scenes), or a file in the folder, e.g. kitchen.ttl")
]
Goals = Annotated[
    list[str], Field(description="Goals that replace those of the scene's task, each like 'cup2 LOCATION location8'")
]
Facts = Annotated[
    list[str], Field(description="Facts that replace facts of the scene, each like 'cup1 LOCATION location7'")
]
Seconds = Annotated[float, Field(description="Time limit in seconds", gt=0, le=MOST_SECONDS)]


class KeptTexts:
    """The complete texts of the last `KEPT` answers that were cut, by number."""

    def __init__(self) -> None:
        self._texts: dict[str, str] = {}
        self._count = 0

    def shown(self, text: str) -> str:
        """Return an answer; if the answer is too long, return its beginning and the address of the complete text."""
        if len(text.encode()) <= SHOWN:
            return text
        self._count += 1
        self._texts[str(self._count)] = text
        self._texts.pop(str(self._count - KEPT), None)
        last = f"\n… cut at {SHOWN} bytes; all {len(text.encode())}: confab://answers/{self._count}"
        return text.encode()[: SHOWN - len(last.encode())].decode(errors="ignore") + last

    def whole(self, number: str) -> str:
        """Return the complete text of the answer that has the number `number`.

        Raises
        ------
        KeyError
            The answer was discarded, or was never stored.
        """
        return self._texts[number]


def _wrong_arguments(name: str, error: ValidationError) -> str:
    """Return a sentence that names the missing and wrong arguments of a tool."""
    faults = [
        f"{'.'.join(map(str, one['loc']))}: {'missing' if one['type'] == 'missing' else one['msg']}"
        for one in error.errors()
    ]
    return f"{name}: wrong arguments: {'; '.join(faults)}"[:SHOWN]


def server(folder: Path) -> MCPServer[Any]:
    """Return the server for the scenes in a folder.

    Raises
    ------
    KnowledgeError
        The SDK isn't installed, or the folder doesn't exist.
    """
    try:
        import anyio.to_thread
        from mcp.server.mcpserver import MCPServer
        from mcp.server.mcpserver.exceptions import ResourceError, ToolError
    except ImportError as error:
        raise KnowledgeError(
            "agents need the Python SDK of the Model Context Protocol: pip install 'mcp>=2'"
        ) from error
    folder = folder.resolve()
    if not folder.is_dir():
        raise KnowledgeError(f"{folder}: there is no such folder")

    class Server(MCPServer[Any]):
        """The server of the MCP SDK, with one-sentence error messages about wrong arguments."""

        async def call_tool(self, name: str, arguments: dict[str, Any], context: Any = None) -> Any:
            """Call a tool by name with arguments."""
            known = {tool.name: [*tool.input_schema["properties"]] for tool in await self.list_tools()}.get(name)
            unknown = [one for one in arguments if known is not None and one not in known]
            if unknown:
                raise ToolError(
                    f"{name}: no argument '{unknown[0]}'; wanted {', '.join(known or ()) or 'none'}"[:SHOWN]
                )
            try:
                return await super().call_tool(name, arguments, context)
            except ToolError as error:
                if isinstance(error.__cause__, ValidationError):
                    raise ToolError(_wrong_arguments(name, error.__cause__)) from None
                raise

    made = Server(
        "confab",
        version=__version__,
        instructions="Plans of a robot from an ontology, with reasons, proofs of unsolvability, and checks in physics.",
        log_level="ERROR",
    )
    kept = KeptTexts()

    async def answered(function: Callable[..., str], *arguments: object, seconds: float) -> str:
        processes: list[Popen[bytes]] = []
        work = partial(
            call, function, folder, *arguments, seconds=2 * seconds + MORE, megabytes=MEGABYTES, timeout=seconds + MORE,
            started=processes.append,
        )  # fmt: skip
        try:
            return kept.shown(await anyio.to_thread.run_sync(work, abandon_on_cancel=True))
        except (KnowledgeError, LimitError, ValueError) as error:
            raise ToolError(kept.shown(str(error))) from None
        except TimeoutExpired:
            raise ToolError(f"gave up after {seconds:g} s; give more time (seconds)") from None
        except WorkerError as error:
            raise ToolError(f"the process of this call ended early (exit {error.status})") from None
        except Exception as error:
            raise ToolError(
                f"a fault of this program, not of the call: {type(error).__name__}: {error}"[:SHOWN]
            ) from None
        finally:
            for process in processes:
                kill(process)

    @made.tool()
    async def scenes() -> str:
        """List the scenes that the other tools accept: shipped scenes, and files in the folder."""
        return await answered(answers.scenes, seconds=20.0)

    @made.tool()
    async def plan(scene: SceneName, goals: Goals = [], mode: Mode = "guarded", seconds: Seconds = 20.0) -> str:  # noqa: B006
        """Return a plan with the steps of all levels; if there is no plan, return the reason and its proof."""
        return await answered(answers.plan, scene, goals, [], mode, seconds, seconds=seconds)

    @made.tool()
    async def replan(scene: SceneName, facts: Facts, goals: Goals = [], seconds: Seconds = 20.0) -> str:  # noqa: B006
        """Plan again after something has changed in the world."""
        return await answered(answers.plan, scene, goals, facts, "guarded", seconds, seconds=seconds)

    @made.tool()
    async def query(
        scene: SceneName, sparql: Annotated[str, Field(description="A SPARQL 1.1 query")], seconds: Seconds = 20.0
    ) -> str:
        """Query a scene in SPARQL (SELECT, ASK or CONSTRUCT). The scene's prefixes needn't be declared."""
        return await answered(answers.query, scene, sparql, seconds, seconds=seconds)

    @made.tool()
    async def validate(scene: SceneName, seconds: Seconds = 60.0) -> str:
        """List the faults of an ontology file, with positions, causes and remedies."""
        return await answered(answers.validate, scene, seconds=seconds)

    @made.tool()
    async def why(
        scene: SceneName,
        step: Annotated[
            str, Field(description="Number of the step on the first level, or L3#12; by default all steps")
        ] = "",
        goals: Goals = [],  # noqa: B006
        seconds: Seconds = 20.0,
    ) -> str:
        """Explain why a step is in the plan: name the step's effects, and the later steps that need these effects."""
        return await answered(answers.why, scene, goals, step, seconds, seconds=seconds)

    @made.tool()
    async def why_not(
        scene: SceneName,
        instead: Annotated[
            str, Field(description="'cup2 LOCATION location8 by left_hand' or 'B2_PICK right_hand cup1'")
        ],
        goals: Goals = [],  # noqa: B006
        seconds: Seconds = 20.0,
    ) -> str:
        """Explain why an alternative isn't in the plan: name the alternative's failing conditions or its additional cost."""
        return await answered(answers.why_not, scene, goals, instead, seconds, seconds=seconds)

    @made.tool()
    async def verify(
        scene: SceneName,
        goals: Goals = [],  # noqa: B006
        rollouts: Annotated[int, Field(description="Number of rollouts", ge=1, le=answers.ROLLOUTS)] = 1,
        seed: int = 0,
        seconds: Seconds = 120.0,
    ) -> str:
        """Make a plan, execute it in physics, and return a verdict with measurements for each step."""
        return await answered(answers.verify, scene, goals, rollouts, seed, seconds, seconds=seconds)

    @made.resource("confab://answers/{number}", mime_type="text/plain")
    def whole(number: str) -> str:
        """Return the complete text of an answer that was cut."""
        try:
            return kept.whole(number)
        except KeyError:
            raise ResourceError(f"there is no answer {number}: only the latest {KEPT} cut answers are kept") from None

    return made
