"""The paper's scene and its plan, for tests of execution."""

from functools import cache

from confab.planner.hierarchical.planner import plan
from confab.planner.plan import Plan
from confab.reasoner.graph.knowledge import load
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read


@cache
def serving() -> Problem:
    return read(load("beverage-serving")).problem


@cache
def planned() -> Plan:
    found = plan(serving()).plan
    assert found is not None
    return found
