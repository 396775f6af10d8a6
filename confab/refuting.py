"""Refutations: the next plan, and later calls, avoid behaviours that physics found impossible in a situation."""

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

if TYPE_CHECKING:
    from confab.physics import Report

log = logging.getLogger(__name__)


def refuted_in(scene: Known, report: Report) -> tuple[Refutation, ...]:
    """Return the refutation of the first failed rollout; None if the failure wasn't a missing motion."""
    failure = report.shown.failure
    if failure is None:
        return ()
    chain = chain_to(report.plan, failure.step.path)
    why = ": ".join(filter(None, (failure.verdict.code, ", ".join(failure.verdict.objects))))
    return refuted_by(scene.problem, chain, failure.verdict.facts, why, failure.verdict.likewise)


def knowing(scene: S, refutations: Sequence[Refutation]) -> S:
    """Return a scene in which some behaviours are refuted; this scene is unchanged."""
    return type(scene)(with_refuted(scene.knowledge, scene.reading, refutations), dict(scene.seconds))


def keep(scene: Known, refutations: Sequence[Refutation]) -> None:
    """Write refutations into ``SCENE.reach.ttl`` beside a scene of the user, for later calls.

    They are valid as long as the geometry doesn't change. Nothing is written beside shipped scenes.
    """
    path = scene.knowledge.path
    if not refutations or path is None or path.is_relative_to(ontology.ROOT):
        return
    file = path.with_name(f"{path.stem}.reach.ttl")
    triples = [triple for one in refutations for triple in refuted(scene.knowledge, scene.reading, one)]
    with suppress(FileNotFoundError):  # a scene that states reach by hand has no such file
        try:
            add_to_reach(file, scene.knowledge, triples)
        except (PermissionError, FileExistsError, KnowledgeError) as error:
            log.warning("%s: %s; what was refuted isn't kept", file, error)
