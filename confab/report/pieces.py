"""The pieces of the report: tiles, the timeline, the plan as a tree, verdicts. Each is HTML that needs `style.css`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from confab.planner.plan import Plan, Step
from confab.reasoner.symbols import FALSE, TRUE
from confab.report.course import Bar, Timeline
from confab.report.markup import Markup, joined, styled, tag

if TYPE_CHECKING:
    from confab.labels import Labels
    from confab.planner.causal_links import Purpose

Notes = Mapping[tuple[int, ...], str]
Tile = tuple[str, str, str]
"""Name, value and tone (good, bad or empty) of a tile."""
COLORS = 8
MOST_BARS, MOST_LANES = 1500, 40
"""Maximum numbers of bars and of lanes of facts; a note gives the number of those left out."""
LAST = 0.04
"""Share of the axis that follows the last primitive."""
MEANT = {True: ("✓", "ok"), False: ("✗", "bad")}


def tiles(those: Iterable[Tile]) -> Markup:
    """Return tiles side by side."""
    return tag(
        "div",
        [tag("div", tag("span", what), tag("b", said), class_=f"tile {tone}".strip()) for what, said, tone in those],
        class_="tiles",
    )


def number(value: float) -> str:
    """Return a number as text with about three significant digits."""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def anchor(path: Sequence[int]) -> str:
    """Return the HTML ID of a step."""
    return "s" + "-".join(map(str, path))


# ------------------------------------------------------------------------------------------------------------ plan


def tree(
    plan: Plan,
    labels: Labels | None = None,
    notes: Notes | None = None,
    purposes: Mapping[tuple[int, ...], Purpose] | None = None,
    course: Timeline | None = None,
) -> Markup:
    """Return a plan as folding lists: each step with its result, measurements and purposes."""
    from confab.why import account, numbers

    why = {}
    if labels is not None and purposes is not None:
        why = {step.path: step for step in account(plan, purposes, labels, "").steps}
    number_of, bars = numbers(plan), course.by_path if course else {}
    failed = course.failed.step.path if course and course.failed else None
    unit = course.unit if course else ""

    def item(step: Step) -> Markup:
        bar, note = bars.get(step.path), (notes or {}).get(step.path, "")
        ok = bar.ok if bar is not None else None
        small = f"{number_of[step.path]} · {step.behavior} #{step.id}"
        if bar is not None and unit == "s":
            small += f" · {bar.end - bar.begin:.1f} s"
        head = [
            tag("span", labels.step(step) if labels else " ".join((step.behavior, *step.arguments)), class_="what"),
            " ",
            tag("small", small),
        ]
        if ok is not None:
            head += [" ", tag("span", MEANT[ok][0], class_=MEANT[ok][1])]
        if note.strip("✓ "):
            head += [" ", tag("span", note, class_="bad" if "✗" in note else "note")]
        body = [*(why[step.path].reasons() if step.path in why else ()), *_numbers(step, bar, labels)]
        below = [item(inner) for inner in step.steps]
        open_ = len(step.path) == 1 or (failed is not None and failed[: len(step.path)] == step.path)
        inside = [tag("summary", head), *body, tag("ul", below) if below else None]
        return tag(
            "li", tag("details", inside, open=open_) if body or below else tag("div", head), id=anchor(step.path)
        )

    return tag("ul", [item(step) for step in plan.steps], class_="plan")


def _numbers(step: Step, bar: Bar | None, labels: Labels | None) -> list[Markup]:
    """Return the measurements of a primitive, and the individuals of a step's determined variables."""
    pairs = [(name, number(value)) for name, value in (bar.measured if bar else {}).items()]
    pairs += [(name, labels.name(value) if labels else value) for name, value in step.bindings.items()]
    if not pairs:
        return []
    return [tag("dl", [tag("div", tag("dt", name.replace("_", " ")), tag("dd", value)) for name, value in pairs])]


# ------------------------------------------------------------------------------------------------------------ timeline


def timeline(course: Timeline, labels: Labels | None = None, speed: float | None = None) -> Markup:
    """Return the timeline: a lane per level, per hand, and per situated object, with a sign whether its goal is met.

    Parameters
    ----------
    course : Timeline
    labels : Labels, optional
    speed : float, optional
        Ratio of the axis's time to that of a film on the page, which then follows clicks.
    """
    if not course.bars:
        return Markup("")
    symbols = course.shown_symbols()
    late = any(phase.begin >= course.end for s in symbols for phase in course.phases[s])
    end = (course.end or 1.0) * (1 + LAST if late else 1)  # leaves room for the last primitive's effects
    rows: list[Markup] = []
    by_path = course.by_path
    levels = sorted({step.level for step in course.plan.walk() if step.steps})
    kinds = {name: i for i, name in enumerate(dict.fromkeys(bar.step.behavior for bar in course.bars))}
    for level in levels:
        steps = [by_path[s.path] for s in course.plan.walk() if s.level == level and s.steps and s.path in by_path]
        rows.append(_lane(f"level {level}", [_bar(bar, end, labels, "level") for bar in steps], kind="level"))
    drawn = course.bars[:MOST_BARS]
    for who, bars in course.lanes().items():
        name = (labels.name(who) if labels else who) if who else "steps"
        those = [bar for bar in bars if bar in drawn] if len(drawn) < len(course.bars) else bars
        rows.append(
            _lane(name, [_bar(bar, end, labels, f"c{kinds[bar.step.behavior] % COLORS}") for bar in those], kind="hand")
        )
    values = sorted({phase.value for s in symbols for phase in course.phases[s]} - {TRUE, FALSE})
    colors = {value: f"v{i % COLORS}" for i, value in enumerate(values)} | {TRUE: "v1", FALSE: "v0"}
    for symbol in symbols[:MOST_LANES]:
        ends = [(p.begin, end if p.end >= course.end else p.end, p.value) for p in course.phases[symbol]]
        last = len(ends) - 1
        phases = [
            _phase(begin, until if number == last else min(until, course.end), value, end, labels, colors[value])
            for number, (begin, until, value) in enumerate(ends)
            if until > begin
        ]
        rows.append(_lane(labels.about(symbol) if labels else str(symbol), phases, course.met(symbol), "fact"))
    marks = [
        tag("div", class_="mark", style=f"left:{_share(at, end)}", title=text, data_t=f"{at:.3f}")
        for at, text in course.marks
    ]
    left_out = [f"{len(course.bars) - len(drawn)} more primitives" if len(drawn) < len(course.bars) else ""]
    left_out += [f"{len(symbols) - MOST_LANES} more lanes" if len(symbols) > MOST_LANES else ""]
    said = ", ".join(filter(None, left_out))
    width = f"min-width:min({max(40, round(12 + 1.2 * len(drawn)))}rem, 400rem)"
    inner = tag("div", rows, _axis(end, course.unit), tag("div", marks, tag("div", class_="cursor"), class_="over"),
                class_="lanes", style=width)  # fmt: skip
    hint = "click a bar to see it in the film" if speed else "a click leads to the step in the plan"
    return tag(
        "figure",
        tag("div", inner, class_="scroll"),
        tag("figcaption", tag("output", hint), f" · {said} not drawn" if said else None),
        [tag("p", f"{at:.1f} {course.unit}: {text}", class_="happened") for at, text in course.marks],
        class_="timeline", data_end=f"{end:.3f}", data_speed=speed, data_unit=course.unit,
    )  # fmt: skip


def _lane(name: str, inner: Sequence[Markup], met: bool | None = None, kind: str = "") -> Markup:
    sign = (
        tag("span", MEANT[met][0], class_=MEANT[met][1], title="as wanted" if met else "not as wanted")
        if met is not None
        else None
    )
    return tag("div", tag("div", name, class_="who", title=name), tag("div", list(inner), class_="track"),
               tag("div", sign, class_="met"), class_=f"lane {kind}".strip())  # fmt: skip


def _share(part: float, whole: float) -> str:
    return f"{100 * part / whole:.3f}%"


def _bar(bar: Bar, end: float, labels: Labels | None, kind: str) -> Markup:
    words = labels.step(bar.step) if labels else " ".join((bar.step.behavior, *bar.step.arguments))
    bad = " failed" if bar.ok is False else ""
    note = f": {bar.note}" if bar.ok is False and bar.note else ""
    return tag(
        "a", tag("span", "✗ " if bad and not bar.step.steps else None, words),
        class_=f"bar {kind}{bad}", href=f"#{anchor(bar.step.path)}", title=words + note, data_t=f"{bar.begin:.3f}",
        style=f"left:{_share(bar.begin, end)};width:{_share(bar.end - bar.begin, end)}",
    )  # fmt: skip


def _phase(begin: float, until: float, value: str, end: float, labels: Labels | None, color: str) -> Markup:
    words = labels.name(value) if labels else value
    return tag(
        "span",
        tag("span", words),
        class_=f"bar {color}",
        title=words,
        style=f"left:{_share(begin, end)};width:{_share(until - begin, end)}",
    )


def _axis(end: float, unit: str) -> Markup:
    """Return ticks at round numbers, at most ten of them."""
    step = next(base * 10**power for power in range(-2, 9) for base in (1, 2, 5) if end / (base * 10**power) <= 10)
    ticks = [
        tag(
            "span",
            f"{number(i * step)} {unit}" if i == 0 or unit == "s" else number(i * step),
            style=f"left:{_share(i * step, end)}",
        )
        for i in range(int(end / step) + 1)
    ]
    return tag(
        "div", tag("div", class_="who"), tag("div", ticks, class_="track"), tag("div", class_="met"), class_="lane axis"
    )


# ------------------------------------------------------------------------------------------------------------ reasons


def verdict(told: Any) -> str:
    """Return physics' verdict on a step."""
    sign, tone = MEANT[bool(told.ok)]
    pairs = [
        tag("div", tag("dt", name.replace("_", " ")), tag("dd", number(value))) for name, value in told.measured.items()
    ]
    said = "done" if told.ok else joined(tag("b", told.code), ": ", told.message)
    return styled(tag("p", tag("span", sign, class_=tone), " ", said), tag("dl", pairs) if pairs else None)


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> Markup:
    """Return a table that scrolls horizontally if it is too wide."""
    head = tag("tr", [tag("th", name) for name in columns])
    body = [tag("tr", [tag("td", cell if cell is not None else "") for cell in row]) for row in rows]
    return tag("div", tag("table", tag("thead", head), tag("tbody", body)), class_="scroll")
