"""HTML without a script, for notebooks: a plan as a tree, a verdict, a table. The HTML needs the style of `page.css`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from confab.page.markup import Markup, joined, number, styled, tag
from confab.planner.plan import Plan, Step

if TYPE_CHECKING:
    from confab.labels import Labels
    from confab.planner.causal_links import Purpose
    from confab.sim.verdict import Verdict

Notes = Mapping[tuple[int, ...], str]
MEANT = {True: ("✓", "ok"), False: ("✗", "bad")}


def tree(
    plan: Plan,
    labels: Labels | None = None,
    notes: Notes | None = None,
    purposes: Mapping[tuple[int, ...], Purpose] | None = None,
) -> Markup:
    """Return a plan as nested lists that the user can fold, with the note and the purposes of each step."""
    from confab.why import account, numbers

    why = {}
    if labels is not None and purposes is not None:
        why = {step.path: step for step in account(plan, purposes, labels, "").steps}
    number_of = numbers(plan)

    def item(step: Step) -> Markup:
        note = (notes or {}).get(step.path, "")
        names = " + ".join(f"{one.behavior} #{one.id}" for one in step.together)
        said = (
            labels.step(step)
            if labels
            else "; ".join(" ".join((one.behavior, *one.arguments)) for one in step.together)
        )
        head = [tag("span", said, class_="what"), " ", tag("small", f"{number_of[step.path]} · {names}")]
        if note:
            head += [" ", tag("span", note, class_="bad" if "✗" in note else "note")]
        body = why[step.path].reasons() if step.path in why else []
        below = [item(inner) for inner in step.steps]
        inside = [tag("summary", head), *body, tag("ul", below) if below else None]
        opened = len(step.path) == 1
        return tag("li", tag("details", inside, open=opened) if body or below else tag("div", head))

    return tag("ul", [item(step) for step in plan.steps], class_="plan")


def verdict(told: Verdict) -> str:
    """Return the verdict on a step that was executed in physics, as HTML."""
    sign, tone = MEANT[bool(told.ok)]
    pairs = [
        tag("div", tag("dt", name.replace("_", " ")), tag("dd", number(value))) for name, value in told.measured.items()
    ]
    said = "done" if told.ok else joined(tag("b", told.code), ": ", told.message)
    return styled(tag("p", tag("span", sign, class_=tone), " ", said), tag("dl", pairs) if pairs else None)


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> Markup:
    """Return an HTML table, which scrolls horizontally if it is too wide for the page."""
    head = tag("tr", [tag("th", name) for name in columns])
    body = [tag("tr", [tag("td", cell if cell is not None else "") for cell in row]) for row in rows]
    return tag("div", tag("table", tag("thead", head), tag("tbody", body)), class_="scroll")
