"""Functions that read the arguments of commands: scenes, memories, plans, and output files."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

import click

from confab import ontology
from confab.progress import progress
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.terminal import remark

SCENE, PDDL, QUERY, FACT, INTERVENTION, NUMBER = "a scene", "PDDL", "a query", "a fact", "an intervention", "a number"
IRI, TURTLE_EPISODE = "an IRI", "an episode in Turtle"
"""The kinds of values that arguments and options take, beside the kinds of files in `confab.reasoner.kinds`."""

if TYPE_CHECKING:
    from confab.memory import Memory
    from confab.planner.plan import Outcome, Plan
    from confab.reasoner.limits import Deadline
    from confab.scene import Scene


def load_scene(source: str, iri: str | None = None, changed: bool = True) -> Scene:
    """Load a scene, and compute its reach facts if it has a robot's body; the source ``-`` is standard input.

    If `changed`, the scene has the facts of the option ``--fact``, and lacks the goals of ``--without-goal``.
    """
    from confab.reaching import with_current_reach
    from confab.reasoner.limits import check
    from confab.scene import load_text, read

    with progress(f"reading {'stdin' if source == '-' else source}"):
        scene = load_text(sys.stdin.buffer.read()) if source == "-" else read(source, scene=iri)
    scene = with_current_reach(scene, remark)
    check("reading the scene")  # the imports of the planner and of the executive take almost a second
    return with_changes(scene) if changed else scene


def with_changes(scene: Scene) -> Scene:
    """Return a scene with the facts of the option ``--fact``, and without the goals of the option ``--without-goal``."""
    context = click.get_current_context(silent=True)
    facts, goals = (context.meta.get(name) if context else None for name in ("with_fact", "without_goal"))
    scene = scene.with_fact(*facts) if facts else scene
    return scene.without_goal(*goals) if goals else scene


VALIDATING = 1.0
"""Minimum remaining seconds for a quick validation, most of which the imports of its modules take."""


def warn_of_errors(scene: Scene, deadline: Deadline) -> None:
    """Print the first error that a quick validation finds in an unchanged scene file of the user, if enough time is left."""
    path, left = scene.knowledge.path, deadline.left
    if path is None or path.is_relative_to(ontology.ROOT) or scene.knowledge.changes:
        return
    if left is not None and left < VALIDATING:
        return
    from confab.reasoner.limits import LimitError, within
    from confab.reasoner.validation.validate import quick_errors

    errors = []
    with suppress(LimitError), within(deadline):
        errors = quick_errors(scene.knowledge)
    if errors:
        more = f" and {len(errors) - 1} more" if len(errors) > 1 else ""
        remark(f"'confab validate {quote(str(path))}' finds errors, so the result may be wrong: {errors[0].what}{more}")


def blame_reach(scene: Scene, outcome: Outcome, deadline: Deadline) -> None:
    """If there is no plan and time is left, print each place that no hand reaches, with the obstacle."""
    if outcome.plan is None and deadline.left != 0:
        from confab.reaching import unreached
        from confab.reasoner.limits import LimitError, within

        with suppress(LimitError), within(deadline):
            for line in unreached(scene):
                remark(line)


NAMED = 3
"""Maximum number of unknown terms of a memory that a message names."""


def memory_for(path: Path | None, none: bool, scene: Scene, new: bool = False) -> Memory | None:
    """Return the memory in a file; return None if no file is given, or if the file can't be read.

    If `new`, a missing file is a new memory.
    """
    if path is not None and none:
        raise KnowledgeError("--memory and --no-memory exclude each other; give one")
    if path is None:
        return None
    from confab.memory import Memory, memory_at

    try:
        if new and not path.is_file():
            return memory_at(path, scene)
        lines = None
        if path.is_file():
            from confab.authoring import unknown_terms
            from confab.reasoner.memory.links_file import memory_lines

            lines = memory_lines(path)
            if unknown := unknown_terms(lines, scene):
                more = f"; and {len(unknown) - NAMED} more" if len(unknown) > NAMED else ""
                remark(f"{path} has terms that this scene doesn't have: {'; '.join(unknown[:NAMED])}{more}")
        return Memory.load(path, scene, lines=lines)
    except KnowledgeError as error:
        from confab.reasoner.memory.links_file import AnotherKindError

        if not path.is_file() or isinstance(error, AnotherKindError):
            raise
        remark(f"{error}; planning continues without memory")
        return None


def plan_in(path: Path, scene: Scene) -> Plan:
    """Return the plan in a file with Confab's JSON, or with a PDDL planner's list of actions for an exported level."""
    if path.suffix.lower() in (".json", ""):
        from confab.interchange import read_plan

        return read_plan(path, scene.problem)
    from confab.pddl_commands import read_pddl_plan

    try:
        return read_pddl_plan(scene.problem, None, path.read_text(encoding="utf-8"), regroup=True)
    except (KnowledgeError, UnicodeDecodeError) as error:
        raise KnowledgeError(f"{path}: {error}") from error
