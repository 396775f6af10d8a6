"""Confab: a robot planner whose knowledge lives in an ontology.

===================  ==========================================================================================
`scenes()`           the shipped scenes' names
`load(name)`         a `Scene`: a shipped name, a file of your own, or the URL of a SPARQL endpoint
`scene.query(…)`     query the scene in SPARQL: a `Table`
`scene.plan(…)`      plan in the scene: a `Result`
`scene.verify(…)`    execute a plan in physics: a `Report`
`scene.execute(…)`   execute the task in a closed loop, with interventions: an `Execution`
`Memory`             experience from planning and execution
`practise(…)`        learn in scenes, and measure the benefit
`new_domain(name)`   write a skeleton of a new domain
`validate(file)`     list the faults of an ontology file, with remedies
`generate(…)`        a generated scene of any size
`within(seconds)`    a time limit for all calls in a block
`KnowledgeError`     the given input can't be used; the message states the fault, its position, and the remedy
===================  ==========================================================================================

>>> import confab
>>> scene = confab.load("beverage-serving")
>>> result = scene.plan("cup2 LOCATION location8")
>>> print(result.plan.steps[0], result.plan.length)
22 B1_MOVE cup1 location7 {1: 5, 2: 12, 3: 38}
"""

from __future__ import annotations

import sys as _sys

# instead of `from typing import TYPE_CHECKING`: Ctrl-C during that import would print a traceback
TYPE_CHECKING = False
if TYPE_CHECKING:
    from confab.authoring import generate, new_domain, validate
    from confab.curve import Curve, practise
    from confab.execution import Execution
    from confab.memory import Memory
    from confab.physics import Report
    from confab.planning import Result
    from confab.reasoner.graph.knowledge import KnowledgeError
    from confab.reasoner.limits import within
    from confab.scene import Scene, load, scenes
    from confab.table import Table

__version__ = "0.1.0"
__all__ = [
    "Curve",
    "Execution",
    "KnowledgeError",
    "Memory",
    "Report",
    "Result",
    "Scene",
    "Table",
    "generate",
    "load",
    "new_domain",
    "practise",
    "scenes",
    "validate",
    "within",
]

_HOMES = {
    "Curve": "confab.curve",
    "Execution": "confab.execution",
    "KnowledgeError": "confab.reasoner.graph.knowledge",
    "Memory": "confab.memory",
    "Report": "confab.physics",
    "Result": "confab.planning",
    "Scene": "confab.scene",
    "Table": "confab.table",
    "generate": "confab.authoring",
    "load": "confab.scene",
    "new_domain": "confab.authoring",
    "practise": "confab.curve",
    "scenes": "confab.scene",
    "validate": "confab.authoring",
    "within": "confab.reasoner.limits",
}


def __getattr__(name: str) -> object:
    """Import the module of a public name on first access, so that the command line starts fast."""
    if name not in _HOMES:
        if name.startswith("_"):
            raise AttributeError(f"module 'confab' has no attribute '{name}'")
        from dis import opmap

        from confab.reasoner.names import GUESSING, WrongNameError

        if "confab.guessing" not in GUESSING:
            GUESSING.append("confab.guessing")
        error = WrongNameError("the module confab", name, _sys.modules[__name__])
        caller = _sys._getframe(1)
        if caller.f_lasti >= 0 and caller.f_code.co_code[caller.f_lasti] == opmap["IMPORT_FROM"]:
            raise ImportError(str(error), name="confab")  # Python replaces the message of an AttributeError here
        raise error
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    """Return the public names, which a Python shell completes by the Tab key."""
    return [*__all__, "__doc__", "__version__"]


if "IPython" in _sys.modules:  # registers the HTML that notebooks show for values whose modules contain no HTML
    from confab.page.notebook import register as _register

    _register()
