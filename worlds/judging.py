"""Planning of a small world in every mode, and comparison of the results with an exhaustive search.

`worlds.interpreter` searches the problem exhaustively. The planner reads the same world from a scene file. Each call has its
own limit of CPU time.
"""

from __future__ import annotations

import math
import re
import signal
import warnings
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from random import Random
from time import process_time
from types import FrameType
from typing import Any, TypeVar

from confab.plan_options import NO_ENGINE
from confab.planner.acting.episode import End, Episode
from confab.planner.certificates import Certificate
from confab.planner.plan import Outcome, Plan, Reason, Status, UnsolvableError
from confab.planner.validation import LoggedState, successor, validate
from confab.planning import plan
from confab.reasoner.amounts import written
from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph
from confab.reasoner.language import DomainError
from confab.reasoner.limits import LimitError
from confab.reasoner.problem import Problem
from confab.reasoner.reading import relevance
from confab.reasoner.reading.problem import Reading, read_names
from confab.reasoner.symbols import FALSE, Symbol
from confab.scene import Scene, load
from worlds.corrupted import corrupted, numbered, random_steps
from worlds.false_certificates import accepted, of_a_task_with_a_plan
from worlds.false_certificates import corrupted as corrupted_certificates
from worlds.interpreter import Interpreter, State, TooManyStatesError
from worlds.mixed import RandomWorld, crowded
from worlds.scenes import scene
from worlds.slices import Slice
from worlds.walking import cost, executed, faults
from worlds.wishes import WEIGHTS, choices, least_costs, least_total, softened

SECONDS, CPU, PROVING, COMPARING = 1.5, 4.0, 15.0, 30.0
"""Time limit of a call in seconds; CPU seconds after which a call counts as endless; the same for a search for one certificate,
whose number of tests is limited instead of its time, and for a comparison with exhaustive searches."""
MOST = 5_000
"""Maximum number of nodes of the exhaustive search."""
OPTIMAL, PAPER, STRICT, EXPORTS, EXECUTIONS, LESSONS, READERS, CERTIFICATES, RECOGNITION = 3, 2, 3, 8, 6, 8, 250, 4, 8
STEPS, SOFT = 12, 8
"""Sampling intervals of expensive checks: with an interval n, one of n worlds is checked."""
KINDS = ("facts", "bounds", "pairs", "cases", "states")
"""Kinds of certificates: unreachable facts; goals that exclude each other in every state; two goals that exclude each other;
distinguished values; all values."""
LEFT_OUT, CERTIFYING = 3, 100_000
"""Number of behaviours that are left out in turn for false certificates, and maximum work for each certificate."""
MOST_ACTIONS = 1_500
"""Maximum number of grounded behaviours of an imported problem for the exhaustive search."""
STATES = 3
"""Number of reachable states, and of behaviours in each state, in which the plan checker is compared with the interpreter."""
CORE_CLASSES = ("Parameter", "Level", "ValueCondition")
"""Names of classes of the core ontology that only the parts of behaviours belong to."""
SLICED = 25
"""Number of reachable states in which behaviours in a part of a world are compared with those in the world."""
FEW_CASES = 30
"""Maximum number of cases of a certificate that is corrupted, so that its checks take little time."""
SOFT_MODES: dict[str, dict[str, Any]] = {
    "soft": {}, "soft optimal": {"optimal": True}, "soft paper": {"mode": "paper"}, "soft strict": {"leave_levels": False},
}  # fmt: skip
"""Options of planning with soft goals."""
EXACT = 1e-9
"""Largest difference of costs that are equal except for the rounding of floating-point numbers."""
T = TypeVar("T")


class EndlessError(BaseException):
    """Raised when a call has used up its CPU time; the planner never catches this error."""


@dataclass(frozen=True)
class Complaint:
    """A fault: its kind, the planning mode and a description."""

    kind: str
    mode: str
    text: str


@dataclass
class Judged:
    """The faults, remarks and measurements of one world."""

    complaints: list[Complaint] = field(default_factory=list)
    remarks: list[Complaint] = field(default_factory=list)
    status: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    least: float | None = None
    known: bool = True
    length: int = 0
    states: int = 0


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise `EndlessError` after `seconds` of CPU time."""

    def end(number: int, frame: FrameType | None) -> None:
        raise EndlessError

    before = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, seconds, 0.2)  # repeated, since a library may swallow the first signal
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def certificate(kind: str, problem: Problem) -> Certificate | None:
    """Return a certificate of one of the `KINDS`, found without the other kinds, or of any kind for ``all``; or None.

    In `certify`, a certificate of one kind can hide a fault in the search for another kind.
    """
    from confab.planner import certifying
    from confab.planner.possibilities import Lowest, WorkLimitError

    if kind == "all":
        return certifying.certify(problem, CERTIFYING)  # returns None at the limit of work
    lowest = Lowest(problem, CERTIFYING)
    relaxed = certifying.Relaxed(lowest)
    searches: dict[str, Callable[[], Certificate | None]] = {
        "facts": lambda: relaxed.certificate(problem.goal),
        "bounds": lambda: certifying.by_bounds(lowest) or certifying.by_definitions(lowest),
        "pairs": lambda: certifying.by_pairs(lowest, relaxed),
        "cases": lambda: certifying.by_cases(lowest, relaxed, problem.goal),
        "states": lambda: certifying.by_states(lowest),
    }
    with suppress(WorkLimitError, RecursionError):
        return searches[kind]()
    return None


def of_lesser_tasks(problem: Problem, rng: Random) -> Iterator[tuple[str, Certificate]]:
    """Yield certificates of tasks that lack one behaviour of the lowest level, each with a description."""
    lowest = [behavior.name for behavior in problem.domain.at_level(problem.domain.levels[-1])]
    for name in rng.sample(lowest, min(len(lowest), LEFT_OUT)):
        others = {other: behavior for other, behavior in problem.domain.behaviors.items() if other != name}
        domain = replace(problem.domain, behaviors=others)
        if problem.domain.levels[-1] not in domain.levels:
            continue  # another level would be the lowest
        if (found := certificate("all", replace(problem, domain=domain))) is not None:
            yield f"without {name}", found


def _text(value: Any) -> str:
    """Return a value of the interpreter as the text of a fact."""
    return value if isinstance(value, str) else written(value)


class Judge:
    """Compares the planner with the exhaustive search on one world.

    By default, the world's seed selects the expensive checks. With `every`, all checks run. With `only`, the checks of one mode
    run.
    """

    def __init__(
        self,
        world: RandomWorld,
        folder: Path,
        every: bool = False,
        only: str = "",
        meant: Interpreter | None = None,
    ) -> None:
        self.world, self.folder, self.every, self.only = world, folder, every or bool(only), only
        self.found = Judged()
        self.meant = meant or Interpreter(world.problem)
        self.rng = Random(f"judge {world.seed}")
        self.reached: list[State] = []

    def complain(self, kind: str, mode: str, text: object = "") -> None:
        """Record a fault of the planner."""
        self.found.complaints.append(Complaint(kind, mode, str(text)[:400]))

    def sampled(self, one_of: int, what: str, *modes: str) -> bool:
        """Return whether the world belongs to the sample of one in `one_of` worlds for an expensive check."""
        if self.only:
            return self.only.startswith(modes)
        return self.every or zlib.crc32(f"{what} {self.world.seed}".encode()) % one_of == 0

    def judged(self) -> Judged:
        """Run the checks, and return the faults, remarks and measurements."""
        self.truth()
        file = self.folder / f"w{self.world.seed}.ttl"
        file.write_text(scene(self.world), encoding="utf-8")
        try:
            self.modes(file)
        finally:
            file.unlink(missing_ok=True)
        return self.found

    def truth(self) -> None:
        """Compute the least cost of the goal, and in `self.surely` the least cost without the requirement of rest values."""
        level, found = self.world.problem.domain.levels[-1], self.found
        begin = process_time()
        try:
            truth = self.meant.explored(level, MOST)
            found.least, found.states = truth.least, len(truth.costs)
            self.reached = list(dict.fromkeys(state for state, _ in truth.costs))
        except TooManyStatesError:
            found.known, found.states = False, MOST
        self.surely = found.least
        unsettled = [i for i, rest in self.meant.rests.items() if self.meant.initial[i] != rest]
        if unsettled and found.known:
            try:
                self.surely = self.meant.explored(level, MOST, rests=False).least
            except TooManyStatesError:
                found.known = False
        found.seconds["truth"] = process_time() - begin

    def call(self, mode: str, made: Callable[[], T], cpu: float = CPU) -> T | None:
        """Return the result of a call; record a fault if the call doesn't return in time or raises an unexpected error."""
        begin = process_time()
        try:
            with limited(cpu):
                return made()
        except EndlessError:
            self.found.status[mode] = "endless"
            self.complain("endless", mode)
        except (KnowledgeError, DomainError) as error:
            self.found.status[mode] = "refused"
            self.found.remarks.append(Complaint("refused", mode, str(error)))
        except LimitError as error:
            self.found.status[mode] = "gave-up"
            self.found.remarks.append(Complaint("gave-up", mode, str(error)))
        except Exception as error:
            self.found.status[mode] = "crash"
            where = error.__traceback__
            while where is not None and where.tb_next is not None:
                where = where.tb_next
            at = f"{Path(where.tb_frame.f_code.co_filename).name}:{where.tb_frame.f_code.co_name}" if where else ""
            self.complain("crash", mode, f"{type(error).__name__} in {at}: {error}")
        finally:
            self.found.seconds[mode] = process_time() - begin
        return None

    def compared(self, mode: str, made: Callable[[], object]) -> None:
        """Make a comparison; a long comparison is a remark, since an exhaustive search takes most of the time."""

        def limited_comparison() -> None:
            try:
                with limited(COMPARING):
                    made()
            except EndlessError:
                self.found.remarks.append(Complaint("not compared", mode, ""))

        self.call(mode, limited_comparison, 2 * COMPARING)

    def modes(self, file: Path) -> None:
        """Plan in every selected mode, and run the checks that depend on a plan."""
        read = self.call("load", lambda: load(file))
        if read is None:
            return
        modes: dict[str, dict[str, Any]] = {"guarded": {}}
        if self.sampled(PAPER, "paper", "paper"):
            modes["paper"] = {"mode": "paper"}
        if self.sampled(OPTIMAL, "optimal", "optimal"):
            modes["optimal"] = {"mode": "optimal"}
        if len(self.world.problem.domain.levels) > 1 and self.sampled(STRICT, "strict", "strict"):
            modes["strict levels"] = {"leave_levels": False}
        if self.only.startswith(("proofs", "certificates", "recognition")):
            modes = {}
        elif self.only and "/" not in self.only:
            first = self.only if self.only in modes else "guarded"
            modes = {first: modes[first]}
        results = {mode: self.outcome(read, mode, **options) for mode, options in modes.items()}
        guarded = results.get("guarded")
        if guarded is not None and guarded.plan is not None and self.sampled(LESSONS, "lesson", "lead", "learn"):
            self.with_a_lesson(read, guarded.plan)
        refused = {mode for mode, status in self.found.status.items() if status == "refused" and mode in modes}
        answered = {mode for mode in modes if self.found.status.get(mode) in ("solved", "unsolvable")}
        if refused and answered:  # a search that gave up contradicts no result
            self.complain("refused by some modes only", "/".join(sorted(refused)), self.found.remarks[-1].text)
        if refused:
            return
        if not self.only or self.only == "checker":
            self.call("reading", lambda: read.reading, PROVING)  # planning may have ended while it read the scene
            self.call("checker", lambda: self.states(read.reading.problem))
            plans = [outcome.plan for outcome in results.values() if outcome is not None and outcome.plan is not None]
            self.call("checker", lambda: self.checker(read.reading.problem, plans))
        if self.sampled(CERTIFICATES, "certificates", "certificates"):
            self.compared("certificates", lambda: self.false_certificates(read))
        if self.sampled(CERTIFICATES, "proofs", "certificates", "proofs"):
            self.proofs(read)
        if self.sampled(STEPS, "steps", "steps"):
            self.fewest_steps(read)
        if self.world.wishes or self.sampled(SOFT, "soft", "soft"):
            self.soft_goals(file)
        if self.sampled(EXPORTS, "export", "export"):
            for level in self.world.problem.domain.levels:
                self.export(read, level)
        if self.sampled(EXECUTIONS, "execute", "execute"):
            self.execution(read, guarded)
        if self.sampled(RECOGNITION, "recognition", "recognition"):
            self.recognition("recognition", lambda: self.slices(read))
            self.call("recognition of names", lambda: self.names(self.renamed(file)))
            self.recognition("recognition of a crowd", lambda: self.crowd(file))

    def outcome(self, read: Scene, name: str, **options: Any) -> Outcome | None:
        """Plan in one mode, compare the outcome with the exhaustive search, and return the outcome."""
        result = self.call(name, lambda: plan(read, engine=NO_ENGINE, time_limit=SECONDS, **options))
        if result is None:
            return None
        outcome = result.outcome
        self.found.status[name] = outcome.status.value
        self.judge(name, outcome)
        return outcome

    def judge(self, mode: str, outcome: Outcome) -> None:
        """Compare an outcome with the exhaustive search."""
        least, surely, known = self.found.least, self.surely, self.found.known
        if outcome.plan is not None:
            wrong = faults(self.meant, outcome.plan)
            for fault in wrong[:1]:
                self.complain("invalid plan", mode, fault)
            if known and surely is None and not wrong:
                self.complain("a plan where there is none", mode)
            if mode == "strict levels" and any(
                step.level != self.world.problem.domain.levels[0] for step in outcome.plan.steps
            ):
                self.complain("a level left", mode)
            self.found.length = max(self.found.length, len(outcome.plan.primitives))
        if outcome.status is Status.UNSOLVABLE:
            if known and least is not None and mode != "strict levels":
                self.complain("false unsolvable", mode, outcome.reason.text if outcome.reason else "")
            self.certificate(mode, outcome)
        if outcome.status is Status.GAVE_UP:
            text = outcome.reason.text if outcome.reason else ""
            self.found.remarks.append(Complaint("gave-up", mode, text))
        if outcome.bound is not None and known and outcome.plan is not None:
            own = float(cost(self.meant, outcome.plan))
            self.bound(mode, outcome.bound, math.inf if least is None else float(least), own)
            if mode == "optimal" and outcome.bound < own - EXACT:
                self.found.remarks.append(Complaint("unproved", mode, f"{outcome.bound} … {own}"))

    def fewest_steps(self, read: Scene) -> None:
        """Compare the plan with the fewest steps, and the bound, with the exhaustive search of the world with unit costs."""
        problem, own = self.world.problem, self.found.least
        alike = {name: replace(one, cost=1.0, price=None) for name, one in problem.domain.behaviors.items()}
        meant = Interpreter(replace(problem, domain=replace(problem.domain, behaviors=alike)))
        result = self.call("steps", lambda: plan(read, engine=NO_ENGINE, time_limit=SECONDS, minimise="steps"))
        try:
            least = meant.explored(problem.domain.levels[-1], MOST).least
        except TooManyStatesError:
            return
        if result is None:
            return
        outcome, self.found.status["steps"] = result.outcome, result.outcome.status.value
        if outcome.status is Status.UNSOLVABLE and own is not None:
            self.complain("false unsolvable", "steps")
        if outcome.plan is not None:
            if wrong := faults(self.meant, outcome.plan):
                self.complain("invalid plan", "steps", wrong[0])
            self.bound("steps", outcome.bound, math.inf if least is None else least, len(outcome.plan.primitives))

    def bound(self, mode: str, bound: float | None, least: float, own: float) -> None:
        """Compare a bound with the least cost, and with the cost of the plan that has been found."""
        if bound is not None and bound > min(least, own) + EXACT:
            self.complain(
                "wrong bound", mode, f"at least {bound} is claimed, {least} suffices; its own plan costs {own}"
            )

    def soft_goals(self, file: Path) -> None:
        """Plan with soft goals, and compare the outcomes with the exhaustive search of each choice of soft goals.

        Soft goals are some of the goals, and the wishes of the world.
        """
        rng, world = Random(f"soft {self.world.seed}"), self.world
        weights = {symbol: Fraction(rng.choice(WEIGHTS)) for symbol in world.problem.goal if rng.random() < 0.7}
        problem = softened(world.problem, world.wishes, weights)
        if not problem.weights:
            return
        file.write_text(scene(replace(world, problem=problem)), encoding="utf-8")
        soft = Interpreter(problem)
        try:
            costs = least_costs(soft, MOST)
        except TooManyStatesError:
            return
        read = self.call("load with soft goals", lambda: load(file))
        if read is None:
            return
        for mode, options in SOFT_MODES.items():
            call = partial(plan, read, engine=NO_ENGINE, time_limit=SECONDS, **options)
            if (result := self.call(mode, call)) is not None:
                self.found.status[mode] = result.outcome.status.value
                self.soft_outcome(mode, result.outcome, soft, costs)
        if self.sampled(EXPORTS, "export", "soft"):
            self.soft_export(read, soft)
        if self.sampled(EXECUTIONS, "execute", "soft"):
            self.soft_execution(read, soft)

    def soft_outcome(
        self, mode: str, outcome: Outcome, soft: Interpreter, costs: Mapping[frozenset[Symbol], Fraction]
    ) -> None:
        """Compare an outcome for soft goals with the least total, and its penalty with the goals that hold in the end.

        `costs` are the least costs of the choices of soft goals. The stated cost of meeting an unmet goal must suffice.
        """
        problem, least = soft.problem, least_total(costs, soft.problem.weights)
        if outcome.status is Status.UNSOLVABLE and least is not None and mode != "soft strict":
            self.complain("false unsolvable", mode)
        if outcome.plan is None:
            return
        spent, end = executed(soft, outcome.plan)
        unmet = {s: weight for s, weight in problem.weights.items() if not soft.meets(end, s, problem.goal[s])}
        meant = soft.without_weights().wanting({s: value for s, value in problem.goal.items() if s not in unmet})
        if wrong := faults(meant, outcome.plan):
            self.complain("invalid plan", mode, wrong[0])
            return
        if outcome.penalty != sum(unmet.values()) or outcome.penalty != sum(one.weight for one in outcome.forgone):
            self.complain("wrong penalty", mode, f"{outcome.penalty} and {outcome.unmet}, but unmet are {unmet}")
        own = float(spent) + float(sum(unmet.values()))
        if least is None or own < float(least) - EXACT:
            self.complain("a total below the least", mode, f"{own}, {least}")
        self.bound(mode, outcome.bound, math.inf if least is None else float(least), own)
        for one in outcome.forgone:
            if one.fact.symbol in unmet:
                met = problem.weights.keys() - unmet.keys() | {one.fact.symbol}
                more = [cost for kept, cost in costs.items() if kept >= met]
                if one.price is not None and not (more and float(spent + one.price) >= float(min(more)) - EXACT):
                    self.complain("a soft goal costs more", mode, f"{one}, but {min(more, default=None)} - {spent}")
                if one.price is None and "no plan meets" in one.why and more:
                    self.complain("a soft goal can be met", mode, f"{one}, but at cost {min(more)}")

    def soft_export(self, read: Scene, soft: Interpreter) -> None:
        """Export the lowest level of a task with soft goals as PDDL, import it, and compare the least totals."""
        from confab.reasoner.pddl.exporting import to_pddl
        from confab.reasoner.pddl.importing import imported
        from confab.reasoner.pddl.syntax import parse

        mode, problem = "export soft", soft.problem

        def back() -> Problem:
            exported = to_pddl(read.problem)
            return imported(parse(exported.domain, exported.problem)).problem

        again = self.call(mode, back)
        if again is None or _assignments(again) > MOST_ACTIONS:
            return
        try:
            got = least_total(least_costs(Interpreter(again), 4 * MOST), again.weights)
            states = soft.without_weights().wanting({}).explored(problem.domain.levels[-1], MOST, rests=False).costs
        except TooManyStatesError:
            return
        costs: dict[frozenset[Symbol], Fraction] = {}
        kinds, hard = problem.domain.situations, problem.goal.keys() - problem.weights.keys()
        for kept in choices(problem.weights):
            flat = soft.without_weights().wanting({s: v for s, v in problem.goal.items() if s in hard | kept})
            rested = {s: rest for s in soft.slots if (rest := kinds[s.situation].rest) is not None}
            rested = {
                s: rest
                for s, rest in rested.items()
                if soft.initial[soft.slots[s]] == rest and not flat.problem.releases(s)
            }
            whole = flat.wanting({**rested, **flat.problem.goal})
            some = [Fraction(cost) for (state, _), cost in states.items() if whole.wanted(state)]
            costs |= {kept: min(some)} if some else {}
        wanted = least_total(costs, problem.weights)
        if wanted != got:
            self.complain("export means something else", mode, f"least {wanted}, exported {got}")

    def certificate(self, mode: str, outcome: Outcome) -> None:
        """Compare a certificate of unsolvability with all reachable states."""
        certificate = getattr(outcome, "certificate", None)
        if not hasattr(outcome, "certificate"):
            return
        if certificate is None:
            self.complain("uncertified", mode, outcome.reason.text if outcome.reason else "")
            return
        self.claims(mode, certificate)

    def claims(self, mode: str, certificate: Certificate) -> None:
        """Compare the claims of a certificate with all reachable states."""
        for fact in certificate.never:
            if any(self.meant.meets(state, fact.symbol, fact.value) for state in self.reached):
                self.complain("a false certificate", mode, f"{fact} can come to hold")
                return
        for symbol, value in certificate.always.items():
            if not all(self.meant.meets(state, symbol, value) for state in self.reached):
                self.complain("a false certificate", mode, f"{symbol} isn't always {value}")
                return

    def checker(self, problem: Problem, plans: Sequence[Plan], many: int = 2) -> None:
        """Compare the plan checker with the interpreter on plans, `many` changed copies of each plan, and random steps."""
        drawn = [corrupted(plan, problem, self.rng) for plan in plans for _ in range(many)]
        for steps in [*plans, *drawn, random_steps(self.meant, self.rng)]:
            if max((step.level for step in steps.walk()), default=0) != problem.domain.levels[-1]:
                continue  # the checker also accepts plans of upper levels only, which other planners return
            said, meant = validate(problem, numbered(steps, problem)), faults(self.meant, steps)
            if bool(said) is not bool(meant):
                what = "the checker takes it for a plan" if meant else "the checker doesn't take it for a plan"
                text = "; ".join(f"{step.path} {step.behavior} {' '.join(step.arguments)}" for step in steps.walk())
                self.complain(what, "checker", f"{meant[:1]} {[one.text for one in said[:1]]}: {text}")
                return

    def states(self, problem: Problem, many: int = STATES) -> None:
        """Compare derived values and successors by the plan checker with those by the interpreter in some reachable states.

        The values of a state are read in random order, since the checker keeps values that it has derived.
        """
        meant, level = self.meant, problem.domain.levels[-1]
        derived = [symbol for symbol, slot in meant.slots.items() if slot >= meant.stated]
        derived = [one for one in derived if one.situation in problem.domain.rules and one.situation in meant.kinds]
        actions = meant.actions(level)
        for state in self.rng.sample(self.reached, min(len(self.reached), many)):
            values = {symbol: _text(state[slot]) for symbol, slot in meant.slots.items() if slot < meant.stated}
            before = {**problem.initial, **values}
            stated = [symbol for symbol in values if symbol.situation not in problem.domain.remembers]
            facts = LoggedState(problem, before)
            for symbol in self.rng.sample(derived, len(derived)):
                said = facts.value(symbol.situation, symbol.arguments) or FALSE
                if said != meant.value(state, symbol):
                    self.complain("the checker derives another value", "checker", f"{symbol} is {said} in {before}")
                    return
            for action in self.rng.sample(actions, min(len(actions), many)):
                name, arguments = action.behavior.name, action.arguments
                after = successor(problem, problem.domain.behaviors[name], arguments, before)
                got = None if after is None else [after.get(symbol, FALSE) for symbol in stated]
                wanted = [
                    [_text(made[meant.slots[s]]) for s in stated] for _, made in meant.done(name, arguments, state)
                ]
                if wanted and got not in wanted:  # the successor has no bounds of sums, which the interpreter respects
                    self.complain("the checker has another successor", "checker", f"{name} {arguments} in {before}")
                    return

    def recognition(self, mode: str, slices: Callable[[], Iterable[Slice]]) -> None:
        """Compare parts of scenes that task recognition selects with the whole scenes; a long comparison is a remark."""
        for one in self.call(mode, lambda: list(slices()), COMPARING) or ():
            if part := self.call(mode, one.part):
                self.compared(mode, partial(self.part, one, part))

    def part(self, one: Slice, part: Reading) -> None:
        """Compare a part of a scene with the whole scene."""
        if said := one.wrong(part):
            self.complain("the part of the scene differs", "recognition", f"{one.goals}, {one.queries} queries: {said}")

    def slices(self, read: Scene) -> Iterator[Slice]:
        """Yield the comparisons of task recognition with the whole scene, for the task and for another goal."""
        states = self.rng.sample(self.reached, min(len(self.reached), SLICED)) or [self.meant.initial]
        yield Slice(read.knowledge, (), self.queries(), self.meant, states, MOST)
        meant, goals = self.other_goal(states)
        yield Slice(read.knowledge, goals, self.queries(), meant, states, MOST)

    def crowd(self, file: Path) -> Iterator[Slice]:
        """Yield the comparison of task recognition with the whole scene in a larger world of the same seed."""
        of = self.world.problem
        alike = {
            "partial": "way" in of.relations,
            "ternary": "between" in of.relations,
            "overlapping": "C" in of.classes,
        }
        shares = {name: 1.0 for name, has in alike.items() if has}
        world, meant, states = crowded(self.world.seed, constrained=0.3, **shares)
        file.write_text(scene(world), encoding="utf-8")
        few = states[:: 1 + len(states) // SLICED]
        yield Slice(load(file).knowledge, (), self.queries(), meant, few, MOST // 100)

    def queries(self) -> int:
        """Return a number of queries; recognition needs its last query, which follows all routes, only after few other queries."""
        return self.rng.choice((2, 3, relevance.ROUNDS))

    def other_goal(self, states: list[State]) -> tuple[Interpreter, list[str]]:
        """Return an interpreter of the world with another goal, from a state, and the text of the goal."""
        symbols = [
            s
            for s, slot in self.meant.slots.items()
            if slot < self.meant.stated and not self.amount(s) and not self.meant.kinds[s.situation].added
        ]
        if not symbols:
            return self.meant, []
        changed = [s for s in symbols if self.meant.value(states[0], s) != self.meant.value(self.meant.initial, s)]
        symbol = self.rng.choice(changed or symbols)
        value = self.meant.value(states[0], symbol)
        words = symbol.arguments[0], symbol.situation, *symbol.arguments[1:], value
        return self.meant.wanting({**self.meant.problem.goal, symbol: value}), [" ".join(words)]

    def amount(self, symbol: Symbol) -> bool:
        """Return whether a symbol has a number."""
        return self.meant.kinds[symbol.situation].quantity is not None

    def renamed(self, file: Path) -> KnowledgeGraph:
        """Write and load a variant of the scene with other terms that have the local names of its terms.

        A prefix or only an import leads to the other terms. An individual has the name of a class of the core ontology.
        """
        rng, space = self.rng, "https://example.org/other#"
        names, lines = [*self.world.problem.individuals], list[str]()
        for name in (*names, *self.world.parents):
            if rng.random() < 0.3:
                kinds = rng.choice(("owl:NamedIndividual, <#Kind>", "<#Kind>", "owl:NamedIndividual"))
                lines.append(f"<{space}{name}> a {kinds} .")
            if rng.random() < 0.2:
                lines.append(f"<#member> a {rng.choice(('owl:NamedIndividual, ', ''))}<{space}{name}> .")
        prefix = f"@prefix other: <{space}> .\n" if rng.random() < 0.5 else ""
        text = scene(self.world).replace("owl:imports", "owl:imports <https://example.org/other>,", 1)
        text = re.sub(rf"(?<!\w):{rng.choice(names)}\b(?![.#])", f":{rng.choice(CORE_CLASSES)}", text)
        head = "@prefix owl: <http://www.w3.org/2002/07/owl#> .\n<https://example.org/other> a owl:Ontology ."
        (self.folder / "other.ttl").write_text("\n".join([head, *lines]), encoding="utf-8")
        file.write_text(prefix + text, encoding="utf-8")
        return load(file).knowledge

    def names(self, knowledge: KnowledgeGraph) -> None:
        """Compare the names in the part of a scene that recognition selects with those in the whole scene."""
        part, whole = relevance.recognise(knowledge), read_names(knowledge)
        used = {name for of, its in part.problem.classes.items() if its for name in (of, *its) if name in part.names}
        if wrong := {name: other for name in used if (other := whole.short(part.names.iri(name))) != name}:
            self.complain("the part of the scene has other names", "recognition", wrong)

    def proofs(self, read: Scene) -> None:
        """Certify the task without a search, and judge the certificates without the planner.

        The planner hides a wrong certificate, since it gives up if the checker rejects the certificate. The certificate of each
        kind is judged, too, since one kind hides the faults of another. Certificates of cases and of states should be found for
        each task without a plan, and certificates of facts and of pairs for some of these tasks, so a missing certificate is a
        remark. The checker must reject certificates that have lost a claim or have a false one.
        """
        problem = self.call("the whole scene", lambda: read.reading.problem)
        if problem is None:  # too many effects for the whole scene, but not for the part that the task needs
            return
        for kind in ("all", *KINDS):
            self.proofs_of(problem, kind)
        self.call("proofs by a search", lambda: self.searched(problem))

    def proofs_of(self, problem: Problem, kind: str, known: Certificate | None = None) -> None:
        """Search for a certificate of one kind, and judge it unless it is the known certificate."""
        mode = f"proofs by {kind}"
        one = self.call(mode, partial(certificate, kind, problem), PROVING)
        if mode not in self.found.status and (one is None or one != known):
            self.compared(mode, partial(self.proof, problem, mode, one))

    def proof(self, problem: Problem, mode: str, one: Certificate | None) -> None:
        """Judge a certificate of one kind, or that there is none."""
        from confab.planner.certificate_checks import refusal

        found = self.found
        if one is None:
            if found.known and found.least is None:
                found.remarks.append(Complaint("no certificate", mode, ""))
            return
        if found.least is not None and self.surely is not None:
            self.complain("a certificate although there is a plan", mode, one)
        if said := refusal(problem, one):
            self.complain("a certificate that its checker rejects", mode, f"{said}: {one}")
        self.claims(mode, one)
        if one.cases <= FEW_CASES:
            for what, false in corrupted_certificates(problem, one, self.rng):
                if accepted(problem, what, false):
                    self.complain("a false certificate is accepted", mode, f"{what}: {false}")

    def searched(self, problem: Problem) -> None:
        """Judge the proofs by relaxed reachability and by the examination of all states, which other proofs hide."""
        from confab.planner.hierarchical.lowest_level import exhausted, proved

        try:
            task = proved(problem, problem.domain.levels[-1])
            states = None if isinstance(task, Reason) else exhausted(task, MOST)
            proof = states.text if isinstance(states, Reason) else None
        except UnsolvableError as error:
            proof = error.reason.text
        if proof is not None and self.found.least is not None:
            self.complain("a proof although there is a plan", "proofs by a search", proof)
        if proof is None and self.surely is None and self.found.known:
            self.found.remarks.append(Complaint("no proof", "proofs by a search", ""))

    def false_certificates(self, read: Scene) -> None:
        """Test the certificate checker with certificates of tasks that lack one behaviour.

        If the complete task has a plan, the checker must reject these certificates.
        """
        if self.found.least is None or self.surely is None:
            return
        problem = read.reading.problem
        for what, found in (
            *of_lesser_tasks(problem, self.rng),
            *of_a_task_with_a_plan(problem, self.meant, self.reached, self.rng),
        ):
            if accepted(problem, what, found):
                self.complain("a false certificate is accepted", "certificates", f"{what}: {found}")

    def with_a_lesson(self, read: Scene, first: Plan) -> None:
        """Plan again with a memory that has learned one plan."""
        from confab.memory import Memory

        def remembered() -> Memory:
            memory = Memory.of(read)
            memory.learn(read, first)
            return memory

        memory = self.call("learn", remembered)
        if memory is not None:
            self.outcome(read, "leading", mode="leading", memory=memory)

    # ------------------------------------------------------------------------------------------------------------- PDDL

    def export(self, read: Scene, level: int) -> None:
        """Export a level as PDDL and import the result, which must be solvable exactly if the level is solvable."""
        from confab.reasoner.pddl.exporting import to_pddl
        from confab.reasoner.pddl.importing import imported
        from confab.reasoner.pddl.syntax import parse
        from confab.reasoner.pddl.words import PddlError

        mode = f"export {level}"
        exported = self.call(mode, lambda: to_pddl(read.problem, level))
        if exported is None:
            return

        def back() -> Problem | None:
            try:
                return imported(parse(exported.domain, exported.problem)).problem
            except PddlError as error:
                self.complain("export isn't read", mode, error)
                return None

        problem = self.call(mode, back)
        if problem is None:
            return
        # unified-planning reads no axioms
        if ":derived " not in exported.domain and self.sampled(READERS, "reader", "export"):
            self.read_by_unified_planning(mode, exported.domain, exported.problem)
        if _assignments(problem) > MOST_ACTIONS:
            return
        again = Interpreter(problem)
        rested = {
            symbol: str(self.world.problem.domain.situations[symbol.situation].rest)
            for symbol, slot in self.meant.slots.items()
            if self.world.problem.domain.situations[symbol.situation].rest == self.meant.initial[slot]
            and self.world.problem.first_level(symbol) <= level
            and not self.world.problem.releases(symbol)
        }
        flat = self.meant.wanting({**rested, **self.world.problem.goal})
        try:
            wanted = flat.explored(level, MOST, rests=False).least
            if again.problem.domain.levels:
                got = again.explored(again.problem.domain.levels[-1], 4 * MOST, rests=False).least
            else:
                got = 0 if again.wanted(again.initial) else None
        except TooManyStatesError:
            return
        if (wanted is None) != (got is None):
            self.complain("export means something else", mode, f"least {wanted}, exported {got}")

    def read_by_unified_planning(self, mode: str, domain: str, problem: str) -> None:
        """Record a fault if unified-planning can't read the exported PDDL."""
        from unified_planning.io import PDDLReader

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # unified-planning uses deprecated functions of pyparsing
                PDDLReader().parse_problem_string(domain, problem)
        except Exception as error:
            self.complain("unified-planning can't read the export", mode, f"{type(error).__name__}: {error}")

    # -------------------------------------------------------------------------------------------------------- execution

    def execution(self, read: Scene, first: Outcome | None) -> None:
        """Execute the task, sometimes with a fact that changes during execution."""
        texts: list[str] = []
        if first is not None and first.plan is not None and first.plan.steps and self.rng.random() < 0.7:
            steps = [step for step in first.plan.primitives if len(step.path) > 1]
            after = ".".join(map(str, self.rng.choice(steps).path)) if steps else str(first.plan.primitives[0].id)
            if fact := self.fact():
                texts = [f"after={after} {fact}"]
        mode = "execute"
        run = self.call(mode, lambda: read.execute(interventions=texts, time_limit=SECONDS))
        if run is None:
            return
        state = self.replayed(mode, run.episode, self.meant, texts)
        if state is None:
            return
        episode, reached = run.episode, self.meant.wanted(state)
        if (episode.status is End.REACHED) and not reached:
            self.complain("said to be reached, and isn't", mode, texts)
        if episode.status is End.IMPOSSIBLE:
            initial, self.meant.initial = self.meant.initial, state
            with suppress(TooManyStatesError):
                if self.meant.explored(self.world.problem.domain.levels[-1], MOST).least is not None:
                    self.complain("said to be impossible, and isn't", mode, texts)
            self.meant.initial = initial
        if episode.status is End.GAVE_UP:
            self.found.remarks.append(Complaint("gave-up", mode, "; ".join(r.text for r in episode.reasons)))

    def soft_execution(self, read: Scene, soft: Interpreter) -> None:
        """Execute a task with soft goals, sometimes with a fact that changes, and compare which goals hold in the end."""
        mode, fact, goal = "soft execute", self.fact(), soft.problem.goal
        texts = [f"after={self.rng.choice((1, 1, 2))} {fact}"] if fact and self.rng.random() < 0.5 else []
        run = self.call(mode, lambda: read.execute(interventions=texts, time_limit=SECONDS))
        state = None if run is None else self.replayed(mode, run.episode, soft, texts)
        if run is None or state is None:
            return
        hard = {symbol: value for symbol, value in goal.items() if symbol not in soft.problem.weights}
        dropped = {one.symbol for one, _ in run.episode.interventions}
        if run.episode.status is End.REACHED and not all(
            soft.meets(state, symbol, value) for symbol, value in hard.items() if symbol not in dropped
        ):
            self.complain("said to be reached, and isn't", mode, texts)
        for one in run.soft_goals:
            if one.fact.symbol in soft.slots and soft.meets(state, one.fact.symbol, one.fact.value) is not one.met:
                self.complain("a soft goal is said to be met, and isn't, or the reverse", mode, f"{one}; {texts}")

    def replayed(self, mode: str, episode: Episode, meant: Interpreter, texts: Sequence[str]) -> State | None:
        """Return the final state of an execution; record a fault if a step can't be executed."""
        self.found.status[mode] = episode.status.value
        state = list(meant.initial)
        events: list[tuple[float, int, Any]] = [(one.end, 0, one.step) for one in episode.events if one.ok]
        events += [(at, 1, one) for one, at in episode.interventions]
        for _, kind, one in sorted(events, key=lambda event: event[:2]):
            if kind:
                for fact in one.facts:
                    if fact.symbol in meant.slots:
                        slot = meant.slots[fact.symbol]
                        amount = meant.kinds[fact.symbol.situation].quantity
                        state[slot] = fact.value if amount is None else type(state[slot])(fact.value)
                state = list(meant.closed(state))
                continue
            made = list(meant.done(one.behavior, one.arguments, tuple(state)))
            if not made:
                self.complain("a step that can't be done is done", mode, f"{one}; {texts}")
                return None
            state = list(made[0][1])
        return tuple(state)

    def alone(self, situation: str) -> bool:
        """Return whether a situation type shares no values with other situation types.

        A changed fact of a type with shared values could move an object that another fact places elsewhere.
        """
        members = self.world.problem.members
        others = [kind for name, kind in self.meant.kinds.items() if name != situation and not kind.boolean]
        own = members(self.meant.kinds[situation].range)
        return self.meant.kinds[situation].boolean or not any(own & members(kind.range) for kind in others)

    def fact(self) -> str:
        """Return the text of a random fact that may become true; an empty text if there is no such fact."""
        symbols = [s for s, slot in self.meant.slots.items() if slot < self.meant.stated and self.alone(s.situation)]
        symbols = [s for s in symbols if s.situation not in self.world.problem.domain.remembers]
        if not symbols:
            return ""
        symbol: Symbol = self.rng.choice(symbols)
        kind = self.meant.kinds[symbol.situation]
        if kind.quantity is not None:
            values: tuple[str, ...] = ("0", "1", "2")
        else:
            values = ("true", "false") if kind.boolean else self.world.problem.classes[kind.range]
        return " ".join((symbol.arguments[0], symbol.situation, *symbol.arguments[1:], self.rng.choice(values)))


def _assignments(problem: Problem) -> int:
    """Return the number of assignments of individuals to the parameters and variables of a problem's behaviours."""
    behaviors, classes = problem.domain.behaviors.values(), problem.classes
    return sum(math.prod(len(classes.get(kind, ())) for kind in one.kinds.values()) for one in behaviors)
