"""Bodies that are written in Turtle from the guide alone, in rollouts with random deviations and noise.

    python -m benchmarks.authored FROM TO [NAME …]

Each file of the folder ``tests/sim/right``, or each named file, is planned and executed with the seeds FROM to TO - 1, without
noise and with noise of 4 mm. The table has the number of verified rollouts, the lines of Turtle, and the effects that no
perceiver reads.
"""

from __future__ import annotations

import sys
from pathlib import Path

from confab.reaching import with_reach
from confab.scene import Scene, load_text

FILES = Path(__file__).parents[1] / "tests" / "sim" / "right"

NOISES = (0.0, 0.004)
"""Standard deviations in metres of perceived positions."""


def row(name: str, scene: Scene, begin: int, end: int) -> tuple[str, int]:
    """Return the line of a body in the table, and the number of verified rollouts; print each failure."""
    plan = scene.plan()
    cells, verified, trusted = [], 0, set[str]()
    for noise in NOISES:
        report = scene.verify(plan, end - begin, begin, perturb=True, noise=noise)
        good = sum(rollout.ok and not report.missed(rollout) for rollout in report.rollouts)
        cells.append(f"{good} of {end - begin}")
        verified += good
        trusted |= {*report.trusted}
        for rollout in report.rollouts:
            if rollout.failure is not None:
                print(f"{name}, {noise * 1000:.0f} mm, seed {rollout.seed}: {rollout.failure.verdict}", file=sys.stderr)
    lines = len((FILES / f"{name}.ttl").read_text(encoding="utf-8").splitlines())
    told = ", ".join(sorted(trusted)) or "nothing"
    return f"| {name} | {lines} | {len(plan.plan.primitives)} | {' | '.join(cells)} | {told} |", verified


def main() -> None:
    """Print the table and the total."""
    begin, end, *names = sys.argv[1:]
    print("| body | lines | primitives | 0 mm | 4 mm | on trust |\n|---|---|---|---|---|---|", flush=True)
    total, verified = 0, 0
    for name in names or sorted(file.stem for file in FILES.glob("*.ttl") if not file.stem.endswith(".reach")):
        scene = load_text((FILES / f"{name}.ttl").read_bytes())
        line, good = row(name, with_reach(scene), int(begin), int(end))
        total, verified = total + len(NOISES) * (int(end) - int(begin)), verified + good
        print(line, flush=True)
    print(f"\n{verified} of {total} rollouts are verified.")


if __name__ == "__main__":
    main()
