"""Refutations: behaviours that were found to be physically impossible in a situation.

The next plan and later calls avoid refuted behaviours.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from confab import ontology
from confab.known import Known, S
from confab.planner.acting.failure_memory import chain_to, refuted_by
from confab.reasoner.embodiment.reach import add_to_reach
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.reading.restating import refuted, with_refuted
from confab.reasoner.refutations import Refutation
from confab.sim.verdict import CODES

if TYPE_CHECKING:
    from confab.physics import Report

log = logging.getLogger(__name__)


def refuted_in(scene: Known, report: Report) -> tuple[Refutation, ...]:
    """Return the refutations that follow from the first failed rollout; the tuple is empty if motion planning didn't fail."""
    failure = report.shown.failure
    if failure is None:
        return ()
    chain = chain_to(report.plan, failure.step.path)
    verdict = failure.verdict
    message = "" if verdict.message in CODES.values() else verdict.message
    why = ": ".join(filter(None, (verdict.code, ", ".join(verdict.objects), message)))
    return refuted_by(scene.problem, chain, verdict.facts, why, verdict.likewise)


def knowing(scene: S, refutations: Sequence[Refutation]) -> S:
    """Return a copy of a scene in which some behaviours are refuted."""
    return type(scene)(with_refuted(scene.knowledge, scene.reading, refutations), dict(scene.seconds))


def keep(scene: Known, refutations: Sequence[Refutation]) -> None:
    """Write refutations into the file ``SCENE.reach.ttl`` beside a user's scene, for later calls.

    Refutations are valid until the geometry of the scene changes. For shipped scenes, no file is written.
    """
    path = scene.knowledge.path
    if not refutations or path is None or path.is_relative_to(ontology.ROOT):
        return
    file = path.with_name(f"{path.stem}.reach.ttl")
    triples = [triple for one in refutations for triple in refuted(scene.knowledge, scene.reading, one)]
    with suppress(FileNotFoundError):  # if the author of a scene states the reach facts, there is no such file
        try:
            add_to_reach(file, scene.knowledge, triples)
        except (PermissionError, FileExistsError, KnowledgeError) as error:
            log.warning("%s: %s; the refutations aren't saved", file, error)
