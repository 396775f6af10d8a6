"""Export of behaviour trees to BehaviorTree.CPP 4 (with node models for Groot2) and to py_trees, and execution of py_trees."""

from __future__ import annotations

import keyword
import re
import runpy
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from confab.planner.acting.world import World
from confab.planner.behavior_tree import Element, Leaf, Situation, mark, sequence
from confab.planner.behavior_tree import behavior_tree as tree_of
from confab.planner.plan import Plan, Step
from confab.reasoner.files import check_replaceable, made_folder, write_whole
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.kinds import TREE, stamped
from confab.reasoner.limits import check
from confab.reasoner.problem import Problem
from confab.reasoner.sentences import said
from confab.reasoner.symbols import Condition, Fact
from confab.timing import needs_others_meanwhile

RETRIES = 5
"""An exported tree fails after this number of failures; after each earlier failure, it starts again."""

RESERVED = """
ID name kind key leaf Action Condition Control Decorator BehaviorTree SubTree SubTreePlus TestNode
Sequence SequenceStar SequenceWithMemory AsyncSequence ReactiveSequence Fallback AsyncFallback ReactiveFallback
Parallel ParallelAll IfThenElse WhileDoElse TryCatch ManualSelector Switch2 Switch3 Switch4 Switch5 Switch6
Inverter ForceSuccess ForceFailure Repeat RetryUntilSuccessful RetryUntilSuccesful KeepRunningUntilFailure
Delay RunOnce Timeout Precondition ConsumeQueue LoopInt LoopBool LoopDouble LoopString
SkipUnlessUpdated WaitValueUpdate WasEntryUpdated
AlwaysSuccess AlwaysFailure Script ScriptCondition SetBlackboard UnsetBlackboard Sleep
"""
"""Reserved names of BehaviorTree.CPP and py_trees, which leaves, ports and subtrees can't have."""
MAIN = "attempts"
"""The name of the whole tree, which makes attempts."""
TREES = {MAIN, "position", "plan", "undone_steps"}
"""Names of subtrees; BehaviorTree.CPP refuses leaves with the same names."""


@dataclass(frozen=True)
class Tree:
    """The behaviour tree of a plan.

    An attempt ticks the subtree `first` once, and then the subtree `then` until it succeeds or fails. `subtrees` has all subtrees
    by name. `leaves` has the condition or the primitive of each leaf, by the leaf's key.
    """

    first: str
    then: str
    subtrees: Mapping[str, Element]
    leaves: Mapping[str, Leaf]


def behavior_tree(problem: Problem, plan: Plan) -> Tree:
    """Return the behaviour tree of a valid plan, with nodes that both BehaviorTree.CPP and py_trees support."""
    if needs_others_meanwhile(problem):
        raise KnowledgeError("steps of this plan must overlap; a behaviour tree executes one step after another")
    lowering = _LeafWriter(problem)
    first, then = (lowering.lowered(tree).name for tree in tree_of(problem, plan))
    return Tree(first, then, lowering.subtrees, lowering.leaves)


def export_trees(problem: Problem, plan: Plan, folder: Path) -> tuple[Path, Path]:
    """Write the behaviour tree of a plan into a folder as ``tree.xml`` and ``tree.py``, and return both paths."""
    tree = behavior_tree(problem, plan)
    made_folder(folder)
    paths = folder / "tree.xml", folder / "tree.py"
    for path in paths:
        check_replaceable(path, TREE)
    write_whole(paths[0], stamped(TREE, [to_btcpp(tree)], "<!-- #"))
    write_whole(paths[1], stamped(TREE, [to_py_trees(tree)]))
    return paths


class _LeafWriter:
    """Separates the subtrees of a plan's behaviour tree, and gives names, ports and keys to its leaves.

    The nodes Fallback and Sequence begin with their first child in each tick. A Once node is a sequence that resumes at its running
    child. After an Again node, the tree is ticked again.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.subtrees: dict[str, Element] = {}
        self.leaves: dict[str, Leaf] = {}
        behaviors, situations = problem.domain.behaviors, problem.domain.situations
        wanted = [(("Action", one), _identifier(one)) for one in behaviors]
        wanted += [(("possible", one), f"{_identifier(one)}_possible") for one in behaviors]
        wanted += [(("Condition", ""), "Holds"), *((("Condition", one), _identifier(one)) for one in situations)]
        self.names: dict[tuple[str, str], str] = {}
        self.taken = {*TREES}
        for key, name in wanted:
            self.names[key] = _free(name, self.taken)
            self.taken.add(self.names[key])

    def lowered(self, node: Element) -> Element:
        """Return a node with complete leaves; a primitive becomes a condition, an action, its mark, and a request for a tick."""
        check("exporting the behaviour tree")
        if node.kind == "SubTree":
            own = _free(_identifier(node.name), self.taken - TREES)  # names can't have spaces in the libraries
            self.subtrees[own] = Element("")  # the entry keeps the subtree before its nested subtrees
            self.subtrees[own] = self.lowered(node.children[0])
            return Element("SubTree", own)
        leaf = node.leaf
        if isinstance(leaf, Step):
            ports = self.ports(leaf)
            possible = self.leaf("Condition", self.names["possible", leaf.behavior], ports, leaf)
            action = self.leaf("Action", self.names["Action", leaf.behavior], ports, leaf)
            return sequence(Element("Once", children=(possible, action)), mark(leaf.path, 1), Element("Again"))
        if leaf is not None:
            return self.leaf("Condition", *self.words(leaf), leaf)
        return replace(node, children=tuple(map(self.lowered, node.children)))

    def leaf(self, kind: str, name: str, ports: Mapping[str, str], what: Leaf) -> Element:
        """Return a new leaf with a unique key."""
        key = f"{kind[0].lower()}{len(self.leaves)}"
        self.leaves[key] = what
        return Element(kind, name, ports=ports, key=key)

    def ports(self, step: Step) -> dict[str, str]:
        """Return the arguments of a primitive by the names of ports."""
        found: dict[str, str] = {}
        for parameter, argument in zip(
            self.problem.domain.behaviors[step.behavior].parameters, step.arguments, strict=True
        ):
            found[_free(_identifier(parameter.name.rpartition(".")[2]), found)] = argument
        return found

    def words(self, one: Fact | Condition) -> tuple[str, dict[str, str]]:
        """Return the name and the ports of a condition. A condition other than a fact has one port with its text."""
        if not isinstance(one, Fact):
            return self.names["Condition", ""], {"condition": said(one)}
        arguments = {f"argument{number}": each for number, each in enumerate(one.symbol.arguments, 1)}
        return self.names["Condition", one.symbol.situation], {**arguments, "value": one.value}


def _identifier(name: str) -> str:
    """Return an identifier that begins with a letter and isn't a reserved name of BehaviorTree.CPP or py_trees."""
    found = re.sub(r"\W+", "_", name).strip("_")
    found = f"n{found}" if found[:1].isdigit() else found
    return f"{found}_" if found in RESERVED.split() or keyword.iskeyword(found) else found


def _free(name: str, taken: Collection[str]) -> str:
    """Return a name that isn't taken."""
    while name in taken:
        name += "_"
    return name


# ------------------------------------------------------------------------------------------------------------- BehaviorTree.CPP

TAGS = {"Fallback": "ReactiveFallback", "Sequence": "ReactiveSequence", "Once": "Sequence", "Parallel": "Parallel"}


def attempt(tree: Tree) -> Element:
    """Return the node of one attempt."""
    return Element("Once", children=(Element("SubTree", tree.first), Element("SubTree", tree.then)))


def to_btcpp(tree: Tree) -> str:
    """Return a tree as XML for BehaviorTree.CPP 4, with models of its nodes."""
    root = ElementTree.Element("root", {"BTCPP_format": "4", "main_tree_to_execute": MAIN})
    main = ElementTree.SubElement(root, "BehaviorTree", {"ID": MAIN})
    retry = ElementTree.SubElement(main, "RetryUntilSuccessful", {"num_attempts": str(RETRIES)})
    retry.append(_xml(attempt(tree)))
    for name, element in tree.subtrees.items():
        ElementTree.SubElement(root, "BehaviorTree", {"ID": name}).append(_xml(element))
    model = ElementTree.SubElement(root, "TreeNodesModel")
    for (kind, name), ports in sorted(_models(tree).items()):
        node = ElementTree.SubElement(model, kind, {"ID": name})
        for port in ports:
            ElementTree.SubElement(node, "input_port", {"name": port, "type": "std::string"})
    ElementTree.indent(root, " ")
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _xml(element: Element) -> ElementTree.Element:
    match element.kind:
        case "SubTree":
            return ElementTree.Element("SubTree", {"ID": element.name, "_autoremap": "true"})
        case "Check":
            return ElementTree.Element(
                "ScriptCondition", {"code": f"{element.name} {element.ports['comparison']} {element.ports['number']}"}
            )
        case "Set":
            return ElementTree.Element("Script", {"code": f"{element.name} := {element.ports['number']}"})
        case "Again":
            return ElementTree.Element("Sleep", {"msec": "1", "name": "tick again"})
        case "Condition" | "Action":
            return ElementTree.Element(element.name, {"name": element.key, **element.ports})
        case _ if not element.children:
            return ElementTree.Element("AlwaysSuccess")  # a control node needs a child
        case kind:
            attributes = {"success_count": "-1", "failure_count": "1"} if kind == "Parallel" else {}
            found = ElementTree.Element(TAGS[kind], attributes)
            found.extend(map(_xml, element.children))
            return found


def _models(tree: Tree) -> dict[tuple[str, str], list[str]]:
    """Return the ports of all leaves, by kind and name."""
    found: dict[tuple[str, str], list[str]] = {}
    for element in tree.subtrees.values():
        for leaf in _leaves(element):
            found.setdefault((leaf.kind, leaf.name), list(leaf.ports))
    return found


def _leaves(element: Element) -> Iterator[Element]:
    if element.key:
        yield element
    for child in element.children:
        yield from _leaves(child)


# ------------------------------------------------------------------------------------------------------------- py_trees

HEAD = '''"""A behaviour tree for py_trees: tree(leaf) returns its root.

leaf(kind, name, key, **ports) returns a py_trees behaviour: of kind "Condition", which succeeds or fails at once,
or "Action", which runs until a primitive has ended. These are the leaves:

{leaves}
"""

from operator import ge, lt

from py_trees.behaviours import CheckBlackboardVariableValue, Running, SetBlackboardVariable
from py_trees.common import ComparisonExpression, ParallelPolicy
from py_trees.composites import Parallel, Selector, Sequence
from py_trees.decorators import Retry


def check(name, number, comparison):
    return CheckBlackboardVariableValue(name, ComparisonExpression(name, number, comparison))


def assign(name, number):
    return SetBlackboardVariable(name, name, number, overwrite=True)


def parallel(*children):
    return Parallel("Parallel", ParallelPolicy.SuccessOnAll(synchronise=False), list(children))


'''


def to_py_trees(tree: Tree) -> str:
    """Return a tree as a Python module for py_trees."""
    names = {name: f"subtree{number}" for number, name in enumerate(tree.subtrees)}
    leaves = [f"{kind} {name}({', '.join(ports)})" for (kind, name), ports in sorted(_models(tree).items())]
    text = HEAD.format(leaves="\n".join(leaves))
    for name, element in tree.subtrees.items():
        text += f"def {names[name]}(leaf):  # {name}\n    return {_python(element, names, 1)}\n\n\n"
    return text + f'def tree(leaf):\n    return Retry("retry", {_python(attempt(tree), names, 1)}, {RETRIES})\n'


def _python(element: Element, names: Mapping[str, str], depth: int) -> str:
    """Return a node of a behaviour tree as a Python expression."""
    pad = "\n" + "    " * (depth + 1)
    below = "".join(f"{pad}{_python(child, names, depth + 1)}," for child in element.children)
    end = "\n" + "    " * depth
    match element.kind:
        case "SubTree":
            return f"{names[element.name]}(leaf)"
        case "Check":
            comparison = {">=": "ge", "<": "lt"}[element.ports["comparison"]]
            return f"check({element.name!r}, {element.ports['number']}, {comparison})"
        case "Set":
            return f"assign({element.name!r}, {element.ports['number']})"
        case "Again":
            return 'Running("tick again")'
        case "Condition" | "Action":
            ports = "".join(f", {port}={value!r}" for port, value in element.ports.items())
            return f"leaf({element.kind!r}, {element.name!r}, {element.key!r}{ports})"
        case "Parallel":
            return f"parallel({below}{end})"
        case "Fallback":
            return f'Selector("Fallback", memory=False, children=[{below}{end}])'
        case kind:
            return f'Sequence("Sequence", memory={kind == "Once"}, children=[{below}{end}])'


def filled(
    tree: Tree, path: Path, problem: Problem, world: World, observer: Callable[[Step], None] | None = None
) -> Any:
    """Return the root of an exported ``tree.py``. The leaves of the tree observe a world and execute primitives in this world.

    Parameters
    ----------
    tree : Tree
        The exported tree.
    path : Path
        The path of the file ``tree.py``.
    problem : Problem
    world : World
    observer : callable, optional
        A function that is called with each primitive before the primitive is executed.
    """
    from py_trees.behaviour import Behaviour
    from py_trees.common import Status

    class Leaf(Behaviour):  # type: ignore[misc, unused-ignore] # py_trees is untyped where it isn't installed
        def __init__(self, kind: str, name: str, key: str) -> None:
            super().__init__(f"{name} {key}")
            self.kind, self.key = kind, key

        def update(self) -> Status:
            if self.kind == "Condition":
                seen = Situation(problem, {**unseen, **world.observe()})
                return Status.SUCCESS if seen.asks(tree.leaves[self.key]) else Status.FAILURE
            step = tree.leaves[self.key]
            assert isinstance(step, Step)
            if observer is not None:
                observer(step)
            return Status.SUCCESS if world.execute(step).ok else Status.FAILURE

    seen_first = world.observe()
    unseen = {
        symbol: value
        for symbol, value in problem.initial.items()
        if symbol not in seen_first and not problem.domain.situations[symbol.situation].boolean
    }
    made = runpy.run_path(str(path))["tree"]
    return made(lambda kind, name, key, **ports: Leaf(kind, name, key))


def ticked(root: Any, most: int = 10_000) -> bool:
    """Tick the root of a tree until the tree succeeds or fails, at most `most` times; return whether the tree has succeeded."""
    from py_trees.common import Status

    for _ in range(most):
        check("ticking the behaviour tree")
        root.tick_once()
        if root.status != Status.RUNNING:
            return bool(root.status == Status.SUCCESS)
    return False
