"""A memory outlives its process: in any file layout, after crashes, with other robots at an endpoint; broken files are reported."""

import contextlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import rdflib

from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.memory.experience import (
    ITSELF,
    Experience,
    GoalKind,
    LearnedItem,
    LearnedOrder,
    LearnedRule,
    Lesson,
    Method,
    OpenRole,
    Tally,
)
from confab.reasoner.memory.experience_file import pull, push
from confab.reasoner.names import Names
from confab.reasoner.symbols import AnyOf, ClassCondition, EqualityCondition, RelationCondition, ValueCondition, Witness
from worlds.memories import load, save

NAMES = Names(f"https://x.org/k#{name}" for name in ("B1_MOVE", "B1_POUR", "Cup", "Bottle"))
DOMAIN = "https://x.org/k"


IN, NOBODY = ValueCondition("LOCATION", ("?cup",), "?place"), ValueCondition("LOCATION", ("?anyone",), "?place")
RULE = LearnedRule(
    IN,
    (
        AnyOf(((ClassCondition("?cup", "Bottle", True),), (EqualityCondition("?cup", "?place", True), IN)), True),
        ClassCondition("?cup", "Bottle", True),
        RelationCondition("canReach", ("?hand", "?place")),
        ValueCondition("BEVERAGE", ("?cup",), "true", True),
        Witness("?anyone", "Cup", (NOBODY,), True),
    ),
    ("B1_MOVE", ("?cup", "?place")),
    (("?cup", "Cup"), ("?place", "A|B"), ("?hand", "Hand")),
)
METHOD = Method(
    "B1_MOVE",
    2,
    (("B2_PICK", (2, 0)), ("B2_PLACE", (2, 1))),
    (OpenRole("Hand", None, "HOLDS"), OpenRole("A|B", ("LOCATION", (0,)), None)),
)
SAID: list[LearnedItem] = [RULE, LearnedOrder("LOCATION", "BEVERAGE", ((0, 0), (1, 1))), METHOD]


def lived(replica: str, episodes: int) -> Experience:
    experience = Experience(replica)
    for number in range(episodes):
        facts = [ITSELF, ("LOCATION of cup", "unmet"), ('odd "fact": \\', "a:b"), ("n", str(number % 3))]
        lesson = Lesson(SAID, [(RULE, fact, Tally(1, 0, number % 2)) for fact in facts])
        lesson.counted.append((GoalKind("LOCATION", ("Cup",)), ITSELF, Tally(1)))
        lesson.personal.append((RULE, ("who is hand", "left_hand"), Tally(passed_over=1)))
        experience.learn(lesson)
    return experience


def test_experience_survives_a_round_trip_in_any_layout_of_the_file(tmp_path: Path) -> None:
    experience = lived("robot", 4)
    save(tmp_path / "ours.ttl", experience, NAMES, DOMAIN)
    rdflib.Graph().parse(tmp_path / "ours.ttl").serialize(tmp_path / "theirs.ttl")
    assert load(tmp_path / "ours.ttl", NAMES) == experience
    assert load(tmp_path / "theirs.ttl", NAMES) == experience


def test_a_learned_rule_can_be_queried_by_its_conditions(tmp_path: Path) -> None:
    save(tmp_path / "now.ttl", lived("robot", 2), NAMES, DOMAIN)
    graph = rdflib.Graph().parse(tmp_path / "now.ttl")
    asked = """PREFIX : <https://w3id.org/confab/core#> SELECT ?class ?failed WHERE {
      ?rule a :LearnedRule ; :does <https://x.org/k#B1_MOVE> ; :asksFor ?condition .
      ?condition a :ClassCondition ; :negated true ; :ofClass ?class .
      ?counter :countsFor ?rule . [] owl:annotatedSource ?counter ; owl:annotatedTarget ?rule ; :failed ?failed }"""
    assert [tuple(map(str, row)) for row in graph.query(asked) if isinstance(row, tuple)] == [
        ("https://x.org/k#Bottle", "1")
    ]


def test_an_edited_rule_keeps_its_counts_a_disabled_rule_is_marked_and_a_deleted_rule_is_removed(
    tmp_path: Path,
) -> None:
    path, experience = tmp_path / "memory.ttl", lived("robot", 2)
    save(path, experience, NAMES, DOMAIN)
    text = path.read_text()
    path.write_text(text.replace(":asksFor", ":enabled false ; :asksFor").replace("k#Bottle", "k#Cup"))
    edited = load(path, NAMES)
    rule = next(one for one in edited.said.values() if isinstance(one, LearnedRule))
    assert (ClassCondition("?cup", "Cup", True) in rule.asks, edited.disabled) == (True, {rule.name})
    assert edited.totals()[rule.name] == experience.totals()[RULE.name]
    save(path, edited, NAMES, DOMAIN)
    assert load(path, NAMES) == edited
    path.write_text("".join(line for line in text.splitlines(True) if not line.startswith(f"m:{RULE.name}")))
    deleted = load(path, NAMES)
    assert RULE.name not in deleted.said
    assert RULE.name not in deleted.totals()


def test_the_union_of_two_files_is_a_file_of_both_memories(tmp_path: Path) -> None:
    one, two = lived("one", 3), lived("two", 2)
    save(tmp_path / "one.ttl", one, NAMES, DOMAIN)
    save(tmp_path / "two.ttl", two, NAMES, DOMAIN)
    (tmp_path / "both.ttl").write_text((tmp_path / "one.ttl").read_text() + (tmp_path / "two.ttl").read_text())
    one.merge(two)
    both = load(tmp_path / "both.ttl", NAMES)
    assert (both.counts, both.episodes, both.said) == (one.counts, one.episodes, one.said)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("<a> <b", "broken memory"),
        ("<a> <b> <c> .", ":memoryFormat is missing"),
        ("<a> <https://w3id.org/confab/core#memoryFormat> 99 .", "format 99, wanted 5"),
    ],
)
def test_a_broken_foreign_or_newer_file_is_a_clear_error(tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / "memory.ttl").write_text(content)
    with pytest.raises(KnowledgeError, match=message):
        load(tmp_path / "memory.ttl")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (r":chosen \d+ ", ":chosen -1 ", "wanted numbers from 0"),
        (r":chosen \d+ ", ":chosen 1" + 400 * "0" + " ", "wanted numbers from 0"),
        (r":learnsAs \S+", ":label 1", "the ID of its replica, is missing"),
    ],
)
def test_impossible_counts_and_a_memory_without_learner_are_clear_errors(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    path = tmp_path / "memory.ttl"
    save(path, lived("robot", 2), NAMES, DOMAIN)
    text, count = re.subn(old, new, path.read_text())
    assert count
    path.write_text(text)
    with pytest.raises(KnowledgeError, match=message):
        load(path, NAMES)


def test_a_byte_order_mark_is_ignored(tmp_path: Path) -> None:
    path = tmp_path / "memory.ttl"
    save(path, lived("robot", 2), NAMES, DOMAIN)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert len(load(path, NAMES)) == len(lived("robot", 2))


def test_a_truncated_memory_file_is_an_error_or_a_part_of_the_memory(tmp_path: Path) -> None:
    experience = lived("robot", 2)
    path = tmp_path / "memory.ttl"
    save(path, experience, NAMES, DOMAIN)
    text = path.read_text()
    for length in range(400, len(text) - 1, 37):
        path.write_text(text[:length])
        with contextlib.suppress(KnowledgeError):
            assert len(load(path, NAMES)) <= len(experience)


def test_no_acknowledged_episode_is_lost_when_the_process_is_killed(tmp_path: Path) -> None:
    path = tmp_path / "memory.ttl"
    acknowledged = 0
    for number in range(5):
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.reasoner.learner", str(path)],
            stdout=subprocess.PIPE,
            text=True,
            cwd=Path(__file__).parents[2],
        )
        assert process.stdout is not None
        first = process.stdout.readline()
        time.sleep(0.003 * number)
        process.send_signal(signal.SIGKILL)
        rest = process.stdout.read().splitlines()
        process.stdout.close()
        process.wait()
        acknowledged = max([acknowledged, int(first), *(int(line) for line in rest if line)])
        assert load(path, NAMES).episodes["robot"] >= acknowledged


@pytest.fixture
def endpoint() -> Iterator[str]:
    server = Path(sys.executable).with_name("oxigraph")
    if not server.is_file() and shutil.which("oxigraph") is None:
        pytest.skip("no oxigraph server")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = subprocess.Popen(
        [str(server), "serve", "--bind", f"127.0.0.1:{port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    for _ in range(200):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                break
        time.sleep(0.05)
    yield f"http://127.0.0.1:{port}/query"
    process.kill()
    process.wait()


def test_robots_that_write_to_one_endpoint_lose_nothing(endpoint: str) -> None:
    robots = [lived("one", 3), lived("two", 2)]
    for robot in robots:
        push(endpoint, robot, NAMES, DOMAIN)
    for robot in robots:
        robot.learn(Lesson())
        push(endpoint, robot, NAMES, DOMAIN)
    found = pull(endpoint, NAMES, replica="reader")
    expected = Experience("reader")
    for robot in robots:
        expected.merge(robot)
    assert found == expected


def test_a_missing_endpoint_is_a_clear_error() -> None:
    with pytest.raises(KnowledgeError, match="no memory there"):
        pull("http://127.0.0.1:9/query", timeout=2)
