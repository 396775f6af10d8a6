"""The map of the page: areas, places, and the places of objects in time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from confab.page.ground import MapGround
from confab.page.lanes import tone_of
from confab.page.schema import MapData, MapObject
from confab.page.timeline import Timeline
from confab.reasoner.symbols import Fact

if TYPE_CHECKING:
    from confab.labels import Labels


def map_of(ground: MapGround, timeline: Timeline, labels: Labels) -> MapData:
    """Return the map from its background and the places of objects in time."""
    return {
        "areas": [
            {"id": area.name, "label": labels.name(area.name), "corners": list(area.corners)} for area in ground.areas
        ],
        "ways": list(ground.ways),
        "places": [{"id": name, "label": labels.name(name), "at": at} for name, at in ground.spots.items()],
        "robots": [{"id": name, "label": labels.name(name), "at": at} for name, at in ground.robots],
        "things": _things(ground, timeline, labels),
        "metric": ground.metric,
        "note": ground.note,
    }


def _things(ground: MapGround, timeline: Timeline, labels: Labels) -> list[MapObject]:
    """Return the objects on the map, each with its places in time.

    The place of an object is the value of a symbol of the object. The first value of this symbol is a place on the map, and the
    symbol's situation type has no rest value. (Positions of hands have a rest value.) If an object has several symbols of this
    kind, the map uses the symbol whose values are on the map for the longest time.
    """
    situations = timeline.problem.domain.situations
    found: dict[str, tuple[float, MapObject]] = {}
    for symbol, periods in sorted(timeline.phases.items()):
        if len(symbol.arguments) != 1 or not periods or periods[0].value not in ground.spots:
            continue
        if situations[symbol.situation].rest is not None:
            continue
        (name,) = symbol.arguments
        long = sum(period.end - period.begin for period in periods if period.value in ground.spots)
        if name not in found or long > found[name][0]:
            at = [
                (
                    round(period.begin, 3),
                    period.value if period.value in ground.spots else "",
                    labels.fact(Fact(symbol, period.value)),
                    tone_of(timeline, symbol, period.value),
                )
                for period in periods
            ]
            found[name] = long, {"id": name, "label": labels.name(name), "at": at}
    return [thing for _, (_, thing) in sorted(found.items())]
