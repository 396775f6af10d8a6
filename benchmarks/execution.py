"""Execution in a closed loop: figure 8, random interventions, repair, learning from failure, and both hands at once.

``python -m benchmarks execution`` runs all parts, and ``python -m benchmarks.execution figure8 repair …`` runs the named parts.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random
from statistics import median
from time import perf_counter, process_time
from typing import Any

import confab
from benchmarks._gantt import save_gantt
from confab.execution import execute
from confab.labels import labels_of
from confab.planner.acting.episode import End, Episode, Intervention, InterventionKind
from confab.planner.acting.executive import act
from confab.planner.acting.failure_memory import Caution
from confab.planner.acting.repair import difference, repair_or_replan, replan
from confab.planner.acting.retries import RetryPolicy
from confab.planner.acting.symbolic_world import SymbolicWorld, disturbed, with_individual
from confab.planner.acting.world import WorldReport
from confab.planner.hierarchical.planner import compiled
from confab.planner.plan import Limits, Plan, Step
from confab.planner.plan_costs import cost_of
from confab.reasoner.generate import write_scene
from confab.reasoner.graph.knowledge import load
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import FALSE, Fact, SituationType, State, Symbol
from confab.scene import Scene
from worlds.trials import Trial, rest_after

KINDS = ("move", "remove", "add", "empty", "fill", "goal changed", "goal added", "goal dropped")
OUT = Path("confab-out/execution")
SYMBOLIC, PHYSICAL = 1000, 50
SYMBOLIC_ROBOTS, ROBOTS, EPISODES = 40, 3, 8


def served(objects: int) -> Problem:
    """Return the problem of a generated scene: each cup is to be moved and filled, and each bottle returned to its place."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"served-{objects}.ttl"
        write_scene(path, "served", objects)
        return read(load(path)).problem


def random_intervention(trial: Trial, random: Random, kind: str) -> tuple[int, Intervention]:
    """Return a random position in a plan, and a plausible intervention in the state at the position."""
    position = random.randrange(len(trial.plan.primitives))
    return position, _plausible(trial.problem, trial.states[position], random, kind)


def _plausible(problem: Problem, state: State, random: Random, kind: str) -> Intervention:
    """Return a plausible intervention in a state.

    Two situation types of the first level have values: the places of objects and the contents of vessels. The type for places
    has a value that exists only on lower levels, such as an object in the hand.
    """
    first = [s for s in problem.domain.situations.values() if s.level == 1 and not s.boolean]
    where = next(s for s in first if problem.value_levels.keys() & set(problem.classes[s.range]))
    content = next(s for s in first if s is not where)
    empty, drinks = _contents(problem, content)
    taken = {*state.values(), *problem.goal.values()}
    places = [v for v in problem.classes[where.range] if v not in problem.value_levels and v not in taken]
    movable = [o for o in problem.classes[where.arguments[0]] if Symbol(where.name, (o,)) in state]
    receivers = [s for s in problem.goal if s.situation == content.name and s in state]
    standing = [s for s in problem.goal if s.situation == where.name and s in state]
    one, place = Symbol(where.name, (random.choice(movable),)), random.choice(places)
    if kind == "move":
        return Intervention(InterventionKind.WORLD, (Fact(one, place),))
    if kind == "remove":
        return Intervention(InterventionKind.REMOVE, individual=one.arguments[0])
    if kind == "add":
        sort = min(
            (k for k, m in problem.classes.items() if one.arguments[0] in m), key=lambda k: len(problem.classes[k])
        )
        facts = (Fact(Symbol(where.name, ("newcomer",)), place), Fact(Symbol(content.name, ("newcomer",)), empty))
        return Intervention(InterventionKind.ADD, facts, individual="newcomer", kind=sort)
    if kind == "empty":
        return Intervention(InterventionKind.WORLD, (Fact(random.choice(receivers), empty),))
    if kind == "fill":
        return Intervention(InterventionKind.WORLD, (Fact(random.choice(receivers), random.choice(drinks)),))
    if kind == "goal changed":
        return Intervention(InterventionKind.GOAL, (Fact(random.choice(standing), place),))
    if kind == "goal added":
        free = [s for o in movable if (s := Symbol(where.name, (o,))) not in problem.goal]
        return (
            Intervention(InterventionKind.GOAL, (Fact(random.choice(free), place),))
            if free
            else (Intervention(InterventionKind.GOAL, (Fact(random.choice(receivers), random.choice(drinks)),)))
        )
    return Intervention(InterventionKind.DROP_GOAL, symbol=random.choice(sorted(problem.goal)))


def _contents(problem: Problem, content: SituationType) -> tuple[str, list[str]]:
    """Return the value that means empty, and the other values; the former belongs to no subclass of the range."""
    below = {v for k, m in problem.classes.items() if content.range in problem.parents.get(k, ()) for v in m}
    values = problem.classes[content.range]
    return next(v for v in values if v not in below), [v for v in values if v in below]


def timed(intervention: Intervention, trial: Trial, position: int, inside: bool, second: float) -> Intervention:
    """Return an intervention that happens at a time inside a primitive or after a step; goals change only after steps."""
    if inside and intervention.of_world:
        return replace(intervention, at=second)
    return replace(intervention, after=trial.plan.primitives[position].path)


def figure8() -> None:
    """Print the executed steps of the paper's figure 8 in both worlds, by ID."""
    scene = confab.load("beverage-serving")
    texts = ["after=28 cup2 LOCATION location8", "after=28 goal cup2 LOCATION location8"]
    print(
        "| world | status | IDs of the top level | IDs below 39 | dropped, added | simulated s |\n|---|---|---|---|---|---|"
    )
    for world in ("symbolic", "pybullet"):
        episode = execute(scene, scene.problem, None, texts, world).episode
        last = {m.id: [p.id for p in m.steps] for m in episode.done.steps[-1].steps}
        (change,) = episode.replans
        print(
            f"| {world} | {episode.status.value} | {[s.id for s in episode.done.steps]} | {last} | {change.dropped}, "
            f"{change.added} | {episode.seconds['simulated']:.1f} |",
            flush=True,
        )


def interventions() -> None:
    """Print the results of episodes with one random intervention in the symbolic world."""
    trial, ends = Trial.of(served(20)), Counter[tuple[str, str]]()
    begin, longest, wrong = perf_counter(), 0, 0
    for seed in range(SYMBOLIC):
        random, kind = Random(seed), KINDS[seed % len(KINDS)]
        position, intervention = random_intervention(trial, random, kind)
        happening = timed(intervention, trial, position, random.random() < 0.5, position + 0.5)
        episode = act(trial.problem, SymbolicWorld(trial.problem), trial.plan, [happening])
        ends[kind, episode.status.value] += 1
        longest = max(longest, len(episode.events))
        wrong += not _right(episode)
    _table(ends)
    print(
        f"\n{SYMBOLIC} episodes at n = 20, half of what changes the world inside a primitive; "
        f"{wrong} with a claim that isn't so; "
        f"the longest began {longest} primitives (the plan has {len(trial.plan.primitives)}); {perf_counter() - begin:.0f} s."
    )


def physical() -> None:
    """Print the results of episodes with one random intervention in PyBullet, and write a line per episode to a file."""
    scene = confab.load("beverage-serving")
    trial, ends = Trial.of(scene.problem), Counter[tuple[str, str]]()
    failures, wrong, lines = Counter[str](), 0, list[str]()
    for seed in range(PHYSICAL):
        kind = KINDS[seed % len(KINDS)]
        happening = physical_intervention(trial, seed)
        begin = process_time()
        episode = execute(scene, trial.problem, trial.plan, [happening], "pybullet", seed=seed).episode
        ends[kind, episode.status.value] += 1
        failures.update(failure.code for failure in episode.failures)
        wrong += not _right(episode)
        row = {
            "seed": seed,
            "kind": kind,
            "what": [str(fact) for fact in happening.facts] or happening.individual or str(happening.symbol),
            "after": happening.after,
            "at": happening.at,
            "status": episode.status.value,
            "reasons": [reason.text for reason in episode.reasons],
            "failures": [f"{failure.step}: {failure.code}" for failure in episode.failures],
            "cpu seconds": round(process_time() - begin, 1),
        }
        lines.append(json.dumps(row) + "\n")
        OUT.mkdir(parents=True, exist_ok=True)
        (OUT / "physical.jsonl").write_text("".join(lines), encoding="utf-8")
    _table(ends)
    print(f"\n{wrong} with a claim that isn't so; primitives failed: {dict(failures)}")


def physical_intervention(trial: Trial, seed: int) -> Intervention:
    """Return the intervention of an episode in PyBullet; for half of the seeds, it may happen inside a primitive."""
    random, kind = Random(1000 + seed), KINDS[seed % len(KINDS)]
    position, intervention = random_intervention(trial, random, kind)
    inside, second = random.random() < 0.5, 1 + 30 * random.random()
    return timed(intervention, trial, position, inside, second)


def repair() -> None:
    """Print cost, distance and latency of repair compared with replanning."""
    print(
        "| n | interventions | cost, sum | over 1.1 × | worst | distance | ratio, median "
        "| CPU ms, median | CPU ms, p95 | replanned |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for objects, count in ((4, 500), (20, 1000), (200, 60)):
        _repair_row(objects, count)
    print("\nEach cell: repair / replanning from scratch. Distance counts primitives dropped and added, in sequence.")


def _repair_row(objects: int, count: int) -> None:
    trial = Trial.of(served(objects))
    problem, own, other = trial.problem, compiled(trial.problem), compiled(trial.problem)
    costs, distances, seconds = list[tuple[float, float]](), list[tuple[int, int]](), list[tuple[float, float]]()
    anew, limits = 0, Limits(seconds=20)
    for seed in range(count):
        random, kind = Random(seed), KINDS[seed % len(KINDS)]
        position, intervention = random_intervention(trial, random, kind)
        rest = rest_after(trial.plan, position)
        before = replace(problem, initial=trial.states[position])
        now = after_intervention(before, intervention)
        ours, theirs = (compiled(now), compiled(now)) if kind == "add" else (own, other)
        begin = process_time()
        repaired = repair_or_replan(now, rest, before, None, ours, True, limits)
        middle = process_time()
        scratch, _ = replan(now, None, theirs, limits)
        end = process_time()
        if repaired.steps is None or scratch is None:
            assert repaired.steps is None and scratch is None
            continue
        anew += repaired.kind == "replan"
        costs.append((repaired.cost, cost_of(problem, Plan(scratch))))
        distances.append((sum(difference(rest, repaired.steps)), sum(difference(rest, scratch))))
        seconds.append((middle - begin, end - middle))
    worst = max((a / b for a, b in costs if b), default=1.0)
    over = sum(a > 1.1 * b for a, b in costs)
    ratio = median(a / b for a, b in distances if b)
    sums, middles = [sum(c) for c in zip(*costs, strict=True)], [median(d) for d in zip(*distances, strict=True)]
    times = [sorted(s) for s in zip(*seconds, strict=True)]
    fifty, ninety_five = ([1000 * t[int(len(t) * q)] for t in times] for q in (0.5, 0.95))
    print(
        f"| {objects} | {len(costs)} | {sums[0]:.0f} / {sums[1]:.0f} ({sums[0] / sums[1]:.3f}) | {over} | {worst:.2f} | "
        f"{middles[0]:g} / {middles[1]:g} | {ratio:.2f} | {fifty[0]:.1f} / {fifty[1]:.1f} | "
        f"{ninety_five[0]:.1f} / {ninety_five[1]:.1f} | {anew} |",
        flush=True,
    )


def after_intervention(before: Problem, intervention: Intervention) -> Problem:
    """Return the problem after an intervention; goals about removed objects are dropped."""
    goal = dict(before.goal)
    if intervention.change is InterventionKind.GOAL:
        goal.update((fact.symbol, fact.value) for fact in intervention.facts)
    elif intervention.change is InterventionKind.DROP_GOAL and intervention.symbol is not None:
        del goal[intervention.symbol]
    elif intervention.change is InterventionKind.REMOVE:
        goal = {s: v for s, v in goal.items() if intervention.individual not in s.arguments}
    else:
        wider = with_individual(before, intervention.individual, intervention.kind) if intervention.kind else before
        return replace(wider, initial=disturbed(wider, before.initial, intervention))
    return replace(
        before,
        goal=goal,
        initial=disturbed(before, before.initial, intervention) if intervention.of_world else before.initial,
    )


def learning() -> None:
    """Print the success rate by episode with a planted obstacle, with and without learning from failure."""
    scene = confab.load("beverage-serving")
    retry_policy = RetryPolicy(failures=2)
    curves: dict[str, list[float]] = {}
    print("| world | learning | goal reached, by episode | failures | simulated s |\n|---|---|---|---|---|")
    for learns in (False, True):
        ends = [_obstructed(scene.problem, learns, seed, EPISODES, retry_policy) for seed in range(SYMBOLIC_ROBOTS)]
        rates = [sum(run[i] for run in ends) / SYMBOLIC_ROBOTS for i in range(EPISODES)]
        print(
            f"| symbolic, obstacle fails 9 of 10, {SYMBOLIC_ROBOTS} robots, ends at failure {retry_policy.failures} | {learns} "
            f"| {' '.join(f'{100 * r:.0f} %' for r in rates)} | | |",
            flush=True,
        )
        curves[f"symbolic, {SYMBOLIC_ROBOTS} robots" + (", learning" if learns else "")] = rates
    for robots, episodes, limit in ((ROBOTS, EPISODES, retry_policy), (1, EPISODES // 2, RetryPolicy())):
        for learns in (False, True):
            runs = [_beside_a_post(scene, learns, 100 * robot, episodes, limit) for robot in range(1, robots + 1)]
            columns = list(zip(*runs, strict=True))
            rates = [sum(e.status is End.REACHED for e in column) / robots for column in columns]
            failed = [sum(len(e.failures) for e in column) / robots for column in columns]
            seconds = [sum(e.seconds["simulated"] for e in column) / robots for column in columns]
            print(
                f"| PyBullet, perturbed, {robots} robots, ends at failure {limit.failures} | {learns} "
                f"| {' '.join(f'{100 * r:.0f} %' for r in rates)} | {' '.join(f'{n:.1f}' for n in failed)} "
                f"| {' '.join(f'{t:.0f}' for t in seconds)} |",
                flush=True,
            )
            if limit is retry_policy:
                curves[f"PyBullet, {robots} robots" + (", learning" if learns else "")] = rates
    print(f"\nThe picture: {_save_curves(curves, OUT / 'learning.png')}")


def _beside_a_post(scene: Scene, learns: bool, seed: int, episodes: int, retry_policy: RetryPolicy) -> list[Episode]:
    """Return perturbed episodes in which an unperceived post stands where the left arm reaches for bottle2."""
    caution, found = Caution(), list[Episode]()
    for number in range(episodes):
        run = execute(
            scene,
            scene.problem,
            world="pybullet",
            seed=seed + number,
            prepare=hidden_post,
            retry_policy=retry_policy,
            caution=caution,
            perturb=True,
        )
        found.append(run.episode)
        caution = caution.learned(run.episode) if learns else caution
    return found


def hidden_post(world: Any, at: tuple[float, float, float] = (0.35, -0.05, 0.7), height: float = 0.06) -> None:
    """Put up a post 2 cm thick that the robot doesn't perceive; a hand from the right can pass the post."""
    import pybullet

    half = [0.01, 0.01, height / 2]
    post = pybullet.createMultiBody(
        0,
        pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=world.client),
        basePosition=[at[0], at[1], at[2] + half[2]],
        physicsClientId=world.client,
    )
    world.names[post] = "hidden post"


def _save_curves(curves: Mapping[str, Sequence[float]], path: Path) -> Path:
    """Draw the success rates by episode, and return the path of the picture."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7, 3.6), layout="constrained")
    for name, rates in curves.items():
        style, color = "-" if name.endswith("learning") else "--", "C0" if name.startswith("symbolic") else "C1"
        axes.plot(range(1, len(rates) + 1), [100 * r for r in rates], f"{style}o", color=color, label=name)
    axes.set(xlabel="episode", ylabel="goal reached, %", ylim=(-4, 104))
    axes.legend(fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
    return path


def _obstructed(problem: Problem, learns: bool, seed: int, episodes: int, retry_policy: RetryPolicy) -> list[bool]:
    """Return for each episode whether the episode succeeds; the first grasp of the plan's last object is mostly blocked."""
    random, caution, found = Random(seed), Caution(), list[bool]()
    reach = next(
        s
        for s in reversed(Trial.of(problem).plan.primitives)
        if len(s.arguments) == 2 and s.arguments[1] in problem.classes["Object"]
    )
    first = next(
        s
        for s in Trial.of(problem).plan.primitives
        if s.arguments[0] == reach.arguments[0] and s.bindings.get("place") and _is_source(problem, s)
    )

    def fault(step: Step, state: State) -> WorldReport | None:
        hit = (
            step.arguments == first.arguments
            and state[Symbol(_where(problem), first.arguments[1:])] == first.bindings["place"]
        )
        return WorldReport(False, "no path", first.arguments[1:]) if hit and random.random() < 0.9 else None

    for _ in range(episodes):
        episode = act(problem, SymbolicWorld(problem, fault=fault), retry_policy=retry_policy, caution=caution)
        found.append(episode.status is End.REACHED)
        caution = caution.learned(episode) if learns else caution
    return found


def _where(problem: Problem) -> str:
    return next(
        s.name
        for s in problem.domain.situations.values()
        if s.level == 1 and problem.value_levels.keys() & set(problem.classes[s.range])
    )


def _is_source(problem: Problem, step: Step) -> bool:
    """Return whether a primitive reaches for an object that another hand also reaches."""
    rows = next(iter(problem.relations.values()))
    return len(step.arguments) == 2 and sum(row[1] == step.bindings.get("place") for row in rows) > 1


def both_hands() -> None:
    """Print the makespans of execution with both hands and of serial execution, and draw a Gantt chart."""
    from confab.sim.together import perform_together
    from confab.sim.verify import expectations, verify
    from confab.sim.world import PhysicsWorld

    scene = confab.load("beverage-serving")
    plan = Trial.of(scene.problem).plan
    steps = plan.primitives
    promised = expectations(scene.problem, steps)
    serial = verify(scene.embodiment, scene.problem.initial, steps, promised)
    with PhysicsWorld(scene.embodiment, scene.problem.initial) as world:
        performed = perform_together(world, scene.problem, steps)
        seconds, seen = world.seconds, world.observe()
    same = all(promised[-1].get(symbol) == value for symbol, value in seen.items())
    ratio = seconds / serial.simulated_seconds
    print(
        "| | simulated s | ratio | arms in contact | all primitives succeed | same end state |\n|---|---|---|---|---|---|"
    )
    print(f"| serial | {serial.simulated_seconds:.1f} | 1 | – | {serial.ok} | – |")
    print(f"| both hands | {seconds:.1f} | {ratio:.2f} | {performed.touching:.2f} s | {performed.ok} | {same} |")
    labels = labels_of(scene.knowledge, scene.names, scene.problem)
    path = save_gantt(performed.slots, OUT / "gantt.png", serial.simulated_seconds, labels)
    print(f"\nThe Gantt strip: {path}")


def _right(episode: Episode) -> bool:
    """Return whether an episode's claims are true: goals hold at the end, and reasons are given only for unreached goals."""
    holds = all(episode.observed.get(s, FALSE) == v for s, v in episode.goal.items())
    return holds and (episode.status is End.REACHED) == (not episode.reasons)


def _table(ends: Counter[tuple[str, str]]) -> None:
    statuses = [end.value for end in End]
    print(f"| intervention | {' | '.join(statuses)} |\n|---|---|---|---|")
    for kind in KINDS:
        print(f"| {kind} | {' | '.join(str(ends[kind, status]) for status in statuses)} |")


PARTS: dict[str, Callable[[], None]] = {
    "figure8": figure8,
    "repair": repair,
    "interventions": interventions,
    "learning": learning,
    "both_hands": both_hands,
    "physical": physical,
}


def main() -> None:
    """Print all parts, or the parts named on the command line of this module."""
    for name in [a for a in sys.argv[1:] if a in PARTS] or PARTS:
        print(f"\n### {name}\n", flush=True)
        PARTS[name]()


if __name__ == "__main__":
    main()
