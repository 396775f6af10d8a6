"""The report of a run as one HTML page: what was wanted, the plan with its verdicts, where things were seen in the end."""

from __future__ import annotations

import html
from string import Template
from typing import TYPE_CHECKING

from confab.show import plan_html, summary

if TYPE_CHECKING:
    from confab.physics import Report
    from confab.scene import Result, Scene
    from reasoner.symbols import Symbol

PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>$title</title><style>
body { font: 16px/1.45 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #223; }
h1 { font-size: 1.5rem } h2 { font-size: 1.1rem; margin-top: 2rem }
.verdict { font-weight: 600; color: $color } video { width: 100%; border-radius: 6px }
table { border-collapse: collapse } th, td { text-align: left; padding: .2rem .9rem .2rem 0; border-bottom: 1px solid #dde }
ul.plan, ul.plan ul { list-style: none; padding-left: 1.2rem } code { color: #667 } .met { color: #176 } .unmet { color: #b21 }
</style></head><body>
<h1>$title</h1><p class="verdict">$verdict</p>$film
<h2>What was wanted, and what was seen in the end</h2>
<table><tr><th>object</th><th>situation type</th><th>before</th><th>wanted</th><th>seen</th></tr>$facts</table>
<h2>The plan</h2><p>$summary</p>$plan
<p>Seed $seed. Scene <code>$scene</code></p></body></html>
""")


def report_html(scene: Scene, result: Result, report: Report) -> str:
    """Return the page; the film is linked by its name, beside the page."""
    rollout = report.rollouts[0]
    film = (
        f'<video src="{html.escape(report.video.name)}" controls muted autoplay loop></video>' if report.video else ""
    )
    return PAGE.substitute(
        title=html.escape(scene.iri.rsplit("/", 1)[-1]),
        verdict=html.escape(report.summary()),
        color="#176" if report.verified else "#b21",
        film=film,
        facts="".join(_row(result, report, symbol) for symbol in sorted(rollout.state)),
        summary=html.escape(summary(result.outcome)),
        plan=plan_html(result.plan, report.notes()),
        seed=rollout.seed,
        scene=html.escape(scene.iri),
    )


def _row(result: Result, report: Report, symbol: Symbol) -> str:
    before, wanted = result.problem.initial[symbol], result.problem.goal.get(symbol)
    seen = report.rollouts[0].state[symbol]
    if wanted is None and seen == before:
        return ""
    kind = "" if wanted is None else ' class="met"' if wanted == seen else ' class="unmet"'
    cells = (" ".join(symbol.arguments), symbol.situation, before, wanted or "")
    return f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in cells)}<td{kind}>{html.escape(seen)}</td></tr>"
