"""The tabletop domain for GTPyhop, with handwritten methods on three levels, run by a Python interpreter with gtpyhop.

    python _gtpyhop_tabletop.py TABLE.json

The table has the keys ``at`` (object → place), ``drinks`` (vessel → beverage or null), ``reach`` (hand → places), ``goals`` (object
→ place) and ``pours`` (cup → beverage). The program prints the CPU seconds of planning and the number of primitives, or ``none``.
The methods solve tables with free places, but not full tables and swaps.
"""

import json
import sys
import time
from typing import Any

import gtpyhop  # type: ignore[import-not-found]

table = json.load(open(sys.argv[1]))  # noqa: PTH123, SIM115
sys.setrecursionlimit(10**6)
gtpyhop.Domain("tabletop")
gtpyhop.verbose = 0
REACH = {hand: set(places) for hand, places in table["reach"].items()}
SOURCE = {drink: vessel for vessel, drink in table["drinks"].items() if drink}
BOTH = sorted(set.intersection(*REACH.values()))


def reach_object(state: Any, hand: str, thing: str) -> Any:
    if state.raised[hand] and state.at[thing] in REACH[hand]:
        state.raised[hand], state.position[hand] = False, thing
        return state
    return None


def reach_location(state: Any, hand: str, place: str) -> Any:
    if state.raised[hand] and place in REACH[hand] and place not in state.who:
        state.raised[hand], state.position[hand] = False, place
        return state
    return None


def grasp(state: Any, hand: str) -> Any:
    if state.holds[hand] is None and state.position[hand] in state.at:
        state.holds[hand] = state.position[hand]
        return state
    return None


def lift(state: Any, hand: str) -> Any:
    if not state.raised[hand] and not state.tilted[hand]:
        state.raised[hand], state.position[hand] = True, None
        thing = state.holds[hand]
        if thing is not None and state.at[thing] != "in_hand":
            del state.who[state.at[thing]]
            state.at[thing] = "in_hand"
        return state
    return None


def put_down(state: Any, hand: str) -> Any:
    thing, place = state.holds[hand], state.position[hand]
    if thing is not None and place not in state.who:
        state.at[thing], state.who[place], state.holds[hand] = place, thing, None
        return state
    return None


def tilt(state: Any, hand: str) -> Any:
    cup, bottle = state.position[hand], state.holds[hand]
    if not state.tilted[hand] and state.drinks.get(cup, 0) is None and state.drinks.get(bottle):
        state.drinks[cup], state.tilted[hand] = state.drinks[bottle], True
        return state
    return None


def stand_upright(state: Any, hand: str) -> Any:
    if state.tilted[hand]:
        state.tilted[hand] = False
        return state
    return None


gtpyhop.declare_actions(reach_object, reach_location, grasp, lift, put_down, tilt, stand_upright)


def pick(state: Any, hand: str, thing: str) -> Any:
    return [("reach_object", hand, thing), ("grasp", hand), ("lift", hand)]


def place(state: Any, hand: str, where: str) -> Any:
    return [("reach_location", hand, where), ("put_down", hand), ("lift", hand)]


def pour_held(state: Any, hand: str, cup: str) -> Any:
    return [("reach_object", hand, cup), ("tilt", hand), ("stand_upright", hand), ("lift", hand)]


def one_hand(state: Any, thing: str, where: str) -> Any:
    for hand, places in REACH.items():
        if state.at[thing] in places and where in places:
            return hand
    return None


def between(state: Any) -> Any:
    return next((p for p in BOTH if p not in state.who and p not in WANTED), None)


def move(state: Any, thing: str, where: str) -> Any:
    if state.at[thing] == where:
        return []
    hand = one_hand(state, thing, where)
    if hand:
        return [("pick", hand, thing), ("place", hand, where)]
    middle = between(state)
    return [("move", thing, middle), ("move", thing, where)] if middle else False


def pour(state: Any, bottle: str, cup: str) -> Any:
    hand = one_hand(state, bottle, state.at[cup])
    home = state.at[bottle]
    if hand:
        return [("pick", hand, bottle), ("pour_held", hand, cup), ("place", hand, home)]
    middle = between(state)
    return [("move", bottle, middle), ("pour", bottle, cup), ("move", bottle, home)] if middle else False


def serve(state: Any, number: int) -> Any:
    if number == len(ORDERS):
        return []
    cup = ORDERS[number]
    tasks = [("move", cup, table["goals"][cup])] if cup in table["goals"] else []
    if cup in table["pours"]:
        tasks.append(("pour", SOURCE[table["pours"][cup]], cup))
    return [*tasks, ("serve", number + 1)]


for method in (pick, place, pour_held, move, pour, serve):
    gtpyhop.declare_task_methods(method.__name__, method)

ORDERS = sorted(table["pours"])
WANTED = set(table["goals"].values())
state = gtpyhop.State("table")
state.at = dict(table["at"])
state.who = {p: o for o, p in table["at"].items()}
state.drinks = dict(table["drinks"])
state.holds = dict.fromkeys(REACH)
state.position = dict.fromkeys(REACH)
state.raised = dict.fromkeys(REACH, True)
state.tilted = dict.fromkeys(REACH, False)
begin = time.process_time()
plan = gtpyhop.find_plan(state, [("serve", 0)])
print(time.process_time() - begin, len(plan) if plan else "none")
