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
from PIL import Image, ImageDraw, ImageFont
from PIL.PngImagePlugin import PngInfo

from confab.reasoner.files import write_whole, written_whole
from confab.reasoner.kinds import MAKER
from confab.sim.bodies import outline
from confab.sim.engine import Engine
from confab.sim.picture import Camera, hide_vessels, picture, view_of
from confab.sim.urdf import Array

if TYPE_CHECKING:
    from confab.sim.world import PrimitiveStep

SIZES = (17, 15, 13, 11)
"""Font sizes of the caption, of which the first that fits is used."""

BAR = 46
"""Height in pixels of the bar at the bottom with caption and plan strip."""

NAMED = 480
"""Minimum width in pixels of a picture with names."""

SPEED = 2.5
"""Ratio of simulated time to the film's time."""

DONE, DOING, TODO = (64, 120, 200), (245, 150, 40), (206, 213, 222)


class Film:
    """A film of a world: pass it to `verify` as `watch`, and close it, or use it in a ``with`` statement.

    Parameters
    ----------
    path : str or Path
        ``.mp4`` or ``.gif``; its folder must exist.
    steps : sequence of PrimitiveStep
        The primitives, for the plan strip.
    titles : mapping of path to text
        Captions of steps by their position in the plan's tree. Steps above the primitives without a caption are left out.
    camera : Camera, optional
        By default one that looks at the table, with pictures of `width` by `height` pixels (divisible by 16).
    frames : int
        Frames per second of the film.
    speed : float
        Ratio of simulated time to the film's time.
    stills : str or Path, optional
        Folder for a PNG per primitive, taken at its end.
    names : mapping of name to text, optional
        Displayed names of places and objects; the others keep their own.
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
        self.width, self.height, self.names = width, height, names or {}
        self.stills = None if stills is None else Path(stills)
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
            self._file.__exit__(kind, error, trace)  # which removes what was filmed

    def __call__(self, world: Engine) -> None:
        """Take a frame if one is due, and count its CPU time as rendering."""
        begin = time.process_time()
        self._take(world)
        world.clock.rendering += time.process_time() - begin

    def _take(self, world: Engine) -> None:
        if world.current != self._number:
            if self._number < 0:
                hide_vessels(world)
            self._keep()
            self._number = world.current
        if world.steps % max(1, round(world.rate * self.speed / self.frames)) == 0:
            self._latest = self.frame(world)
            self._write(self._latest)

    def frame(self, world: Engine) -> Array:
        """Return the present picture with its caption."""
        self.camera = self.camera or view_of(world.embodiment, self.width, self.height, BAR)
        return self._caption(self._named(picture(world, self.camera), world), world.current)

    def close(self) -> None:
        """Finish the film and move it to its path."""
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
        """Save the latest frame as the still of the primitive that has ended."""
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
        """Write the names of places below them, and of objects above them."""
        if self.width < NAMED or self.camera is None:
            return image
        canvas = Image.fromarray(image)
        draw, font = ImageDraw.Draw(canvas, "RGBA"), ImageFont.load_default(12)
        for place in world.embodiment.places.values():
            x, y = self.camera.pixel(world.place(place.name))
            draw.text(
                (x, y + 8), self.names.get(place.name, place.name), fill=(60, 40, 20, 200), font=font, anchor="mt"
            )
        for name, thing in world.bodies.items():
            turn, base = world.truth(name)
            x, y = self.camera.pixel(base + turn[:, 2] * float(outline(thing.shape)[0][-1]))
            words = self.names.get(name, name)
            half = draw.textlength(words, font=font) / 2 + 4
            draw.rounded_rectangle((x - half, y - 24, x + half, y - 8), 4, fill=(40, 50, 70, 190))
            draw.text((x, y - 16), words, fill=(250, 251, 253, 255), font=font, anchor="mm")
        return np.asarray(canvas)

    def _caption(self, image: Array, number: int) -> Array:
        """Write the present primitive, with its parents, and the strip of all primitives below the picture."""
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
        """Draw a small bar per primitive, with a gap wherever a step of the top level begins."""
        tops = [step.path[0] for step in self.steps]
        gaps = [i for i in range(1, len(tops)) if tops[i] != tops[i - 1]]
        unit = (width - 28 - 10 * len(gaps)) / max(len(self.steps), 1)
        x = 14.0
        for i in range(len(self.steps)):
            x += 10 if i in gaps else 0
            color = DONE if i < number else DOING if i == number else TODO
            draw.rectangle((x, height - 13, x + unit - 2, height - 7), fill=color)
            x += unit


def _write_row(draw: ImageDraw.ImageDraw, texts: Sequence[str], width: int, y: float) -> None:
    """Write texts side by side, the last one dark, in the largest size that fits."""
    gap = 26
    for size in SIZES:
        font = ImageFont.load_default(size)
        lengths = [draw.textlength(text, font=font) for text in texts]
        if sum(lengths) + gap * len(texts) < width:
            break
    x = 14.0
    for text, length in zip(texts, lengths, strict=True):
        own = text is texts[-1]
        draw.text((x, y), text, font=font, fill=(30, 36, 46) if own else (120, 130, 145))
        if not own:
            draw.text((x + length + 9, y), "›", font=font, fill=(170, 178, 190))
        x += length + gap
