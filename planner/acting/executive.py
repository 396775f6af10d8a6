"""The executive: plan, act, watch, be interrupted, repair.

belief    the situation as it was last seen, the goal as it is now, and what failures have taught about what is possible
agenda    the steps that are still to be done; the first may be partly done
expected  what the next observation should show

Rule 1: no primitive is begun whose precondition doesn't hold in the last observation.
Rule 2: after every primitive the world is observed; whatever isn't as expected makes the agenda be looked at again.
Rule 3: every loop ends: primitives and failures are counted, planning has limits.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from time import perf_counter

from confab.planner.acting.episode import (
    Change,
    End,
    Episode,
    Event,
    Failure,
    Intervention,
    Replan,
    Seen,
    Surprise,
)
from confab.planner.acting.failure_memory import Caution, Static, refuted_by, without_relations
from confab.planner.acting.repair import difference, mend, replan, vanished
from confab.planner.acting.symbolic_world import with_individual
from confab.planner.acting.world import INTERRUPTED, Guarded, Verdict, World, WorldError
from confab.planner.hierarchical.planner import compiled
from confab.planner.hierarchical.planner import plan as fast_plan
from confab.planner.plan import Limits, Outcome, Plan, Planner, Reason, Status, Step, renumbered
from confab.planner.validation import open_goals, successor
from confab.reasoner.limits import LimitError, check
from confab.reasoner.refutations import Refutation, with_refuted
from confab.reasoner.symbols import FALSE, Fact, Problem, RelationCondition, State, Symbol


@dataclass(frozen=True)
class Patience:
    """When to stop: attempts at one primitive, failures in all, primitives begun per primitive planned, and planning limits.

    `rounds` is how often everything that failed is tried anew once no other way is left: the situation has changed by then, and
    a hand grasps differently. The agenda is also looked at again at most that often while nothing changes. `planning` limits each
    planning call; the whole episode ends by the deadline that holds (`confab.reasoner.limits.within`).
    """

    attempts: int = 2
    failures: int = 12
    rounds: int = 3
    primitives: int = 20
    planning: Limits = Limits(seconds=20.0)  # noqa: RUF009 - frozen


@dataclass(frozen=True)
class Moment:
    """What a spectator is told: something happened, and this is how things stand; `seconds` is the time on the world's clock."""

    what: str  # plan, begin, end, intervention, repair, replan, over
    plan: Plan
    done: frozenset[tuple[int, ...]]
    step: Step | None = None
    expected: tuple[Fact, ...] = ()
    surprises: tuple[Surprise, ...] = ()
    text: str = ""
    seconds: float = 0.0


def act(
    problem: Problem,
    world: World,
    plan: Plan | None = None,
    interventions: Sequence[Intervention] = (),
    planner: Planner | None = None,
    patience: Patience = Patience(),
    tell: Callable[[Moment], None] | None = None,
    mending: bool = True,
    caution: Caution | None = None,
) -> Episode:
    """Carry a task out in a world, whatever happens, until it is done, proved impossible, or a limit is reached.

    Parameters
    ----------
    problem : Problem
        The situation in the beginning, and the goal.
    world : World
        Anything with `observe` and `execute`: `confab.planner.acting.symbolic_world.SymbolicWorld`, PyBullet, a robot.
    plan : Plan, optional
        What to begin with; planned here if left out.
    interventions : sequence of Intervention
        What people will do in the meantime.
    planner : callable, optional
        Plans from scratch, from a situation of rest; the fast planner if left out.
    patience : Patience
    tell : callable, optional
        Is told every `Moment`.
    mending : bool
        False replans from scratch instead of repairing.
    caution : Caution, optional
        What failed in earlier episodes: what it speaks against is done otherwise, where there is another way.

    Returns
    -------
    Episode
    """
    run = _Run(problem, Guarded(world), list(interventions), planner, patience, tell, mending)
    if caution is not None and plan is None:
        run.believe(caution.applied(problem, planner or fast_plan, patience.planning))
    try:
        run.look(dict(run.belief.initial))
        run.start(plan)
        while run.going:
            check("acting")
            run.intervene()
            if run.puzzled:
                run.reconsider()
            elif not run.agenda:
                run.finish()
            elif (expected := run.expected()) is None:
                run.doubt("the next primitive's precondition doesn't hold")
            else:
                chain, before, verdict = run.perform(expected)
                if not verdict.ok:
                    run.learn_from(chain, before, verdict)
    except (WorldError, LimitError) as error:
        run.world.stop()
        run.break_off(str(error))
    except BaseException:  # Ctrl-C, too: nothing moves on without the executive
        run.world.stop()
        raise
    return run.episode()


@dataclass
class _Run:
    """One episode in the making. `act` is the loop; each method is one thing that it does."""

    belief: Problem
    world: Guarded
    waiting: list[Intervention]
    planner: Planner | None
    patience: Patience
    tell: Callable[[Moment], None] | None
    mending: bool
    agenda: tuple[Step, ...] = ()
    planned_for: Problem | None = None
    going: bool = True
    status: End = End.REACHED
    puzzled: str = ""
    reasons: list[Reason] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    happened: list[tuple[Intervention, float]] = field(default_factory=list)
    course: list[Seen] = field(default_factory=list)
    replans: list[Replan] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    done: dict[tuple[int, ...], Step] = field(default_factory=dict)
    begun: dict[tuple[int, ...], State] = field(default_factory=dict)
    attempts: Counter[tuple[str, tuple[str, ...]]] = field(default_factory=Counter)
    withdrawn: set[Static] = field(default_factory=set)
    refuted: dict[Refutation, None] = field(default_factory=dict)
    rounds: int = 0
    pondered: Counter[object] = field(default_factory=Counter)
    seconds: dict[str, float] = field(default_factory=lambda: {"planning": 0.0, "repairing": 0.0})
    unseen: frozenset[Symbol] | None = None
    sound: bool = True
    missed: dict[Symbol, str | None] = field(default_factory=dict)
    first: Plan = Plan(())  # noqa: RUF009 - frozen

    def __post_init__(self) -> None:
        self.believe(self.belief)

    def believe(self, problem: Problem) -> None:
        """Begin with a situation, a goal and static facts."""
        self.belief, self.believed, self.initial = problem, problem, dict(problem.initial)

    # --------------------------------------------------------------------------------------------------- beginning, end

    def start(self, plan: Plan | None) -> None:
        """Plan, unless there is a plan to begin with."""
        self.initial, self.using = dict(self.belief.initial), compiled(self.belief)
        self.course.clear()  # what was seen so far is the initial situation
        self.world.announce(tuple(i for i in self.waiting if i.at is not None))
        if plan is None:
            self.set_aside_the_impossible(vanished(self.belief))
            begin = perf_counter()
            steps, outcome = replan(self.belief, self.planner, self.using, self.patience.planning)
            self.seconds["planning"] += perf_counter() - begin
            if steps is None:
                self.going = False
                self.status = End.IMPOSSIBLE if outcome.status is Status.UNSOLVABLE else End.GAVE_UP
                self.reasons.append(outcome.reason or Reason("no plan"))
            plan = Plan(renumbered(steps or ()))
        self.agenda, self.first, self.planned_for = plan.steps, plan, self.belief
        self.most = self.patience.primitives * max(len(plan.primitives), 20)
        self.say("plan", text=self.reasons[-1].text if self.reasons else "")

    def finish(self) -> None:
        """Nothing is left to be done: either what is wanted is there, or the agenda must be looked at again."""
        if missing := open_goals(self.belief):
            self.doubt(f"{missing[0]} doesn't hold yet")
            return
        self.going = False
        if self.reasons and self.status is End.REACHED:
            self.status = End.IMPOSSIBLE
        self.say("over", text=self.status.value)

    def break_off(self, why: str) -> None:
        """Stop at once: the world doesn't answer."""
        self.going, self.status = False, End.GAVE_UP
        self.reasons.append(Reason(why))
        self.say("over", text=f"{self.status.value}: {why}")

    def episode(self) -> Episode:
        """Return what happened."""
        clock = 0.0
        with suppress(WorldError):
            clock = self.world.seconds
        return Episode(
            self.belief.scene,
            self.status,
            tuple(self.reasons),
            self.first,
            self.executed(),
            self.initial,
            dict(self.belief.initial),
            dict(self.belief.goal),
            tuple(self.events),
            tuple(self.happened),
            tuple(self.replans),
            tuple(self.failures),
            {**self.seconds, "simulated": clock},
            tuple(self.waiting),
            tuple(self.course),
            tuple(self.refuted),
        )

    def executed(self) -> Plan:
        """Return what was done as a tree."""
        return Plan(_tree(self.done))

    def say(self, what: str, step: Step | None = None, expected: Iterable[Fact] = (), text: str = "") -> None:
        """Tell the spectator, if there is one."""
        if self.tell is None:
            return
        surprises = self.events[-1].surprises if self.events and what == "end" else ()
        whole = Plan(_tree({**self.done, **{p.path: p for p in _chains(self.agenda)}}))
        clock = 0.0
        with suppress(WorldError):
            clock = self.world.seconds
        self.tell(Moment(what, whole, frozenset(self.done), step, tuple(expected), surprises, text, clock))

    # --------------------------------------------------------------------------------------------------- acting

    def expected(self) -> dict[Symbol, str] | None:
        """Return the situation that the next primitive should lead to, or None if its precondition doesn't hold."""
        step = _first(self.agenda)[-1]
        behavior = self.belief.domain.behaviors[step.behavior]
        return successor(self.belief, behavior, step.arguments, self.belief.initial)

    def perform(self, expected: dict[Symbol, str]) -> tuple[tuple[Step, ...], State, Verdict]:
        """Carry the next primitive out and look what came of it; a primitive that failed, but did what it should, is done.

        Returns the primitive with what is above it, the situation before, and the verdict.
        """
        chain = _first(self.agenda)
        step, before = chain[-1], self.belief.initial
        for above in chain[:-1]:
            self.begun.setdefault(above.path, before)
        changes = [Fact(s, v) for s, v in sorted(expected.items()) if before.get(s) != v]
        self.say("begin", step, changes)
        begin = self.world.seconds
        verdict = self.world.execute(step)
        self.note_what_happened_by_the_clock()
        seen = self.world.observe()
        there = bool(changes) and all(seen.get(fact.symbol) == fact.value for fact in changes)
        done = verdict.ok or (there and verdict.code != INTERRUPTED)
        surprises = self.look(expected if done else dict(before), seen)
        relied_on = tuple(relations_of(self.belief, chain))
        self.events.append(Event(step, begin, self.world.seconds, verdict.ok, verdict.code, surprises, relied_on))
        if done:
            self.done.update((above.path, above) for above in chain)
            self.agenda = _rest(self.agenda)
        if surprises:
            self.doubt("; ".join(map(_told, surprises[:3])), surprises)
        self.say("end", step, changes)
        if len(self.events) >= self.most:
            self.give_up(End.GAVE_UP, Reason(f"stopped at the limit of {self.most} primitives"))
        return chain, before, verdict

    def look(self, expected: dict[Symbol, str], seen: State | None = None) -> tuple[Surprise, ...]:
        """Observe the world if that isn't `seen` yet, believe what is seen, and return what isn't as expected."""
        seen = self.world.observe() if seen is None else seen
        if self.unseen is None:
            self.unseen = frozenset(s for s in expected if s not in seen and not self.boolean(s))
        surprises = []
        belief = {symbol: value for symbol, value in expected.items() if symbol in self.unseen}
        belief.update(seen)
        for symbol in sorted(expected.keys() | belief.keys()):
            default = FALSE if self.boolean(symbol) else None
            wanted, found = expected.get(symbol, default), belief.get(symbol, default)
            if wanted != found:
                surprises.append(Surprise(symbol, wanted, found))
        now, before = self.world.seconds, self.belief.initial
        changed = (s for s in sorted(before.keys() | belief.keys()) if before.get(s) != belief.get(s))
        self.course += [Seen(now, symbol, belief.get(symbol)) for symbol in changed]
        self.belief = replace(self.belief, initial=belief)
        return tuple(surprises)

    def boolean(self, symbol: Symbol) -> bool:
        """Whether a symbol is true or false, so that not seeing it is seeing that it is false."""
        return self.belief.domain.situations[symbol.situation].boolean

    # --------------------------------------------------------------------------------------------------- being interrupted

    def intervene(self) -> None:
        """Let happen what shall happen after what was just done."""
        if not self.waiting:
            return
        gone = set(self.done) - {path for step in self.agenda[:1] for path in _open(step)}
        first = self.belief.domain.levels[0]
        finished = {self.done[path].id for path in gone if self.done[path].level == first}
        due = [i for i in self.waiting if (i.after in finished if isinstance(i.after, int) else i.after in gone)]
        due += [i for i in self.waiting if i.at is not None and not i.of_world and i.at <= self.world.seconds]
        for intervention in due:
            self.waiting.remove(intervention)
            now = self.world.seconds
            if intervention.of_world:
                self.world.disturb(intervention)
            self.note(intervention, now)
        if any(i.of_world for i in due):
            surprises = self.look(dict(self.belief.initial))
            self.doubt("; ".join(map(_told, surprises[:3])), surprises)

    def note_what_happened_by_the_clock(self) -> None:
        """Take note of what the world was told to let happen at a time that has passed."""
        for intervention in [i for i in self.waiting if i.at is not None and i.of_world]:
            if (intervention.at or 0.0) <= self.world.seconds:
                self.waiting.remove(intervention)
                self.note(intervention, intervention.at or 0.0)

    def note(self, intervention: Intervention, seconds: float) -> None:
        """Take note of an intervention that happened at a time, and change the goal if it says so."""
        self.happened.append((intervention, seconds))
        goal = dict(self.belief.goal)
        if intervention.change is Change.GOAL:
            goal.update((fact.symbol, fact.value) for fact in intervention.facts)
        elif intervention.change is Change.DROP_GOAL and intervention.symbol is not None:
            goal.pop(intervention.symbol, None)
        elif intervention.change is Change.ADD:
            self.belief = with_individual(self.belief, intervention.individual, intervention.kind)
            self.using = compiled(self.belief)
        if goal != self.belief.goal:
            self.belief = replace(self.belief, goal=dict(sorted(goal.items())))
            self.doubt("something else is wanted")
        self.say("intervention", text=intervention.text)

    def doubt(self, why: str, surprises: Sequence[Surprise] = ()) -> None:
        """Want the agenda looked at again. What is in progress is sound if it could have begun with the surprises known."""
        if why not in self.puzzled:
            self.puzzled = f"{self.puzzled}; {why}" if self.puzzled else why
        for surprise in surprises:
            self.missed.setdefault(surprise.symbol, surprise.expected)
        changes = {s.symbol: s.observed for s in surprises}
        for path in [step.path for step in _first(self.agenda)[:-1] if step.path in self.begun]:
            step = next(s for s in _first(self.agenda) if s.path == path)
            as_if = {s: v for s, v in {**self.begun[path], **changes}.items() if v is not None}
            behavior = self.belief.domain.behaviors[step.behavior]
            self.sound = self.sound and successor(self.belief, behavior, step.arguments, as_if) is not None

    # --------------------------------------------------------------------------------------------------- repairing

    def reconsider(self) -> None:
        """Repair the agenda, or replan; set aside what can't be reached any more."""
        why, self.puzzled = self.puzzled, ""
        self.set_aside_the_impossible(vanished(self.belief))
        happened = len(self.events), len(self.happened), len(self.failures)
        standing = (*happened, len(self.withdrawn), len(self.refuted), self.rounds, self.status, *self.belief.goal)
        self.pondered[standing] += 1
        if self.pondered[standing] > self.patience.rounds:
            text = f"planned {self.patience.rounds} times in the same situation, and no step could be done: {why}"
            self.give_up(End.GAVE_UP, Reason(text))
            return
        assert self.planned_for is not None
        begin = perf_counter()
        limits, old = self.patience.planning, self.agenda
        end = limits.end()
        if self.mending:
            expected = {s: v for s, v in {**self.belief.initial, **self.missed}.items() if v is not None}
            planned = replace(self.planned_for, initial=expected)
            mended = mend(self.belief, old, planned, self.planner, self.using, self.sound, limits)
            kind, steps, cost, outcome = mended.kind, mended.steps, mended.cost, mended.outcome
        else:
            steps, outcome = replan(self.belief, self.planner, self.using, limits)
            kind, cost = "replan", float(len(Plan(steps or ()).primitives))
        seconds = perf_counter() - begin
        self.seconds["repairing"] += seconds
        self.planned_for, self.sound, self.missed = self.belief, True, {}
        if steps is None:
            self.despair(outcome, limits.until(end))
            return
        self.agenda = self.numbered(steps)
        dropped, added = difference(old, steps)
        if dropped or added:
            last = self.events[-1].step.path if self.events else ()
            self.replans.append(Replan(last, kind, why, self.agenda, cost, dropped, added, seconds))
            self.say(kind, text=why)

    def numbered(self, steps: Sequence[Step]) -> tuple[Step, ...]:
        """Return steps with the paths that they have in the tree of all that is done; one that goes on keeps its own."""
        following = 1 + max((path[0] for path in self.done), default=-1)
        if steps and self.agenda and self.agenda[0].path[:1] in {path[:1] for path in self.done}:
            now, new = self.agenda[0], steps[0]
            if [str(s) for s in now.walk()] == [str(s) for s in new.walk()]:
                return (now, *renumbered(steps[1:], following))
        return renumbered(steps, following)

    def set_aside_the_impossible(self, impossible: Sequence[tuple[Symbol, Reason]]) -> None:
        """Want no more what can't be, and remember why."""
        if impossible:
            gone = {symbol for symbol, _ in impossible}
            self.reasons.extend(reason for _, reason in impossible)
            self.belief = replace(self.belief, goal={s: v for s, v in self.belief.goal.items() if s not in gone})

    def despair(self, outcome: Outcome | None, limits: Limits) -> None:
        """Set aside the goals that can't be reached even one by one; if that explains nothing, come to rest and stop."""
        reason = outcome.reason if outcome is not None and outcome.reason else Reason("no plan was found")
        doubted = self.withdrawn or self.refuted
        proved = outcome is not None and outcome.status is Status.UNSOLVABLE and not doubted
        hopeless, end = [], limits.end()
        for fact in open_goals(self.belief) if proved else ():
            alone = replace(self.belief, goal={fact.symbol: fact.value})
            steps, single = replan(alone, None, self.using, limits.until(end))
            if steps is None and single.status is Status.UNSOLVABLE and single.reason is not None:
                hopeless.append((fact.symbol, single.reason))
        if hopeless:
            self.set_aside_the_impossible(hopeless)
            self.doubt("what can't be reached is set aside")
        elif doubted and self.try_anew("no other way is left"):
            return
        else:
            self.give_up(End.IMPOSSIBLE if proved else End.GAVE_UP, reason)

    def give_up(self, status: End, reason: Reason) -> None:
        """Stop wanting anything, so that only rest is left; stop at once if that was tried already."""
        if not self.belief.goal and self.status is not End.REACHED:
            self.going = False
        self.status = status
        if reason not in self.reasons:
            self.reasons.append(reason)
        self.belief = replace(self.belief, goal={})
        self.most = len(self.events) + self.patience.primitives
        self.puzzled = reason.text

    # --------------------------------------------------------------------------------------------------- failing

    def learn_from(self, chain: tuple[Step, ...], before: State, verdict: Verdict) -> None:
        """Try again, then otherwise: what failed again and again is taken as impossible for the rest of the episode."""
        step, code = chain[-1], verdict.code or "failed"
        if code == INTERRUPTED:
            self.doubt(verdict.message)
            return
        self.failures.append(Failure(step, code, verdict.objects, verdict.message, before))
        if step.path not in self.done:
            self.attempts[step.behavior, step.arguments] += 1
        if len(self.failures) >= self.patience.failures:
            text = f"stopped after {len(self.failures)} failures, the last of {step}: {verdict.message or code}"
            self.give_up(End.GAVE_UP, Reason(text, verdict.objects))
            return
        facts, likewise = getattr(verdict, "facts", ()), getattr(verdict, "likewise", ())
        refuted = refuted_by(self.belief, chain, facts, code, likewise)
        if refuted and not self.refuted.keys() >= {*refuted}:
            self.refuted |= dict.fromkeys(refuted)
            self.rely_on_all_but(self.withdrawn)
            self.doubt(f"{refuted[-1]}")
            return
        if self.attempts[step.behavior, step.arguments] < self.patience.attempts:
            return
        relied_on = relations_of(self.belief, chain)
        if not relied_on:
            text = f"{step} failed {self.patience.attempts} times and there is no other way: {verdict.message or code}"
            if not self.try_anew(text):
                self.give_up(End.GAVE_UP, Reason(text, verdict.objects))
            return
        self.withdrawn.update(relied_on)
        self.rely_on_all_but(self.withdrawn)
        self.doubt(f"{step} failed {self.patience.attempts} times ({code})")

    def try_anew(self, why: str) -> bool:
        """Bring the hands to rest and rely on everything again, if that wasn't done too often; return whether it is done."""
        if self.rounds + 1 >= self.patience.rounds:
            return False
        self.rounds += 1
        self.attempts.clear()
        self.withdrawn.clear()
        self.refuted.clear()
        self.rely_on_all_but(())
        self.doubt(f"tried anew: {why}")
        return True

    def rely_on_all_but(self, gone: Iterable[Static]) -> None:
        """Believe in all static facts of the scene except some, and in what is refuted; what is in progress is planned anew."""
        known = replace(self.belief, relations=self.believed.relations, domain=self.believed.domain)
        self.belief = with_refuted(without_relations(known, gone), self.refuted)
        self.using = compiled(self.belief)
        self.sound = False


def relations_of(problem: Problem, chain: Sequence[Step]) -> list[tuple[str, tuple[str, ...]]]:
    """Return the static facts that a primitive, or else the next behaviour above it, relied on."""
    for step in reversed(chain):
        behavior = problem.domain.behaviors[step.behavior]
        env = {p.name: argument for p, argument in zip(behavior.parameters, step.arguments, strict=True)}
        env |= {f"?{name}": value for name, value in step.bindings.items()}
        found = [
            (c.relation, tuple(env.get(a, a) for a in c.arguments))
            for c in behavior.preconditions
            if isinstance(c, RelationCondition) and not c.negated
        ]
        found = [(name, row) for name, row in found if row in problem.relations.get(name, ())]
        if found:
            return found
    return []


# ------------------------------------------------------------------------------------------------------------- trees of steps


def _first(steps: Sequence[Step]) -> tuple[Step, ...]:
    """Return the first primitive below the first step, after all that is above it."""
    chain = list(steps[:1])
    while chain and chain[-1].steps:
        chain.append(chain[-1].steps[0])
    return tuple(chain)


def _rest(steps: Sequence[Step]) -> tuple[Step, ...]:
    """Return the steps without their first primitive, and without what is done thereby."""
    if not steps[0].steps:
        return tuple(steps[1:])
    below = _rest(steps[0].steps)
    return (replace(steps[0], steps=below), *steps[1:]) if below else tuple(steps[1:])


def _open(step: Step) -> Iterable[tuple[int, ...]]:
    return (s.path for s in step.walk())


def _chains(steps: Iterable[Step]) -> Iterable[Step]:
    return (s for step in steps for s in step.walk())


def _tree(steps: Mapping[tuple[int, ...], Step], above: tuple[int, ...] = ()) -> tuple[Step, ...]:
    """Return steps, given by path, as trees."""
    below: dict[tuple[int, ...], list[Step]] = {}
    for path in sorted(steps, key=lambda p: (-len(p), p)):
        below.setdefault(path[:-1], []).append(replace(steps[path], steps=tuple(below.get(path, ()))))
    return tuple(below.get(above, ()))


def _told(surprise: Surprise) -> str:
    return f"{surprise.symbol} is {surprise.observed or 'not seen'}, expected {surprise.expected or 'nothing'}"
