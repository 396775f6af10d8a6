"""Functions that compute the answers of the tools for agents (`confab.agents`) as text, from the files of one folder."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from confab import ontology
from confab.plan_options import NO_ENGINE
from confab.planner.solve import Mode
from confab.planning import Result
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import within
from confab.scene import Scene, load, read

ROWS, ROLLOUTS = 1_000, 20
"""Maximum number of rows of a query, and maximum number of rollouts of a verification."""


def inside(folder: Path, name: str) -> Path:
    """Return the path of a file in a folder.

    Raises
    ------
    KnowledgeError
        The file doesn't exist, or isn't in the folder because its name is a URL, an absolute path, a path with ``..`` or a link.
    """
    path = (folder / name).resolve()
    if "://" in name or not path.is_relative_to(folder.resolve()):
        raise KnowledgeError(
            f"'{name}' lies outside of the folder; wanted a file in it, or the name of a shipped scene"
        )
    if not path.is_file():
        there = ", ".join(sorted(ontology.scenes()))
        raise KnowledgeError(f"there is no file '{name}' in the folder; wanted one, or a shipped scene: {there}")
    return path


def scene_of(folder: Path, name: str) -> Scene:
    """Return a shipped scene, or a scene whose files all lie in a folder.

    Raises
    ------
    KnowledgeError
        The file doesn't exist, or its name, a catalog or an import refers to a file outside the folder.
    """
    from confab.reaching import with_current_reach

    if name in ontology.scenes():
        return load(name)
    path = inside(folder, name)
    allowed = folder.resolve(), ontology.ROOT.resolve()

    def refuse_outside(said: Path, file: Path) -> None:
        if not any(file.resolve().is_relative_to(place) for place in allowed):
            raise KnowledgeError(f"{said.name} leads to {file.name}, which lies outside of the folder")

    for catalog in sorted(folder.rglob(ontology.CATALOG)):
        refuse_outside(catalog, catalog)
        for file in ontology.catalog(catalog).values():
            refuse_outside(catalog, file)
    for file in sorted(path.parent.iterdir()):  # the scene may import these files by their names
        if file.suffix in ontology.SUFFIXES:
            refuse_outside(file, file)
    scene = read(path)
    for file in scene.knowledge.files.values():
        refuse_outside(path, file)
    return with_current_reach(scene, lambda text: None)


def scenes(folder: Path) -> str:
    """Return the names of the shipped scenes, and the ontology files in a folder."""
    own = sorted(
        str(file.relative_to(folder))
        for file in folder.rglob("*")
        if file.suffix in ontology.SUFFIXES and file.is_file()
    )
    return "\n".join(["shipped: " + ", ".join(ontology.scenes()), "in the folder: " + (", ".join(own) or "none")])


def planned(scene: Scene, goals: Sequence[str], facts: Sequence[str], mode: Mode, seconds: float) -> Result:
    """Plan in a scene in which `facts` replace the facts about the same symbols, and return the result."""
    return (scene.with_fact(*facts) if facts else scene).plan(
        list(goals), mode=mode, time_limit=seconds, engine=NO_ENGINE
    )


def plan(folder: Path, name: str, goals: Sequence[str], facts: Sequence[str], mode: Mode, seconds: float) -> str:
    """Return a plan as an indented tree of steps, or the reason why there is no plan."""
    result = planned(scene_of(folder, name), goals, facts, mode, seconds)
    if not result.solved:
        return "\n".join([str(result), *map(str, result.explain().proof)])
    return "\n".join([repr(result), *(f"{'  ' * len(s.path)}{s}" for s in result.plan.walk())])


def query(folder: Path, name: str, sparql: str, seconds: float) -> str:
    """Return the result of a query: the column names and the rows as tab-separated lines."""
    from confab.reasoner.graph.query_process import QueryLimits

    if "{" not in sparql:
        raise KnowledgeError("wanted a SPARQL query as text, e.g. SELECT ?o ?l WHERE { ?o k:location ?l }")
    table = scene_of(folder, name).query(sparql, QueryLimits(seconds=seconds, rows=ROWS))
    if table.truth is not None:
        return str(table.truth).lower()
    return f"{table.tsv()}({len(table)} rows)"


def validate(folder: Path, name: str) -> str:
    """Return the number of errors in a scene, and each error with its cause and its remedy."""
    from confab.reasoner.validation.validate import validate as found

    path = ontology.scenes()[name] if name in ontology.scenes() else scene_of(folder, name).knowledge.path
    findings = found([path or inside(folder, name)])
    lines = [
        f"{Path(f.file).name}:{f.line}: {f.what} [{f.rule}]\n  why: {f.why}\n  do: {f.remedy}"
        for f in findings
        if f.serious
    ]
    return "\n".join([f"{len(lines)} errors", *lines])


def why(folder: Path, name: str, goals: Sequence[str], step: str, seconds: float) -> str:
    """Return the reasons why a step (by default each step) is in the plan, or the reason why there is no plan."""
    with within(seconds):
        result = planned(scene_of(folder, name), goals, (), "guarded", seconds)
        return (
            str(result.why(int(step) if step.isdigit() else step)) if step and result.solved else str(result.explain())
        )


def why_not(folder: Path, name: str, goals: Sequence[str], instead: str, seconds: float) -> str:
    """Return the reasons why an alternative isn't in the plan."""
    with within(seconds):
        return str(planned(scene_of(folder, name), goals, (), "guarded", seconds).why_not(instead))


def verify(folder: Path, name: str, goals: Sequence[str], rollouts: int, seed: int, seconds: float) -> str:
    """Execute the plan in physics. Return a summary, the primitives of one rollout with their verdicts, and the success rate."""
    if not 1 <= rollouts <= ROLLOUTS:
        raise KnowledgeError(f"got {rollouts} rollouts; wanted 1 to {ROLLOUTS}")
    with within(seconds):
        result = planned(scene_of(folder, name), goals, (), "guarded", seconds)
        if not result.solved:
            return str(result)
        report = result.verify(rollouts, seed, time_limit=seconds)
    return f"{report.summary()}\n{report.table().tsv()}{json.dumps(report.json()['success'])}"
