"""Pictures of a scene: the initial state, a behaviour with conditions and effects, or the classes of objects."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, suppress
from io import BytesIO
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

from confab.reasoner.embodiment.reach import reach_relation
from confab.reasoner.files import write_whole
from confab.reasoner.graph.knowledge import KnowledgeError, text
from confab.reasoner.kinds import MAKER
from confab.reasoner.names import local_name
from confab.reasoner.reading.quantification import behavior_named

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from confab.known import Known
    from confab.sim.urdf import Array
    from confab.sim.world import PhysicsWorld

KINDS = (".png", ".svg", ".pdf")
MOST_ROWS, DEEPEST = 500, 100
"""Maximum number of rows, and maximum depth of nested classes, in a diagram."""
REACHED, UNREACHED = (30, 140, 60), (200, 40, 40)
VIEWPOINT = "seen from across the table: the robot's left is on the right"
GREEN, BLUE, ORANGE, GREY = "#e5f3e5", "#e3ecf7", "#fbeedb", "#f1f1f1"
PARTS = """SELECT DISTINCT ?behavior ?part ?label WHERE {{
  ?behavior :{property} ?part . OPTIONAL {{ ?part rdfs:label ?label }}
}} ORDER BY ?part"""
LABEL = "SELECT ?behavior ?label WHERE { ?behavior rdfs:label ?label } ORDER BY ?label"
CLASSES = """SELECT DISTINCT ?class ?above WHERE {
  ?class a owl:Class ; rdfs:subClassOf+ :Object ; rdfs:subClassOf ?above .
  ?above rdfs:subClassOf* :Object . FILTER(isIRI(?class) && isIRI(?above))
} ORDER BY ?above ?class"""
SITUATIONS = (
    "SELECT DISTINCT ?class ?situation WHERE { ?class :hasSituationType ?situation } ORDER BY ?class ?situation"
)


def draw(scene: Known, path: Path, behavior: str | None = None, classes: bool = False) -> Path:
    """Draw a picture of a scene into a file, and return the file's path.

    By default the picture shows the table with its places, and the hands that reach each place.

    Parameters
    ----------
    scene : Scene
    path : Path
        The file, whose suffix is ``.png``, or for a diagram also ``.svg`` or ``.pdf``.
    behavior : str, optional
        Draw a diagram of this behaviour with its conditions and effects.
    classes : bool
        Draw a diagram of the classes of objects with their situation types.

    Raises
    ------
    KnowledgeError
        The format isn't supported, the behaviour is unknown, or the scene has no geometry.
    """
    diagram = behavior is not None or classes
    wanted = KINDS if diagram else KINDS[:1]
    if path.suffix.lower() not in wanted:
        raise KnowledgeError(f"{path}: can't draw into '{path.suffix}'; wanted {' or '.join(wanted)}")
    if behavior is not None and classes:
        raise KnowledgeError("--behavior and --classes exclude each other; give one")
    if not diagram:
        return _table(scene, path)
    with words_as_they_are():
        return save(class_tree(scene) if behavior is None else card(scene, behavior), path)


def words_as_they_are() -> AbstractContextManager[None]:
    """Return a context in which matplotlib draws ``$`` as a character, and not as the beginning of a formula."""
    from matplotlib import rc_context

    return rc_context({"text.parse_math": False})


def save(figure: Figure, path: Path, dpi: int = 100) -> Path:
    """Write a figure into a file atomically, in the format of the path's suffix, and return the path."""
    drawn = BytesIO()
    form = path.suffix[1:].lower()
    figure.savefig(drawn, dpi=dpi, format=form, metadata={"Software" if form == "png" else "Creator": MAKER})
    write_whole(path, drawn.getvalue())
    return path


def card(scene: Known, name: str) -> Figure:
    """Return a diagram of a behaviour between its preconditions and its effects, all of them as sentences."""
    from matplotlib.figure import Figure

    behavior = behavior_named(scene.reading, name)
    iri = scene.names.iri(behavior.name)
    before, after = (_parts(scene, iri, which) for which in ("precondition", "postcondition"))
    high = max(len(before), len(after), 3)
    if high > MOST_ROWS:
        raise KnowledgeError(
            f"{behavior.name} has {high} conditions or effects, too many to draw (at most {MOST_ROWS})"
        )
    figure = Figure(figsize=(10, 0.62 * high + 0.6), layout="constrained")
    axes = _blank(figure)
    chosen = ", ".join(f"{p.name.lstrip('?')} ({p.kind})" for p in behavior.parameters)
    given = ", ".join(f"{v.name.lstrip('?')} ({v.kind})" for v in behavior.variables)
    label = next((text(row[1]) for row in scene.knowledge.select(LABEL, behavior=iri)), "")
    words = [behavior.name, fill(label, 30), "", fill(f"one chooses: {chosen}", 34)]
    words += [fill(f"the situation gives: {given}", 34)] if given else []
    middle = (0.5, high / 2)
    _box(axes, *middle, "\n".join(words), ORANGE, 9)
    for parts, x, color in ((before, 0.13, BLUE), (after, 0.87, GREEN)):
        for number, part in enumerate(parts):
            y = high / 2 + (number - (len(parts) - 1) / 2)
            ends = ((x, y), middle) if x < 0.5 else (middle, (x, y))
            axes.annotate("", ends[1], ends[0], arrowprops={"arrowstyle": "->", "color": "0.6"}, zorder=0)
            _box(axes, x, y, fill(part, 28), color, 9)
    axes.text(0.13, -0.45, "what has to hold", ha="center", color="0.4", fontsize=9)
    axes.text(0.87, -0.45, "what it changes", ha="center", color="0.4", fontsize=9)
    axes.set_ylim(high - 0.3, -0.7)
    return figure


def class_tree(scene: Known) -> Figure:
    """Return a diagram of the classes of objects from left to right, each class with its situation types."""
    from matplotlib.figure import Figure

    below: dict[str, list[str]] = {}
    for above, child in _reduced(
        [(text(row[1]), text(row[0])) for row in scene.knowledge.select(CLASSES, ["asserted"])]
    ):
        below.setdefault(above, []).append(child)
    situations: dict[str, list[str]] = {}
    for row in scene.knowledge.select(SITUATIONS):
        situations.setdefault(text(row[0]), []).append(local_name(text(row[1])))
    defined: set[str] = set()
    with suppress(KnowledgeError):  # also draws the classes of scenes without a valid planning problem
        defined |= {local_name(scene.names.iri(name)) for name in scene.reading.problem.domain.rules}
    root = next((iri for iri in below if local_name(iri) == "Object"), None)
    if root is None:
        raise KnowledgeError(f"{scene.iri} has no classes of objects to draw")
    spots: dict[str, tuple[int, float]] = {}

    def put(iri: str, depth: int, row: float) -> float:
        start, spots[iri] = row, (depth, row)
        if depth > DEEPEST or row > MOST_ROWS:
            raise KnowledgeError(
                f"{scene.iri} has too many classes to draw (at most {MOST_ROWS} rows, {DEEPEST} below one another)"
            )
        for child in below.get(iri, ()):
            row = put(child, depth + 1, row) if child not in spots else row
        row = max(row, start + 1)
        spots[iri] = (depth, (start + row - 1) / 2)
        return row

    rows = put(root, 0, 0)
    deep = max(depth for depth, _ in spots.values())
    figure = Figure(figsize=(2.9 * (deep + 1), 0.6 * rows + 0.3), layout="constrained")
    axes = _blank(figure)
    for iri, (depth, y) in spots.items():
        x = (depth + 0.5) / (deep + 1)
        for child in below.get(iri, ()):
            to = ((spots[child][0] + 0.5) / (deep + 1), spots[child][1])
            axes.plot([x, to[0]], [y, to[1]], color="0.7", linewidth=1, zorder=0)
        own = situations.get(iri, [])
        changed, follows = ([one for one in own if (one in defined) is which] for which in (False, True))
        words = "\n".join([local_name(iri), *([", ".join(changed)] * bool(changed))])
        words += f"\nfollows: {', '.join(follows)}" if follows else ""
        _box(axes, x, y, "\n".join(fill(line, 32) for line in words.splitlines()), BLUE if own else GREY, 8)
    axes.set_ylim(rows - 0.5, -0.5)
    return figure


def _reduced(pairs: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return the pairs of a class and a direct subclass; other pairs, which reasoners write into files, are left out."""
    import networkx

    graph: networkx.DiGraph[str] = networkx.DiGraph(pair for pair in pairs if pair[0] != pair[1])
    if not networkx.is_directed_acyclic_graph(graph):  # the scene has equivalent classes
        return list(pairs)
    direct = set(networkx.transitive_reduction(graph).edges)
    return [pair for pair in pairs if pair in direct]


def _parts(scene: Known, iri: str, which: str) -> list[str]:
    rows = scene.knowledge.select(PARTS.format(property=which), behavior=iri)
    return [text(row[2]) or local_name(text(row[1])) for row in rows]


def _blank(figure: Figure) -> Axes:
    axes: Axes = figure.subplots()
    axes.set_axis_off()
    axes.set_xlim(0, 1)
    return axes


def _box(axes: Axes, x: float, y: float, words: str, color: str, size: int) -> None:
    axes.text(
        x,
        y,
        words,
        ha="center",
        va="center",
        fontsize=size,
        bbox={"boxstyle": "round,pad=0.4", "facecolor": color, "edgecolor": "0.5", "linewidth": 0.8},
    )


def _top(world: PhysicsWorld, name: str) -> Array:
    """Return the middle of a body's top face, in metres in the world frame."""
    from confab.sim.bodies import outline

    rotation, base = world.truth(name)
    top: Array = base + rotation[:, 2] * float(outline(world.bodies[name].shape)[0][-1])
    return top


def _table(scene: Known, path: Path) -> Path:
    """Draw the table in the initial state. If only some hands reach a place, the place is labelled with these hands."""
    from PIL import Image, ImageDraw, ImageFont
    from PIL.PngImagePlugin import PngInfo

    from confab.reaching import with_reach
    from confab.sim.picture import hide_vessels, picture, view_of
    from confab.sim.world import PhysicsWorld

    if not scene.embodiment.places:
        raise KnowledgeError(
            f"{scene.iri} has no places with coordinates, so there is no table; draw its classes (classes=True) or a behaviour"
        )
    scene = with_reach(scene)
    reached = scene.problem.relations.get(local_name(reach_relation(scene.knowledge)), frozenset())
    try:
        world = PhysicsWorld(scene.embodiment, scene.problem.initial)
    except (ValueError, RuntimeError) as error:
        raise KnowledgeError(str(error)) from error
    with world:
        camera = view_of(scene.embodiment, 800, 448)
        hide_vessels(world)
        image = Image.fromarray(picture(world, camera))
        tops = {name: _top(world, name) for name in world.bodies}
        spots = {name: world.place(name) for name in scene.embodiment.places}
    every = [hand for robot in scene.embodiment.robots for hand in robot.hands]
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(12)
    for place in scene.embodiment.places.values():
        x, y = camera.pixel(spots[place.name])
        hands = sorted(hand for hand, *rest in reached if rest == [place.name])
        who = ", ".join(hands) if len(hands) < len(every) else ""
        words = f"{place.name}: {who or 'no hand'}" if who or not hands else place.name
        pen.ellipse((x - 4, y - 4, x + 4, y + 4), fill=REACHED if hands else UNREACHED)
        width = pen.textlength(words, font=font)
        pen.rectangle((x - width / 2 - 3, y + 6, x + width / 2 + 3, y + 22), fill=(250, 251, 253))
        pen.text((x - width / 2, y + 7), words, font=font, fill=(30, 36, 46))
    for name, top in tops.items():
        x, y = camera.pixel(top)
        width = pen.textlength(name, font=font)
        pen.rectangle((x - width / 2 - 3, y - 22, x + width / 2 + 3, y - 6), fill=(60, 72, 92))
        pen.text((x - width / 2, y - 21), name, font=font, fill=(250, 251, 253))
    pen.rectangle((0, 0, pen.textlength(VIEWPOINT, font=font) + 12, 18), fill=(250, 251, 253))
    pen.text((6, 2), VIEWPOINT, font=font, fill=(30, 36, 46))
    drawn = BytesIO()
    made = PngInfo()
    made.add_text("Software", MAKER)
    image.save(drawn, "png", optimize=True, pnginfo=made)
    write_whole(path, drawn.getvalue())
    return path
