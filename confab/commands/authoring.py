"""Commands for authors of scenes and domains: new, fetch, picture, validate, generate, convert, import, export."""

from __future__ import annotations

import sys
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from confab.commands.given import PDDL, load_scene, plan_in
from confab.commands.given import SCENE as A_SCENE
from confab.commands.options import (
    AS_JSON,
    GOALS,
    PATH,
    QUIET,
    SCENE,
    SEED,
    TIME_LIMIT,
    Input,
    Output,
    Text,
    command,
    output_option,
    scene_argument,
)
from confab.examples import examples
from confab.progress import progress
from confab.reasoner.kinds import CONVERTED, GENERATED, IMPORTED, PICTURE, PLAN, TRAJECTORIES
from confab.terminal import NO, YES, limited, remark, show_result, told

if TYPE_CHECKING:
    from confab.scene import Scene


@command(epilog=examples("new"))
@click.argument("domain", metavar="DOMAIN", help="Name of the domain: letters, digits, _ or -.")
@click.option(
    "-o", "--output", "--folder", "folder", type=PATH, metavar="DIR", help="Folder to write into; default: DOMAIN."
)
@click.option(
    "--bodies", is_flag=True, help="Add shapes, a table and skills, so that 'confab run' executes plans in physics."
)
def new(domain: str, folder: Path | None, bodies: bool) -> None:
    """Write a commented skeleton of a new domain."""
    from confab import authoring

    files = authoring.new_domain(domain, folder, bodies)
    scene = quote(str(next(file for file in files if file.stem.endswith("-scene"))))
    then = "run" if bodies else "plan"
    show_result(
        "\n".join([*map(str, files), f"next: confab validate {scene}; confab {then} {scene}; docs/authoring.md"])
    )


@command(epilog=examples("fetch"))
@click.argument("url", metavar="URL", help="IRI of an ontology on the web.")
@click.option(
    "-o",
    "--output",
    "--into",
    "folder",
    type=PATH,
    default=Path(),
    metavar="DIR",
    help="Folder of the file that imports it.",
)
def fetch(url: str, folder: Path) -> None:
    """Download an ontology that a file imports by URL."""
    from confab.reasoner.graph.fetching import fetch as fetch_ontology

    fetched = fetch_ontology(url, folder)
    show_result(
        "\n".join([f"{fetched.file}, named in {fetched.catalog}", *(f"it imports {iri}" for iri in fetched.imports)])
    )


@command(epilog=examples("picture"))
@SCENE
@output_option(type=Output(PICTURE), required=True, metavar="FILE.png", help="File to draw into.")
@click.option("--behavior", metavar="BEHAVIOR", help="Draw the conditions and effects of this behaviour.")
@click.option("--classes", is_flag=True, help="Draw the classes of objects.")
def picture(scene: str, out: Path, behavior: str | None, classes: bool) -> None:
    """Draw the table with its places, a behaviour, or the classes."""
    from confab.picturing import draw

    print(draw(load_scene(scene), out, behavior, classes))


@command(epilog=examples("validate"))
@scene_argument("files", metavar="FILE…", help="Ontology files, or names of shipped scenes.", nargs=-1, required=True)
@click.option("--deep", is_flag=True, help="Also find contradictions with HermiT; needs Java.")
@click.option("--strict", is_flag=True, help="Count a warning as an error: exit 1.")
@click.option("--watch", is_flag=True, help="Validate again after each change of a file, until Ctrl-C.")
@TIME_LIMIT
@AS_JSON
@QUIET
def validate(
    files: tuple[str, ...], deep: bool, strict: bool, watch: bool, time_limit: float | None, as_json: bool
) -> None:
    """Validate ontologies, and print faults with their remedies."""
    from confab.watching import again_and_again

    code = _validated(files, deep, strict, time_limit, as_json)
    for _ in again_and_again(files) if watch else ():
        code = _validated(files, deep, strict, time_limit, as_json)
    raise Exit(code)


def _validated(files: tuple[str, ...], deep: bool, strict: bool, time_limit: float | None, as_json: bool) -> int:
    """Validate files, print the findings, and return the exit code."""
    from confab.reasoner.validation.findings import ERROR, WARNING, listing
    from confab.reasoner.validation.validate import STAGES
    from confab.reasoner.validation.validate import validate as check

    with limited(time_limit), progress("validating", len(files) * STAGES) as advance:
        findings = check(files, deep=deep, done=lambda what: advance(what, 1))
    errors, warnings = (sum(finding.severity == kind for finding in findings) for kind in (ERROR, WARNING))
    if as_json:
        show_result([finding.as_dict() for finding in findings])
    else:
        said = [listing(findings)] if findings else []
        show_result("\n".join([*said, *([] if errors or warnings else ["nothing is wrong"])]))
        if errors or warnings:
            from confab.memory import counted

            remark(f"{counted(errors, 'error')}, {counted(warnings, 'warning')}")
    sys.stdout.flush()
    return NO if errors or (strict and warnings) else YES


@command(epilog=examples("generate"))
@click.argument("family", metavar="FAMILY", help="served, swap, rotate, full, handover, blocked, random or unsolvable.")
@output_option(type=Output(GENERATED), required=True, metavar="SCENE.ttl", help="File to write.")
@click.option("--objects", type=int, default=4, metavar="N", help="Objects, half of them cups.")
@click.option("--hands", type=int, default=2, metavar="H", help="Hands.")
@click.option("--clutter", type=int, default=0, metavar="K", help="Irrelevant objects in other rooms.")
@SEED
def generate(family: str, out: Path, objects: int, hands: int, clutter: int, seed: int) -> None:
    """Generate a scene for trials as an ordinary ontology file."""
    from confab.reasoner.generate import write_scene

    write_scene(out, family, objects, hands, clutter, seed)
    told(out, f"a scene of the family {family}; plan in it with: confab plan {quote(str(out))}")


@command(epilog=examples("convert"))
@click.argument("file", type=Input(A_SCENE), metavar="FILE.ttl")
@click.option(
    "--behaviors",
    "form",
    type=click.Choice(["sparql", "individuals"]),
    default="sparql",
    help="Write each behaviour as one SPARQL update, or its conditions and effects as individuals.",
)
@output_option(type=Output(CONVERTED), metavar="FILE.ttl", help="File to write; by default the result is printed.")
def convert(file: Path, form: str, out: Path | None) -> None:
    """Write the behaviours of a file in another form."""
    from confab.reasoner.updates.converting import convert as converted

    found = converted(file, "sparql" if form == "sparql" else "individuals")
    if out is None:
        show_result(found.text.rstrip())
    else:
        from confab.reasoner.files import write_whole
        from confab.reasoner.kinds import stamped

        write_whole(out, stamped(CONVERTED, [found.text]))
        told(out, f"{len(found.behaviors)} behaviours written as {'updates' if form == 'sparql' else 'individuals'}")
    for note in found.notes:
        remark(note)


@command("import", epilog=examples("import"))
@click.argument("source", type=Text(PDDL), metavar="FILE.pddl|WORLD.yaml")
@click.argument(
    "problem",
    type=Input(PDDL),
    required=False,
    metavar="[OTHER.pddl]",
    help="The problem for a PDDL domain, or the domain for a PDDL problem.",
)
@output_option(type=Output(IMPORTED), required=True, metavar="SCENE.ttl", help="File to write.")
@click.option(
    "--level",
    type=click.IntRange(min=1),
    default=1,
    help="Level of the imported behaviours; abstract levels can be added above.",
)
@click.option(
    "--by", "query", metavar="QUERY.rq", help="The CONSTRUCT query that makes a scene from a foreign RDF file."
)
@TIME_LIMIT
def import_(
    source: str, problem: Path | None, out: Path, level: int, query: str | None, time_limit: float | None
) -> None:
    """Import a PDDL problem, or a robot's world model, as a scene.

    A robot's world model is given as INTERFACE:ADDRESS, or as a world file.
    """
    from confab.reasoner.graph.knowledge import KnowledgeError

    if problem is None and source.endswith(".pddl"):
        raise KnowledgeError(
            f"{source} is a domain or a problem alone; give both: confab import DOMAIN.pddl PROBLEM.pddl -o SCENE.ttl"
        )
    with limited(time_limit):
        if problem is None:
            from confab.world_import import scene_of_graph, scene_of_world

            count = scene_of_world(source, out) if query is None else scene_of_graph(Path(source), query, out)
            print(f"{out}: {count} individuals; plan in it with: confab plan {quote(str(out))} --goal FACT")
            return
        from confab.pddl_commands import import_pddl

        imported = import_pddl(Path(source), problem, out, level)
    behaviors, facts = len(imported.domain.behaviors), len(imported.initial)
    told(out, f"{behaviors} behaviours, {facts} facts; plan in it with: confab plan {quote(str(out))}")


@command(epilog=examples("export"))
@SCENE
@output_option(type=PATH, required=True, metavar="OUT", help="Folder, or file, to write.")
@click.option("--level", type=int, help="Level to export; by default the lowest.")
@click.option(
    "--trajectory", is_flag=True, help="Export the joint trajectories of a verified plan into a .json or .yaml file."
)
@click.option("--bt", "trees", is_flag=True, help="Export a plan as a behaviour tree (BehaviorTree.CPP 4, py_trees).")
@click.option(
    "--plan",
    type=Input(PLAN),
    metavar="PLAN.json",
    help="Plan for the trajectories or the tree; by default a new plan.",
)
@click.option("--both-hands", is_flag=True, help="Execute with all hands at once.")
@GOALS
@SEED
@TIME_LIMIT
def export(
    scene: str,
    out: Path,
    level: int | None,
    trajectory: bool,
    trees: bool,
    plan: Path | None,
    both_hands: bool,
    goal: tuple[str, ...],
    seed: int,
    time_limit: float | None,
) -> None:
    """Export a level as PDDL, or a plan as trajectories or a tree."""
    from confab.reasoner.graph.knowledge import KnowledgeError

    if trajectory and trees:
        raise KnowledgeError("--trajectory and --bt exclude each other; give one")
    if goal and not trees:
        raise KnowledgeError("--goal applies to behaviour trees; add --bt")
    if level is not None and (trajectory or trees):
        raise KnowledgeError("--level applies to PDDL only; trajectories and trees have primitives")
    if trajectory:
        from confab.reasoner.files import check_replaceable
        from confab.trajectories import FORMATS, trajectories, write_trajectories

        if out.suffix not in FORMATS:
            raise KnowledgeError(f"{out}: wanted a name that ends in {', '.join(FORMATS)}")
        check_replaceable(out, TRAJECTORIES)
        with limited(time_limit):
            loaded = load_scene(scene)
            data = trajectories(loaded, None if plan is None else plan_in(plan, loaded), seed, both_hands)
        write_trajectories(out, data)
        print(f"{out}: trajectories of {len(data['primitives'])} primitives, verified with seed {seed}")
        return
    if both_hands or (plan is not None and not trees):
        raise KnowledgeError("--plan and --both-hands apply to trajectories; add --trajectory")
    with limited(time_limit):
        if trees:
            paths = _exported_trees(load_scene(scene), plan, goal, out)
        else:
            from confab.pddl_commands import export_pddl, omitted_times

            problem = load_scene(scene).problem
            paths = export_pddl(problem, level, out)
            if omitted := omitted_times(problem, level):
                remark(omitted)
    for path in paths:
        print(path)


def _exported_trees(loaded: Scene, plan: Path | None, goal: tuple[str, ...], out: Path) -> tuple[Path, Path]:
    """Write the behaviour tree of a given plan or of a new plan."""
    from confab.trees import export_trees

    if goal:
        loaded = loaded.with_goal(*goal)
    if plan is not None:
        return export_trees(loaded.problem, plan_in(plan, loaded), out)
    with progress("planning"):
        result = loaded.plan()
    return export_trees(result.problem, result.plan, out)
