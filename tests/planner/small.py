"""Small problems; each has one feature that planners of several levels must handle correctly (docs/levels.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    EqualityCondition,
    RelationCondition,
    SituationType,
    Symbol,
    Witness,
)
from worlds.writing import becomes, behavior, has, lacks, world


@dataclass(frozen=True)
class Case:
    """A problem, the number of steps per level of its plan, and facts besides the goal that hold or don't hold afterwards."""

    problem: Problem
    length: Mapping[int, int]
    afterwards: Mapping[Symbol, str]
    never: Mapping[Symbol, str] = field(default_factory=dict)


def drive() -> Case:
    """One truck and one place: driving from the place to the same place makes one fact both false and true."""
    there = SituationType("THERE", ("Truck", "Place"), "Truth", boolean=True)
    seen = SituationType("SEEN", ("Place",), "Truth", boolean=True)
    go = behavior(
        "DRIVE", 1, "?t:Truck ?a:Place ?b:Place",
        [has("THERE", "?t", "?a", TRUE)],
        [becomes("THERE", "?t", "?b", TRUE), becomes("THERE", "?t", "?a", FALSE), becomes("SEEN", "?b", TRUE)],
    )  # fmt: skip
    problem = world(
        [there, seen], [go], {"Truck": ("truck",), "Place": ("yard",)},
        {"THERE truck yard": TRUE}, {"SEEN yard": TRUE, "THERE truck yard": TRUE},
    )  # fmt: skip
    return Case(problem, {1: 1}, {})


def van() -> Case:
    """A van that level 1 doesn't see and that has no rest value: it stays at the place to which it was driven last."""
    here, no_other = has("VAN_AT", "van", "?a"), EqualityCondition("?a", "?b", True)
    shut, open_ = has("DOOR", "van", "shut"), has("DOOR", "van", "open")
    standing = has("ENGINE", "van", "off")
    empty = Witness("?o", "Parcel", (has("AT", "?o", "aboard"),), negated=True)
    unsigned, asked = has("SIGNED", "?p", FALSE), has("CALLED", "?p", TRUE)
    problem = world(
        [
            SituationType("AT", ("Parcel",), "AT"),
            SituationType("SIGNED", ("Parcel",), "Truth", boolean=True),
            SituationType("VAN_AT", ("Van",), "Town", level=2),
            SituationType("CALLED", ("Parcel",), "Truth", level=2, boolean=True),
            SituationType("DOOR", ("Van",), "DOOR", level=3, rest="shut"),
            SituationType("ENGINE", ("Van",), "ENGINE", level=3, rest="off"),
            SituationType("BRAKE", ("Van",), "BRAKE", level=3, rest="set"),
        ],
        [
            behavior("SEND", 1, "?p:Parcel ?b:Town", [has("AT", "?p", "?a"), no_other], [becomes("AT", "?p", "?b")], "?a:Town"),
            behavior("SIGN", 1, "?p:Parcel", [unsigned], [becomes("SIGNED", "?p", TRUE)]),
            behavior("GO", 2, "?b:Town", [here, no_other], [becomes("VAN_AT", "van", "?b")], "?a:Town"),
            behavior("LOAD", 2, "?p:Parcel", [here, has("AT", "?p", "?a"), empty], [becomes("AT", "?p", "aboard")], "?a:Town"),
            behavior("UNLOAD", 2, "?p:Parcel", [here, has("AT", "?p", "aboard")], [becomes("AT", "?p", "?a")], "?a:Town"),
            behavior("RING", 2, "?p:Parcel", [has("CALLED", "?p", FALSE)], [becomes("CALLED", "?p", TRUE)]),
            behavior("ASK", 2, "?p:Parcel", [asked, unsigned], [becomes("SIGNED", "?p", TRUE)]),
            behavior("START", 3, "", [standing, shut], [becomes("ENGINE", "van", "on")]),
            behavior("RELEASE", 3, "", [has("ENGINE", "van", "on")], [becomes("BRAKE", "van", "free")]),
            behavior("ROLL", 3, "?b:Town", [here, no_other, has("BRAKE", "van", "free")],
                     [becomes("VAN_AT", "van", "?b")], "?a:Town"),
            behavior("PARK", 3, "", [], [becomes("ENGINE", "van", "off"), becomes("BRAKE", "van", "set")]),
            behavior("OPEN", 3, "", [shut, standing], [becomes("DOOR", "van", "open")]),
            behavior("CLOSE", 3, "", [open_], [becomes("DOOR", "van", "shut")]),
            behavior("LIFT", 3, "?p:Parcel", [open_, here, has("AT", "?p", "?a")], [becomes("AT", "?p", "lifted")], "?a:Town"),
            behavior("STOW", 3, "?p:Parcel", [open_, has("AT", "?p", "lifted"), empty], [becomes("AT", "?p", "aboard")]),
            behavior("DRAW", 3, "?p:Parcel", [open_, has("AT", "?p", "aboard")], [becomes("AT", "?p", "drawn")]),
            behavior("SET", 3, "?p:Parcel", [here, has("AT", "?p", "drawn")], [becomes("AT", "?p", "?a")], "?a:Town"),
            behavior("BELL", 3, "?p:Parcel", [has("CALLED", "?p", FALSE)], [becomes("CALLED", "?p", TRUE)]),
            behavior("PEN", 3, "?p:Parcel", [asked, unsigned], [becomes("SIGNED", "?p", TRUE)]),
        ],
        {
            "Parcel": ("parcel1", "parcel2"), "Van": ("van",), "Town": ("depot", "north", "south"),
            "AT": ("depot", "north", "south", "aboard", "lifted", "drawn"),
            "DOOR": ("open", "shut"), "ENGINE": ("on", "off"), "BRAKE": ("set", "free"),
        },
        {
            "AT parcel1": "north", "AT parcel2": "south", "VAN_AT van": "depot", "DOOR van": "shut", "ENGINE van": "off",
            "BRAKE van": "set",
        },
        {"AT parcel1": "south", "AT parcel2": "north", "SIGNED parcel1": TRUE},
        value_levels={"aboard": 2, "lifted": 3, "drawn": 3},
    )  # fmt: skip
    return Case(problem, {1: 3, 2: 9, 3: 30}, {}, {Symbol("VAN_AT", ("van",)): "depot"})


def fire_door() -> Case:
    """A book behind a door that must be shut again; the robot stays at the place of the book."""
    shut, open_, there = has("DOOR", "door", "shut"), has("DOOR", "door", "open"), has("ROBOT_AT", "robot", "doorway")
    free = has("HOLDS", "robot", "nothing")
    at_handle = has("ARM", "robot", "handle")
    problem = world(
        [
            SituationType("AT", ("Book",), "AT"),
            SituationType("ROBOT_AT", ("Robot",), "Spot", level=2),
            SituationType("DOOR", ("Door",), "DOOR", level=2, rest="shut"),
            SituationType("HOLDS", ("Robot",), "HOLDS", level=2, rest="nothing"),
            SituationType("ARM", ("Robot",), "ARM", level=3, rest="tucked"),
        ],
        [
            behavior("FETCH", 1, "?b:Book ?p:Place", [lacks("AT", "?b", "?p")], [becomes("AT", "?b", "?p")]),
            behavior("GO", 2, "?s:Spot", [lacks("ROBOT_AT", "robot", "?s")], [becomes("ROBOT_AT", "robot", "?s")]),
            behavior("OPEN", 2, "", [shut, there, free], [becomes("DOOR", "door", "open")]),
            behavior("SHUT", 2, "", [open_, there], [becomes("DOOR", "door", "shut")]),
            behavior("TAKE", 2, "?b:Book", [open_, there, free, has("AT", "?b", "vault")],
                     [becomes("AT", "?b", "in_hand"), becomes("HOLDS", "robot", "?b")]),
            behavior("PUT", 2, "", [has("HOLDS", "robot", "?b"), has("ROBOT_AT", "robot", "desk")],
                     [becomes("AT", "?b", "desk"), becomes("HOLDS", "robot", "nothing")], "?b:Book"),
            behavior("ROLL", 3, "?s:Spot", [lacks("ROBOT_AT", "robot", "?s"), has("ARM", "robot", "tucked")],
                     [becomes("ROBOT_AT", "robot", "?s")]),
            behavior("REACH", 3, "?x:Thing", [has("ARM", "robot", "tucked")], [becomes("ARM", "robot", "?x")]),
            behavior("TUCK", 3, "", [lacks("ARM", "robot", "tucked")], [becomes("ARM", "robot", "tucked")]),
            behavior("PULL", 3, "", [shut, there, at_handle, free], [becomes("DOOR", "door", "open")]),
            behavior("PUSH", 3, "", [open_, there, at_handle], [becomes("DOOR", "door", "shut")]),
            behavior("GRASP", 3, "?b:Book", [open_, there, free, has("AT", "?b", "vault"), has("ARM", "robot", "?b")],
                     [becomes("AT", "?b", "in_hand"), becomes("HOLDS", "robot", "?b")]),
            behavior("RELEASE", 3, "", [has("HOLDS", "robot", "?b"), has("ROBOT_AT", "robot", "desk"), has("ARM", "robot", "desk")],
                     [becomes("AT", "?b", "desk"), becomes("HOLDS", "robot", "nothing")], "?b:Book"),
        ],
        {
            "Book": ("book",), "Place": ("desk", "vault"), "AT": ("desk", "vault", "in_hand"), "Robot": ("robot",),
            "Spot": ("desk", "doorway"), "Door": ("door",), "DOOR": ("open", "shut"), "HOLDS": ("book", "nothing"),
            "Thing": ("book", "desk", "handle"), "ARM": ("book", "desk", "handle", "tucked"),
        },
        {
            "AT book": "vault", "ROBOT_AT robot": "doorway", "DOOR door": "shut", "HOLDS robot": "nothing", "ARM robot": "tucked",
        },
        {"AT book": "desk"},
        value_levels={"in_hand": 2},
    )  # fmt: skip
    return Case(
        problem, {1: 1, 2: 5, 3: 13}, {Symbol("DOOR", ("door",)): "shut", Symbol("ROBOT_AT", ("robot",)): "desk"}
    )


def drawers() -> Case:
    """Two items to fetch, one behind two lids, the other behind three: each step has a refinement alone, and so have both."""
    covered = Witness("?c", "Box", (RelationCondition("behind", ("?x", "?c")), has("LID", "?c", "shut")), negated=True)
    free, tucked = has("HOLDS", "robot", "nothing"), has("ARM", "robot", "tucked")
    held, gone = becomes("HOLDS", "robot", "?x"), becomes("AT", "?x", "in_hand")
    there, away = has("ARM", "robot", "?x"), becomes("ARM", "robot", "tucked")
    lids = ("outer1", "inner1", "outer2", "inner2", "core2")
    problem = world(
        [
            SituationType("AT", ("Item",), "AT"),
            SituationType("LID", ("Box",), "LID", level=2, rest="shut"),
            SituationType("HOLDS", ("Robot",), "HOLDS", level=2, rest="nothing"),
            SituationType("ARM", ("Robot",), "ARM", level=3, rest="tucked"),
        ],
        [
            behavior("GET", 1, "?x:Item", [has("AT", "?x", "inside")], [becomes("AT", "?x", "tray")]),
            behavior("OPEN", 2, "?x:Box", [has("LID", "?x", "shut"), covered, free], [becomes("LID", "?x", "open")]),
            behavior("SHUT", 2, "?x:Box", [has("LID", "?x", "open"), covered, free], [becomes("LID", "?x", "shut")]),
            behavior("TAKE", 2, "?x:Item", [has("AT", "?x", "inside"), covered, free], [held, gone]),
            behavior("PUT", 2, "", [has("HOLDS", "robot", "?x")],
                     [becomes("AT", "?x", "tray"), becomes("HOLDS", "robot", "nothing")], "?x:Item"),
            behavior("REACH", 3, "?x:Thing", [tucked], [becomes("ARM", "robot", "?x")]),
            behavior("TUCK", 3, "", [lacks("ARM", "robot", "tucked")], [away]),
            behavior("PULL", 3, "?x:Box", [there, has("LID", "?x", "shut"), covered, free], [becomes("LID", "?x", "open")]),
            behavior("PUSH", 3, "?x:Box", [there, has("LID", "?x", "open"), covered, free], [becomes("LID", "?x", "shut")]),
            behavior("GRASP", 3, "?x:Item", [there, has("AT", "?x", "inside"), covered, free], [held, gone, away]),
            behavior("RELEASE", 3, "", [has("ARM", "robot", "tray"), has("HOLDS", "robot", "?x")],
                     [becomes("AT", "?x", "tray"), becomes("HOLDS", "robot", "nothing"), away], "?x:Item"),
        ],
        {
            "Item": ("spoon", "ring"), "Box": lids, "AT": ("inside", "tray", "in_hand"), "LID": ("open", "shut"),
            "Robot": ("robot",), "HOLDS": ("spoon", "ring", "nothing"), "Thing": ("spoon", "ring", "tray", *lids),
            "ARM": ("spoon", "ring", "tray", *lids, "tucked"),
        },
        {"AT spoon": "inside", "AT ring": "inside", "HOLDS robot": "nothing", "ARM robot": "tucked"}
        | {f"LID {lid}": "shut" for lid in lids},
        {"AT spoon": "tray", "AT ring": "tray"},
        {
            "behind": [("spoon", "outer1"), ("spoon", "inner1"), ("inner1", "outer1"), ("ring", "outer2"), ("ring", "inner2"),
                       ("ring", "core2"), ("inner2", "outer2"), ("core2", "outer2"), ("core2", "inner2")]
        },
        {"in_hand": 2},
    )  # fmt: skip
    return Case(problem, {1: 2, 2: 14, 3: 38}, {Symbol("LID", (lid,)): "shut" for lid in lids})


def tool() -> Case:
    """A screwdriver without rest value: it is fetched once, and stays in the hand between two parts."""
    in_hand, ready = has("TOOL", "hand", "driver"), has("AT", "?p", "placed")
    problem = world(
        [SituationType("AT", ("Part",), "AT"), SituationType("TOOL", ("Hand",), "TOOL", level=2)],
        [
            behavior("MOUNT", 1, "?p:Part", [has("AT", "?p", "bin")], [becomes("AT", "?p", "mounted")]),
            behavior("FETCH", 2, "", [lacks("TOOL", "hand", "driver")], [becomes("TOOL", "hand", "driver")]),
            behavior("DROP", 2, "", [in_hand], [becomes("TOOL", "hand", "nothing")]),
            behavior("PLACE", 2, "?p:Part", [has("AT", "?p", "bin")], [becomes("AT", "?p", "placed")]),
            behavior("FASTEN", 2, "?p:Part", [ready, in_hand], [becomes("AT", "?p", "mounted")]),
        ],
        {"Part": ("leg1", "leg2"), "AT": ("bin", "mounted", "placed"), "Hand": ("hand",), "TOOL": ("driver", "nothing")},
        {"AT leg1": "bin", "AT leg2": "bin", "TOOL hand": "nothing"},
        {"AT leg1": "mounted", "AT leg2": "mounted"},
        value_levels={"placed": 2},
    )  # fmt: skip
    return Case(problem, {1: 2, 2: 5}, {Symbol("TOOL", ("hand",)): "driver"})


def rotor() -> Case:
    """A tube that is put under a lid."""
    free, tucked, open_ = has("GRIP", "arm", "empty"), has("ARM", "arm", "tucked"), has("LID", "spinner", "open")
    reachable = AnyOf(((EqualityCondition("?s", "rack"),), (open_,)))
    problem = world(
        [
            SituationType("SPOT", ("Tube",), "SPOT"),
            SituationType("LID", ("Machine",), "LID", level=2, rest="closed"),
            SituationType("GRIP", ("Hand",), "GRIP", level=2, rest="empty"),
            SituationType("ARM", ("Hand",), "ARM", level=3, rest="tucked"),
        ],
        [
            behavior("MOVE", 1, "?t:Tube ?s:Slot", [lacks("SPOT", "?t", "?s")], [becomes("SPOT", "?t", "?s")]),
            behavior("OPEN", 2, "", [has("LID", "spinner", "closed")], [becomes("LID", "spinner", "open")]),
            behavior("CLOSE", 2, "", [open_], [becomes("LID", "spinner", "closed")]),
            behavior("TAKE", 2, "?t:Tube", [free, has("SPOT", "?t", "?s"), reachable],
                     [becomes("GRIP", "arm", "?t"), becomes("SPOT", "?t", "gripped")], "?s:Slot"),
            behavior("INSERT", 2, "?s:Slot", [has("GRIP", "arm", "?t"), reachable],
                     [becomes("SPOT", "?t", "?s"), becomes("GRIP", "arm", "empty")], "?t:Tube"),
            behavior("LIFT_LID", 3, "", [has("LID", "spinner", "closed")], [becomes("LID", "spinner", "open")]),
            behavior("LOWER_LID", 3, "", [open_], [becomes("LID", "spinner", "closed")]),
            behavior("APPROACH", 3, "?s:Slot", [tucked, reachable], [becomes("ARM", "arm", "?s")]),
            behavior("RETRACT", 3, "", [lacks("ARM", "arm", "tucked")], [becomes("ARM", "arm", "tucked")]),
            behavior("CLOSE_JAWS", 3, "?t:Tube", [free, has("SPOT", "?t", "?s"), has("ARM", "arm", "?s")],
                     [becomes("GRIP", "arm", "?t"), becomes("SPOT", "?t", "gripped")], "?s:Slot"),
            behavior("OPEN_JAWS", 3, "", [has("GRIP", "arm", "?t"), has("ARM", "arm", "?s")],
                     [becomes("SPOT", "?t", "?s"), becomes("GRIP", "arm", "empty")], "?t:Tube ?s:Slot"),
        ],
        {
            "Tube": ("tube",), "Slot": ("rack", "hole"), "SPOT": ("rack", "hole", "gripped"), "Machine": ("spinner",),
            "LID": ("open", "closed"), "Hand": ("arm",), "GRIP": ("tube", "empty"), "ARM": ("rack", "hole", "tucked"),
        },
        {"SPOT tube": "rack", "LID spinner": "closed", "GRIP arm": "empty", "ARM arm": "tucked"},
        {"SPOT tube": "hole"},
        value_levels={"gripped": 2},
    )  # fmt: skip
    return Case(problem, {1: 1, 2: 4, 3: 8}, {Symbol("LID", ("spinner",)): "closed"})


def there_and_back() -> Case:
    """A robot that is at home in the end because it drops the fetched ball there, and not because it was sent back."""
    free, home = has("HOLDS", "robot", "nothing"), has("ROBOT_AT", "robot", "home")
    problem = world(
        [
            SituationType("AT", ("Ball",), "AT"),
            SituationType("ROBOT_AT", ("Robot",), "Spot", level=2, rest="home"),
            SituationType("HOLDS", ("Robot",), "HOLDS", level=2, rest="nothing"),
        ],
        [
            behavior("FETCH", 1, "?b:Ball", [has("AT", "?b", "meadow")], [becomes("AT", "?b", "home")]),
            behavior("GO", 2, "?s:Spot", [lacks("ROBOT_AT", "robot", "?s")], [becomes("ROBOT_AT", "robot", "?s")]),
            behavior("PICK", 2, "?b:Ball", [free, has("AT", "?b", "?s"), has("ROBOT_AT", "robot", "?s")],
                     [becomes("HOLDS", "robot", "?b"), becomes("AT", "?b", "carried")], "?s:Spot"),
            behavior("DROP", 2, "", [has("HOLDS", "robot", "?b"), home],
                     [becomes("HOLDS", "robot", "nothing"), becomes("AT", "?b", "home")], "?b:Ball"),
        ],
        {
            "Ball": ("ball",), "AT": ("home", "meadow", "carried"), "Robot": ("robot",), "Spot": ("home", "meadow"),
            "HOLDS": ("ball", "nothing"),
        },
        {"AT ball": "meadow", "ROBOT_AT robot": "home", "HOLDS robot": "nothing"},
        {"AT ball": "home"},
        value_levels={"carried": 2},
    )  # fmt: skip
    return Case(problem, {1: 1, 2: 4}, {Symbol("ROBOT_AT", ("robot",)): "home"})


CASES = (drive, van, fire_door, drawers, tool, rotor, there_and_back)
