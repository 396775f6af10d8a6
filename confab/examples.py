"""Examples in the help of each command. A user can run the examples of a command in their order, in an empty folder."""

from __future__ import annotations

EXAMPLES: dict[str, tuple[str, ...]] = {
    "plan": (
        "confab plan beverage-serving",
        "confab plan beverage-serving --goal 'cup2 LOCATION location8'",
        "confab plan house-small --json",
    ),
    "run": (
        "confab run",
        "confab run towers-small",
        "confab run beverage-serving --memory memory.ttl -o out --no-video",
    ),
    "report": (
        "confab report beverage-serving -o plan.html",
        "confab execute beverage-serving -o visit.json",
        "confab report beverage-serving --episode visit.json -o visit.html",
    ),
    "scenes": ("confab scenes", "confab scenes --json"),
    "runs": (
        "confab run towers-small -o runs --keep",
        "confab run towers-small -o runs --keep",
        "confab runs runs",
        "confab runs runs 001 002",
        "confab runs runs -o history.html",
    ),
    "verify": (
        "confab plan beverage-serving -o plan.json",
        "confab verify beverage-serving plan.json",
        "confab verify beverage-serving plan.json --rollouts 10 --perturb --video film.mp4",
    ),
    "execute": (
        "confab execute beverage-serving",
        "confab execute beverage-serving --intervene 'after=28 cup2 LOCATION location8'",
        "confab execute beverage-serving -o episode.ttl",
    ),
    "query": (
        "confab query beverage-serving 'SELECT ?o ?where WHERE { ?o k:location ?where } ORDER BY ?o'",
        "confab query beverage-serving 'ASK { :cup1 a k:Cup }'",
        "confab query beverage-serving 'SELECT * WHERE { :cup1 ?p ?o }' -o cup1.csv",
        "confab query beverage-serving --show B2_PICK",
        "confab query beverage-serving --show B2_PICK --update",
        "confab query beverage-serving --affords cup1",
        "confab query beverage-serving --facts",
        "confab query packing-small --derived",
    ),
    "serve": (
        "confab serve beverage-serving",
        "curl http://127.0.0.1:7879/sparql --data-urlencode 'query=SELECT ?o ?where WHERE { ?o k:location ?where }'",
        "confab execute beverage-serving --world pybullet --serve 7879",
        "confab execute scene.ttl --on pyrobosim:world.yaml",
    ),
    "mcp": ("confab mcp .",),
    "learn": (
        "confab learn beverage-serving --memory memory.ttl",
        "confab learn towers-small towers-large --memory towers.ttl",
    ),
    "new": ("confab new tearoom", "confab new workshop --bodies -o shop"),
    "fetch": ("confab fetch https://www.w3.org/ns/prov-o -o mine",),
    "picture": (
        "confab picture beverage-serving -o table.png",
        "confab picture beverage-serving --behavior B2_PICK -o pick.svg",
    ),
    "memory migrate": ("confab memory migrate memory.ttl Cup=Mug",),
    "validate": (
        "confab validate beverage-serving",
        "confab validate mine.ttl --strict",
        "confab validate mine.ttl --watch",
    ),
    "explain": (
        "confab explain beverage-serving",
        "confab explain beverage-serving 'L3#12'",
        "confab explain beverage-serving --not 'cup2 LOCATION location8'",
    ),
    "memory show": ("confab memory show memory.ttl",),
    "memory merge": ("confab memory merge one.ttl other.ttl -o both.ttl",),
    "memory trust": ("confab memory trust memory.ttl all",),
    "generate": (
        "confab generate swap --objects 6 -o swap.ttl",
        "confab generate full --objects 8 --hands 3 --seed 7 -o full.ttl",
    ),
    "import": ("confab import domain.pddl problem.pddl -o scene.ttl", "confab import world.yaml -o scene.ttl"),
    "convert": (
        "confab convert mine.ttl --behaviors sparql",
        "confab convert mine.ttl --behaviors individuals -o mine.ttl",
    ),
    "export": (
        "confab export towers-small -o towers",
        "confab export beverage-serving --trajectory -o serving.yaml",
        "confab export rooms-waste --bt -o trees",
    ),
}


def examples(command: str) -> str:
    """Return the examples of a command as text for the end of its help."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in EXAMPLES[command])
