from dataclasses import replace

import numpy as np
import pytest

from confab.reasoner.embodiment.values import Embodiment, Fixture
from confab.sim.arms import read_arm
from confab.sim.attempt import Attempt, rounding
from confab.sim.bodies import outline
from confab.sim.collision import Obstacles, Solid, box, free, read_mover
from confab.sim.motion import MotionLimits, Reacher, connect, leave, line, polyline, pose_of, smooth, timed
from confab.sim.stages import MARGIN, Stage
from confab.sim.urdf import Array, Spheres, read_urdf
from confab.sim.verdict import SkillError
from confab.sim.world import PhysicsWorld

from .conftest import Case, case

START = np.array([0.40, 0.40, 0.90, 0.0, 0.0, 0.6])
GOAL = np.array([0.50, 0.05, 0.90, -0.3, 0.0, 0.6])


def reacher(embodiment: Embodiment, *solids: Solid) -> Reacher:
    robot, hand = embodiment.hand("left_hand")
    model = read_urdf(robot.urdf)
    arm = read_arm(model, hand.arm, hand.tip, hand.turned, hand.home)
    mover = read_mover(model, arm, dict.fromkeys(hand.fingers, hand.opening))
    return Reacher(mover, Obstacles((*map(box, embodiment.fixtures), *solids)), MARGIN)


def pillar() -> Solid:
    return Solid("pillar", "cylinder", np.array([0.03, 0.03, 0.2]), np.array([0.45, 0.22, 0.9]), np.eye(3))


def test_a_collision_free_straight_line_is_the_path(serving: Case) -> None:
    found = connect(reacher(serving.embodiment), START, [GOAL], np.random.default_rng(0))
    assert found is not None
    np.testing.assert_array_equal(found[1], [START, GOAL])


def test_a_path_leads_around_obstacles(serving: Case) -> None:
    blocked = reacher(serving.embodiment, pillar())
    assert blocked.follow(line(START, GOAL)) is None
    assert blocked.blame(line(START, GOAL)).objects == ("pillar",)
    found = connect(blocked, START, [GOAL], np.random.default_rng(0))
    assert found is not None
    q = blocked.follow(polyline(found[1]))
    assert q is not None
    gap = blocked.mover.clearances(q, blocked.around).get("pillar", np.array([1.0]))
    assert gap.min() > MARGIN


def test_the_same_seed_gives_the_same_path(serving: Case) -> None:
    blocked = reacher(serving.embodiment, pillar())
    first, second = (connect(blocked, START, [GOAL], np.random.default_rng(3)) for _ in range(2))
    assert first is not None
    assert second is not None
    np.testing.assert_array_equal(first[1], second[1])


def test_the_pose_of_a_posture_is_the_pose_for_which_it_was_solved(serving: Case) -> None:
    free = reacher(serving.embodiment)
    q, valid = free.solve(START[None])
    assert valid.all()
    np.testing.assert_allclose(pose_of(free.arm, q[0]), START, atol=1e-9)


@pytest.mark.parametrize("rate", [60.0, 240.0])
def test_timing_keeps_the_limits_and_ends_at_rest(serving: Case, rate: float) -> None:
    free = reacher(serving.embodiment)
    q = free.follow(line(START, GOAL))
    assert q is not None
    limits = MotionLimits(free.arm.velocity, 8.0, 1.0, 4.0)
    positions, velocities = timed(free.arm, smooth(q), limits, rate)
    np.testing.assert_allclose(positions[-1], q[-1])
    assert np.all(velocities[-1] == 0)
    assert np.all(np.abs(velocities) <= limits.velocity * 1.02)
    assert np.abs(np.diff(velocities, axis=0)).max() * rate < 3 * limits.acceleration


def test_a_move_too_short_for_a_third_sample_is_timed_like_a_longer_one(serving: Case) -> None:
    free = reacher(serving.embodiment)
    for step in (0.001, 0.014):
        q = free.follow(line(START, START + np.array([step, 0, 0, 0, 0, 0])))
        assert q is not None
        assert len(q) == 2
        positions, _ = timed(free.arm, q, MotionLimits(free.arm.velocity, 8.0, 1.0, 4.0), 240.0)
        np.testing.assert_allclose(positions[-1], q[-1])
        assert len(positions) < 60


def test_a_hand_too_near_to_an_obstacle_moves_away_and_never_nearer(serving: Case) -> None:
    panel = Solid("panel", "box", np.array([0.01, 0.1, 0.1]), START[:3] + np.array([0.02, 0.0, 0.0]), np.eye(3))
    beside = reacher(serving.embodiment, panel)
    assert beside.follow(START[None]) is None
    away = leave(beside, START)
    assert away is not None
    gaps = beside.mover.clearances(beside.solve(line(START, away))[0], beside.around)["panel"]
    assert (np.diff(gaps) >= -0.001).all()
    assert gaps[-1] > beside.margin


def test_the_begun_part_of_a_blocked_line_is_its_longest_free_part(serving: Case) -> None:
    one = reacher(serving.embodiment)
    down = line(START, START - np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0]))
    assert one.follow(down) is None
    begun = one.begin(down)
    assert begun is not None
    assert one.follow(down[: len(begun)]) is not None
    assert one.follow(down[: len(begun) + 1]) is None


def test_a_path_search_with_several_goals_returns_the_reached_goal(serving: Case) -> None:
    blocked = reacher(serving.embodiment, pillar())
    far = GOAL + np.array([0.0, 0.0, 5.0, 0.0, 0.0, 0.0])  # no hand reaches this pose
    found = connect(blocked, START, [far, GOAL], np.random.default_rng(3))
    assert found is not None
    assert found[0] == 1
    np.testing.assert_array_equal(found[1][-1], GOAL)


def test_free_postures_are_those_with_distances_above_the_margin(serving: Case) -> None:
    here = reacher(serving.embodiment, pillar())
    ball = Spheres(np.array([[0.3, 0.1, 0.9], [0.5, -0.2, 0.8]]), np.array([0.05, 0.08]))
    around = here.around.plus("ball", ball)
    q = np.random.default_rng(1).uniform(here.arm.lower, here.arm.upper, (400, 7))
    for margin in (0.0, 0.008, -0.003):
        gaps = np.min(list(here.mover.clearances(q, around).values()), axis=0)
        found = free(here.mover.at(q), here.mover.spheres.radii, around, margin)
        np.testing.assert_array_equal(found, gaps > margin)
        assert 0 < found.sum() < len(q)


def test_a_goal_in_collision_is_never_reached(serving: Case) -> None:
    """A search that grew from this goal would end there, although the last step leads into the pillar."""
    blocked = reacher(serving.embodiment, pillar())
    beside = np.repeat(GOAL[None], 60, axis=0)
    beside[:, :2] = np.linspace((0.45, 0.0), (0.45, 0.22), 60)
    first = int(np.argmin(blocked.free(blocked.solve(beside)[0])))  # the previous pose is free
    assert first
    assert connect(blocked, START, [beside[first]], np.random.default_rng(0), attempts=300) is None


def test_a_goal_beyond_the_limit_of_a_joint_is_never_reached(serving: Case) -> None:
    """A search that grew from this goal would end there, and the hand could plan no further motion from that pose."""
    blocked = reacher(serving.embodiment, pillar())
    bent = START.copy()
    bent[:3] = (0.25, 0.22, 0.85)  # so near to the shoulder that the elbow would fold beyond its limit
    assert not blocked.solve(bent[None])[1].any()
    assert connect(blocked, START, [bent], np.random.default_rng(0), attempts=300) is None


def test_the_spheres_of_a_carried_object_cover_its_lower_edge() -> None:
    one = case("beverage-serving")
    with PhysicsWorld(one.embodiment, one.initial, beads=False) as world:
        hand = world.hands["left_hand"]
        turned, tip = hand.frame()
        for name in ("cup1", "bottle1"):
            spheres = world.load_spheres(hand, name, whole=True)
            _, radii = outline(world.bodies[name].shape)
            around = np.linspace(0.0, 2 * np.pi, 100)
            edge = world.truth(name)[1] + np.stack(
                [radii[0] * np.cos(around), radii[0] * np.sin(around), 0 * around], -1
            )
            gaps = np.linalg.norm(edge[:, None] - (spheres.centers @ turned.T + tip), axis=-1) - spheres.radii
            assert gaps.min(1).max() < MARGIN


def put_beside(attempt: Attempt, q: Array, gap: float) -> None:
    """Put a post `gap` metres to the left of all postures `q` of an arm."""
    mover = attempt.hand.mover()
    centers, radii = mover.at(q).reshape(-1, 3), np.tile(mover.spheres.radii, len(q))
    left = int(np.argmax(centers[:, 1] + radii))
    x, y, z = centers[left] + np.array([0.0, radii[left] + gap + 0.01, 0.0])
    world = attempt.world
    post = Fixture("post", (0.02, 0.02, 0.02), (float(x), float(y), float(z)))
    world.embodiment = replace(world.embodiment, fixtures=(*world.embodiment.fixtures, post))


@pytest.mark.parametrize(("gap", "enough"), [(0.01, True), (0.004, True), (0.001, False)])
def test_a_hand_accepts_a_smaller_clearance_if_no_alternative_exists(moved: Case, gap: float, enough: bool) -> None:
    with PhysicsWorld(moved.embodiment, moved.initial, beads=False) as world:
        attempt = Attempt.begin(world, "left_hand")
        pose = attempt.hand.pose
        put_beside(attempt, attempt.reacher().solve(pose[None])[0], gap)
        if enough:
            assert attempt.choose([Stage(pose[None])], ()) == [0]
        else:
            with pytest.raises(SkillError, match="1 mm from post, wanted 3 mm"):
                attempt.choose([Stage(pose[None])], ())


def test_corners_of_a_path_are_rounded_only_as_far_as_obstacles_permit(serving: Case) -> None:
    """Some posts beside a path are far enough from the path, but would be too near to the rounded path."""
    corner, aside, down = np.array([0.45, 0.2, 0.95, 0.0, 0.0, 0.6]), np.eye(6)[1], np.eye(6)[2]
    alone = replace(reacher(serving.embodiment), around=Obstacles())
    q = alone.solve(polyline(np.array([corner - 0.15 * aside, corner, corner - 0.15 * down])))[0]
    assert rounding(alone, q) == 3
    near = []
    for middle in corner[:3] + np.random.default_rng(0).uniform([-0.1, -0.15, -0.15], [0.2, 0.0, 0.0], (1200, 3)):
        post = Solid("post", "box", np.full(3, 0.005), middle, np.eye(3))
        among = replace(alone, around=Obstacles((post,)))
        near += [among] if among.free(q).all() and not among.free(smooth(q, 3)).all() else []
    assert near
    assert all(rounding(among, q) < 3 for among in near)
