"""Confab: a robot planner whose knowledge lives in an ontology.

>>> import confab
>>> result = confab.load("beverage-serving").plan()
>>> [str(step) for step in result.plan.steps][0]
'22 B1_MOVE cup1 location7'
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from confab.memory import Memory
    from confab.scene import Result, Scene, load
    from reasoner.graph.knowledge import KnowledgeError

__version__ = "0.1.0"
__all__ = ["KnowledgeError", "Memory", "Result", "Scene", "load"]

_HOMES = {
    "KnowledgeError": "reasoner.graph.knowledge",
    "Memory": "confab.memory",
    "Result": "confab.scene",
    "Scene": "confab.scene",
    "load": "confab.scene",
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first asked for, so that the command line starts fast."""
    if name not in _HOMES:
        raise AttributeError(f"module 'confab' has no attribute '{name}'")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
