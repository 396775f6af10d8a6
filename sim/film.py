"""A film of a rollout: frames with a caption and a strip of the plan, as MP4 or GIF, and one still per primitive."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import imageio.v2 as imageio
import numpy as np
import pybullet
from PIL import Image, ImageDraw, ImageFont
from PIL.PngImagePlugin import PngInfo

from confab.reasoner.files import made_folder, write_whole, written_whole
from confab.reasoner.kinds import MAKER
from confab.sim.bodies import outline
from confab.sim.engine import NEAR_PLACE, Engine
from confab.sim.linkage import feature_frame
from confab.sim.picture import DOWN, Camera, hide_vessels, picture, view_of
from confab.sim.urdf import Array

if TYPE_CHECKING:
    from confab.reasoner.symbols import PrimitiveStep

SIZES = (17, 15, 13, 11)
"""Font sizes of the caption; the first size that fits is used."""

BAR = 46
"""Height in pixels of the bar at the bottom with caption and plan strip."""

NAMED = 480
"""Minimum width in pixels of a picture that shows names."""

SPEED = 2.5
"""Ratio of simulated time to the film's time."""

VIEWS = (
    (0.0, DOWN),
    *((around, DOWN) for around in (0.8, -0.8, 1.6, -1.6, 2.2, -2.2)),
    *((around, 0.08) for around in (1.6, -1.6, 2.2, -2.2)),
)
"""Directions of cameras: the angle in radians around the tables, and the tangent of the downward angle.

A primitive is shown by the camera that sees most of the primitive's objects.
"""

ABOVE = 0.01
"""A name is shown if a point at this height in metres above the place, or above the top of the object, is visible."""

NEARLY = 0.97
"""A camera sees a handle if its ray first hits the mechanism, and not before this share of the distance to the handle."""

FRONT = 0.12
"""Minimum distance in metres by which a thing in front of a place hides the name of the place."""

STACKED = 3
"""Number of rows in which names are stacked if they would overlap."""

DONE, DOING, TODO = (64, 120, 200), (245, 150, 40), (206, 213, 222)


class Film:
    """A film of a world, to be passed to `verify` as `watch`; close the film, or use it in a ``with`` statement.

    Parameters
    ----------
    path : str or Path
        ``.mp4`` or ``.gif``; its folder must exist.
    steps : sequence of PrimitiveStep
        The primitives that the plan strip shows.
    titles : mapping of path to text
        Captions of steps, by the path of the step in the plan's tree. Steps above the primitives are shown only if they have a
        caption.
    camera : Camera, optional
        By default, a camera that shows the table in pictures of `width` by `height` pixels, both divisible by 16. If the
        objects and handles of a primitive are hidden, a camera on another side of the table is used.
    frames : int
        Frames per second of the film.
    speed : float
        Ratio of simulated time to the film's time.
    stills : str or Path, optional
        Folder for PNG files: the picture at the end of each primitive.
    names : mapping of name to text, optional
        Displayed names of places and objects; others are displayed with their own names.
    """

    def __init__(
        self,
        path: str | Path,
        steps: Sequence[PrimitiveStep],
        titles: Mapping[tuple[int, ...], str] | None = None,
        camera: Camera | None = None,
        frames: int = 12,
        speed: float = SPEED,
        stills: str | Path | None = None,
        width: int = 960,
        height: int = 544,
        names: Mapping[str, str] | None = None,
    ) -> None:
        self.path, self.steps, self.titles = Path(path), steps, titles or {}
        self.camera, self.frames, self.speed = camera, frames, speed
        self._chosen = camera is not None
        self._views: list[Camera] = []
        self.width, self.height, self.names = width, height, names or {}
        self.stills = None if stills is None else made_folder(stills)
        self._part = self.path
        self._file = ExitStack()
        self._writer: Any = None
        self._number = -1
        self._latest: Array | None = None

    def __enter__(self) -> Film:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        elif self._writer is not None:
            writer, self._writer = self._writer, None
            writer.close()
            self._file.__exit__(kind, error, trace)  # removes the unfinished film

    def __call__(self, world: Engine) -> None:
        """Take a frame if the next frame is due, and count the CPU time as rendering."""
        begin = time.process_time()
        self._take(world)
        world.clock.rendering += time.process_time() - begin

    def _take(self, world: Engine) -> None:
        if world.current != self._number:
            if self._number < 0:
                hide_vessels(world)
            self._keep()
            self._number = world.current
            if not self._chosen:
                self._turn_to_action(world)
        if world.steps % max(1, round(world.rate * self.speed / self.frames)) == 0:
            self._latest = self.frame(world)
            self._write(self._latest)

    def frame(self, world: Engine) -> Array:
        """Return the present picture with its caption."""
        if self.camera is None:
            self._turn_to_action(world)
        assert self.camera is not None
        return self._caption(self._named(picture(world, self.camera), world), world.current)

    def _turn_to_action(self, world: Engine) -> None:
        """Choose the camera that sees most objects of the present primitive; of equally good cameras, keep the present camera."""
        if not self._views:
            size = self.width, self.height, BAR
            self._views = [view_of(world.embodiment, *size, around, down) for around, down in VIEWS]
        current = self.camera or self._views[0]
        points: list[tuple[Array, str]] = []
        if 0 <= world.current < len(self.steps):
            step = self.steps[world.current]
            points = [point for name in (*step.arguments, *step.bindings.values()) for point in _points(world, name)]
        seen = {id(view): sum(_visible(world, view, point, name) for point, name in points) for view in self._views}
        best = max(self._views, key=lambda view: seen[id(view)])
        self.camera = best if seen[id(best)] > seen.get(id(current), 0) else current

    def close(self) -> None:
        """Finish the film, and move the file to the film's path."""
        self._keep()
        if self._writer is None:
            return
        self._writer.close()
        self._writer = None
        if self.path.suffix == ".gif":
            film, maker = self._part.read_bytes(), MAKER.encode()
            self._part.write_bytes(b"%b!\xfe%c%b\0;" % (film[:-1], len(maker), maker))  # a comment before the trailer
        self._file.close()

    def _keep(self) -> None:
        """Save the latest frame as the picture of the primitive that has ended."""
        if self.stills is None or self._latest is None or not 0 <= self._number < len(self.steps):
            return
        step = self.steps[self._number]
        name = "-".join((f"{self._number + 1:02d}", step.behavior, *step.arguments))
        drawn, made = BytesIO(), PngInfo()
        made.add_text("Software", MAKER)
        Image.fromarray(self._latest).save(drawn, "png", pnginfo=made)
        write_whole(self.stills / f"{name}.png", drawn.getvalue())

    def _write(self, image: Array) -> None:
        if self._writer is None:
            options: dict[str, Any] = {"duration": 1000 / self.frames, "loop": 0}
            if self.path.suffix != ".gif":
                options = {"fps": self.frames, "codec": "libx264", "quality": 8, "macro_block_size": 16}
                options["output_params"] = ["-metadata", f"comment={MAKER}"]
            self._part = self._file.enter_context(written_whole(self.path, self.path.suffix))
            self._writer = imageio.get_writer(self._part, **options)
        self._writer.append_data(image)

    def _named(self, image: Array, world: Engine) -> Array:
        """Write the names of visible places below the places and the names of visible objects above the objects."""
        if self.width < NAMED or self.camera is None:
            return image
        canvas = Image.fromarray(image)
        draw, font = ImageDraw.Draw(canvas, "RGBA"), ImageFont.load_default(12)
        taken: list[tuple[float, float, float, float]] = []
        for name in (*world.bodies, *world.embodiment.places):
            points = _points(world, name)
            if _covered(world, name) or not any(_visible(world, self.camera, point, name) for point, _ in points):
                continue
            x, y = self.camera.pixel(points[0][0])
            words, thing = self.names.get(name, name), name in world.bodies
            half = draw.textlength(words, font=font) / 2 + 4
            rows = [y - 24 - 18 * row for row in range(STACKED)] if thing else [y + 8]
            boxes = ((x - half, row, x + half, row + 16) for row in rows)
            box = next((box for box in boxes if not _meets(box, taken)), None)
            if box is None or (not thing and _shines_through(world, self.camera, box, points[0][0])):
                continue
            taken.append(box)
            draw.rounded_rectangle(box, 4, fill=(40, 50, 70, 190) if thing else (250, 251, 253, 110))
            color = (250, 251, 253, 255) if thing else (60, 40, 20, 255)
            draw.text((x, (box[1] + box[3]) / 2), words, fill=color, font=font, anchor="mm")
        return np.asarray(canvas)

    def _caption(self, image: Array, number: int) -> Array:
        """Write the present primitive and its parent steps below the picture, with the strip of all primitives."""
        height, width = image.shape[:2]
        canvas = Image.fromarray(image)
        draw = ImageDraw.Draw(canvas)
        draw.rectangle((0, height - BAR, width, height), fill=(250, 251, 253))
        if 0 <= number < len(self.steps):
            step = self.steps[number]
            above = [self.titles[step.path[:n]] for n in range(1, len(step.path)) if step.path[:n] in self.titles]
            own = self.titles.get(step.path) or " ".join((str(step.id), step.behavior, *step.arguments))
            _write_row(draw, [*above, own], width, height - BAR + 7)
        self._strip(draw, width, height, number)
        return np.asarray(canvas)

    def _strip(self, draw: ImageDraw.ImageDraw, width: int, height: int, number: int) -> None:
        """Draw a small bar per primitive, with a gap before each step of the top level."""
        tops = [step.path[0] for step in self.steps]
        gaps = [i for i in range(1, len(tops)) if tops[i] != tops[i - 1]]
        unit = (width - 28 - 10 * len(gaps)) / max(len(self.steps), 1)
        x = 14.0
        for i in range(len(self.steps)):
            x += 10 if i in gaps else 0
            color = DONE if i < number else DOING if i == number else TODO
            draw.rectangle((x, height - 13, x + unit - 2, height - 7), fill=color)
            x += unit


def _points(world: Engine, name: str) -> list[tuple[Array, str]]:
    """Return the points that show a place, an object or a link, each with a name; no points for other individuals."""
    if name in world.embodiment.places:
        return [(world.place(name) + np.array([0.0, 0.0, ABOVE]), name)]
    if name in world.bodies:
        turn, base = world.truth(name)
        height = float(outline(world.bodies[name].shape)[0][-1])
        return [(base + turn[:, 2] * (height + ABOVE), name), (base + turn[:, 2] * height / 2, name)]
    if name in world.links:
        mechanic = world.links[name]
        link = next((one for one in mechanic.mechanism.links if one.name == name), None)
        features = link.features.values() if link is not None else ()
        return [(feature_frame(mechanic.frame(name), feature)[1], name) for feature in features]
    return []


def _visible(world: Engine, camera: Camera, point: Array, name: str) -> bool:
    """Return whether a camera sees a point of `name`; only the thing itself, or an object at this place, may cover the point."""
    hit = pybullet.rayTest(camera.eye, point.tolist(), physicsClientId=world.client)[0]
    if hit[0] < 0:
        return True
    if name in world.links:
        return bool(hit[0] == world.links[name].body and hit[2] > NEARLY)
    met = world.name_of(hit[0], hit[1])
    there = name in world.embodiment.places and met in world.bodies
    return met == name or (there and float(np.linalg.norm(world.truth(met)[1] - world.place(name))) < NEAR_PLACE)


def _shines_through(world: Engine, camera: Camera, box: tuple[float, float, float, float], point: Array) -> bool:
    """Return whether the middle of a name would be on something that is well in front of the named point."""
    row, column = round((box[1] + box[3]) / 2), round((box[0] + box[2]) / 2)
    if not (0 <= row < camera.height and 0 <= column < camera.width):
        return False
    away = float(camera.axes[2] @ (point - np.array(camera.eye))) - FRONT
    end = np.array(camera.eye) + camera.rays[row, column] * away
    return bool(pybullet.rayTest(camera.eye, end.tolist(), physicsClientId=world.client)[0][0] >= 0)


def _covered(world: Engine, name: str) -> bool:
    """Return whether a place on an object is occupied, so that the place's name would hide both objects."""
    place = world.embodiment.places.get(name)
    return (
        place is not None
        and place.carrier in world.bodies
        and any(
            float(np.linalg.norm(world.truth(body)[1] - world.place(name))) < NEAR_PLACE
            for body in world.bodies.keys() - {place.carrier}
        )
    )


def _meets(box: tuple[float, float, float, float], others: Sequence[tuple[float, float, float, float]]) -> bool:
    """Return whether a rectangle overlaps one of `others`."""
    left, top, right, bottom = box
    return any(left < r and right > x and top < b and bottom > y for x, y, r, b in others)


def _write_row(draw: ImageDraw.ImageDraw, texts: Sequence[str], width: int, y: float) -> None:
    """Write texts side by side in the largest font size that fits, and the last text in a dark colour.

    If no size fits, the longest text before the last one is shortened.
    """
    gap, texts = 26, list(texts)
    for size in SIZES:
        font = ImageFont.load_default(size)
        lengths = [draw.textlength(text, font=font) for text in texts]
        if sum(lengths) + gap * len(texts) < width:
            break
    while len(texts) > 1 and sum(lengths) + gap * len(texts) >= width:
        longest = max(range(len(texts) - 1), key=lambda number: lengths[number])
        if len(texts[longest]) < 2:
            break
        texts[longest] = texts[longest].rstrip("…")[:-1] + "…"
        lengths[longest] = draw.textlength(texts[longest], font=font)
    x = 14.0
    for text, length in zip(texts, lengths, strict=True):
        own = text is texts[-1]
        draw.text((x, y), text, font=font, fill=(30, 36, 46) if own else (120, 130, 145))
        if not own:
            draw.text((x + length + 9, y), "›", font=font, fill=(170, 178, 190))
        x += length + gap
