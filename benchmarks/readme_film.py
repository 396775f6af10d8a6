"""The animation in README.md, made from the film of the shipped plan by `python -m benchmarks.readme_film`."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
from PIL import Image

import confab

TARGET = Path(__file__).resolve().parents[1] / "docs" / "pictures" / "serving.webp"
SIZE, EVERY, QUALITY = (840, 476), 2, 68
"""Width and height in pixels, step between the used frames, and quality of WebP, for an animation of less than 1 MB."""


def main() -> None:
    """Verify the shipped plan in physics, film it, and write the animation."""
    with tempfile.TemporaryDirectory() as folder:
        film = Path(folder) / "serving.mp4"
        report = confab.load("beverage-serving").plan().verify(seed=0, video=film)
        assert report.verified, report
        reader: Any = imageio.get_reader(film)
        frames = [Image.fromarray(frame).resize(SIZE) for i, frame in enumerate(reader) if i % EVERY == 0]
    pause = round(1000 * EVERY / 12)
    frames[0].save(TARGET, save_all=True, append_images=frames[1:], duration=pause, loop=0, quality=QUALITY, method=6)
    print(f"{TARGET.name}: {len(frames)} frames, {TARGET.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
