import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from confab import load, ontology
from confab.sim.arms import Arm, hand_frames, link_transforms, read_arm, turn
from confab.sim.assembly import read_robot
from confab.sim.kinematics import inverse, swivel_of, three_angles
from confab.sim.urdf import Array, read_urdf

URDF = str(ontology.ROOT / "robots" / "two-arms.urdf")
JOINTS = ("shoulder_pitch", "shoulder_yaw", "shoulder_roll", "elbow", "wrist_yaw", "wrist_pitch", "wrist_roll")
HOME = (-0.3, 0.3, 0.3, -1.2, 0.3, 0.3, 0.0)
X, Y, Z = np.eye(3)


def arm_of(side: str) -> Arm:
    return read_arm(read_urdf(URDF), [f"{side}_{joint}" for joint in JOINTS], f"{side}_tool")


def postures(arm: Arm, count: int) -> Array:
    """Return postures within the limits; the middle joints of spherical joints are within ±90°."""
    most = np.array([9.0, 1.5, 9.0, 9.0, 9.0, 1.5, 9.0])
    return np.random.default_rng(0).uniform(np.maximum(arm.lower, -most), np.minimum(arm.upper, most), (count, 7))


@pytest.mark.parametrize("side", ["left", "right"])
def test_inverse_kinematics_inverts_forward_kinematics(side: str) -> None:
    arm = arm_of(side)
    q = postures(arm, 500)
    found, valid = inverse(arm, *hand_frames(arm, q), swivel_of(arm, q))
    assert valid.all()
    np.testing.assert_allclose(found, q, atol=1e-9)


def panda() -> Arm:
    (robot,) = load("panda-serving").embodiment.robots
    (hand,) = robot.hands
    return read_arm(read_urdf(robot.urdf, robot.position, robot.yaw), hand.arm, hand.tip, hand.turned)


def test_an_arm_whose_last_axis_passes_the_wrist_has_a_closed_form_too() -> None:
    arm = panda()
    q = np.random.default_rng(0).uniform(arm.lower + 0.05, arm.upper - 0.05, (2000, 7))
    r, p = hand_frames(arm, q)
    swivel = swivel_of(arm, q)
    found, valid = inverse(arm, r, p, swivel)
    assert valid.mean() > 0.95
    again, there = hand_frames(arm, found[valid])
    np.testing.assert_allclose(again, r[valid], atol=1e-8)
    np.testing.assert_allclose(there, p[valid], atol=1e-8)
    np.testing.assert_allclose(np.cos(swivel_of(arm, found[valid]) - swivel[valid]), 1.0, atol=1e-8)


def test_poses_with_a_nearly_stretched_arm_can_be_avoided() -> None:
    for arm in (panda(), arm_of("left")):
        q = np.random.default_rng(0).uniform(arm.lower + 0.05, arm.upper - 0.05, (2000, 7))
        given = (*hand_frames(arm, q), swivel_of(arm, q))
        _, anywhere = inverse(arm, *given)
        _, farther = inverse(arm, *given, fold=0.3)
        assert farther.sum() < anywhere.sum()
        r, p, swivel = (part[farther] for part in given)
        # a point a little beside such a point is still reachable
        for shift in np.vstack([np.eye(3), -np.eye(3)]) * 0.003:
            assert (
                inverse(arm, r, p + shift, swivel)[1].mean()
                > inverse(arm, given[0], given[1] + shift, swivel_of(arm, q))[1][anywhere].mean()
            )


def test_the_last_joint_alone_rolls_the_hand_if_the_swivel_is_constant() -> None:
    arm = panda()
    roll = np.linspace(0.0, 1.2, 20)
    where = np.broadcast_to([0.3, 0.0, 0.95], (20, 3))
    q, valid = inverse(arm, turn(X, roll), where, np.full(20, 1.4))
    assert valid.all()
    moves = np.ptp(q, axis=0)
    assert moves[6] == pytest.approx(1.2)
    assert moves[:6].max() < 1e-6


def test_the_elbow_swivel_does_not_move_the_hand() -> None:
    arm = arm_of("left")
    swivel = np.linspace(-0.5, 1.0, 20)
    where = np.broadcast_to([0.45, 0.2, 0.85], (20, 3))
    q, valid = inverse(arm, np.broadcast_to(np.eye(3), (20, 3, 3)), where, swivel)
    assert valid.sum() > 5
    np.testing.assert_allclose(hand_frames(arm, q[valid])[1], where[valid], atol=1e-12)
    np.testing.assert_allclose(swivel_of(arm, q[valid]), swivel[valid], atol=1e-9)
    assert np.ptp(q[valid][:, 0]) > 0.1


def test_a_pose_beyond_the_length_of_the_arm_is_not_valid() -> None:
    arm = arm_of("left")
    _, valid = inverse(arm, np.eye(3)[None], np.array([[1.2, 0.2, 0.9]]), np.zeros(1))
    assert not valid.any()


@pytest.mark.parametrize("axes", [(Y, Z, X), (X, Y, Z), (Z, Y, X), (X, Y, X), (Z, Y, Z), (Z, Y, -X)])
def test_three_angles_represent_any_rotation(axes: tuple[Array, Array, Array]) -> None:
    draw = np.random.default_rng(1)
    r = turn(X, draw.uniform(-3, 3, 100)) @ turn(Y, draw.uniform(-3, 3, 100)) @ turn(Z, draw.uniform(-3, 3, 100))
    x, y, z = three_angles(r, np.array(axes)).T
    np.testing.assert_allclose(turn(axes[0], x) @ turn(axes[1], y) @ turn(axes[2], z), r, atol=1e-9)


def bent(folder: Path) -> Arm:
    """Return an arm of seven joints in which one axis of the wrist misses the others by 3 cm."""
    file, joint = folder / "bent.urdf", '<child link="left_wrist_pitch_link"/>\n    <origin xyz="'
    text = Path(URDF).read_text(encoding="utf-8")
    assert joint in text
    file.write_text(text.replace(f"{joint}0 0 0", f"{joint}.03 0 0"))
    return read_arm(read_urdf(str(file)), [f"left_{joint}" for joint in JOINTS], "left_tool", home=HOME)


def xarm(folder: Path) -> Arm:
    """Return PyBullet's xArm of six joints, with a gripper."""
    (robot,) = load("xarm-serving").embodiment.robots
    (hand,) = robot.hands
    return read_arm(read_robot(robot), hand.arm, hand.tip, hand.turned, hand.home)


@pytest.mark.parametrize("made", [bent, xarm])
def test_arms_whose_axes_do_not_meet_are_solved_numerically(made: Callable[[Path], Arm], tmp_path: Path) -> None:
    arm = made(tmp_path)
    assert not arm.closed
    q = arm.home + np.random.default_rng(0).uniform(-0.6, 0.6, (200, len(arm.joints)))
    q = np.clip(q, arm.lower + 0.05, arm.upper - 0.05)
    r, p = hand_frames(arm, q)
    swivel = swivel_of(arm, q)
    found, valid = inverse(arm, r, p, swivel, 0.03)
    assert valid.mean() > 0.97
    again, there = hand_frames(arm, found[valid])
    np.testing.assert_allclose(again, r[valid], atol=1e-6)
    np.testing.assert_allclose(there, p[valid], atol=1e-6)
    np.testing.assert_allclose(swivel_of(arm, found[valid]), swivel[valid], atol=1e-9)
    assert ((found[valid] >= arm.lower + 0.03) & (found[valid] <= arm.upper - 0.03)).all()
    assert not inverse(arm, r, p + np.array([2.0, 0.0, 0.0]), swivel)[1].any()
    anywhere = np.random.default_rng(0).uniform(arm.lower / 2, arm.upper / 2, (200, len(arm.joints)))
    given = (*hand_frames(arm, anywhere), swivel_of(arm, anywhere))
    assert inverse(arm, *given, fold=0.3)[1].sum() < inverse(arm, *given)[1].sum()  # some postures are nearly stretched


def test_numeric_postures_of_neighbouring_poses_are_neighbours_and_always_the_same(tmp_path: Path) -> None:
    arm = xarm(tmp_path)
    level, zero = np.broadcast_to(np.eye(3), (60, 3, 3)), np.zeros(60)
    draw = np.random.default_rng(1)
    for _ in range(5):
        begin, end = draw.uniform([0.25, -0.3, 0.8], [0.5, 0.3, 1.1], (2, 3))
        points = np.linspace(begin, end, 60)
        q, valid = inverse(arm, level, points, zero)
        assert valid.all()
        assert np.abs(np.diff(q, axis=0)).max() < 0.1
        np.testing.assert_array_equal(q[30:31], inverse(arm, level[:1], points[30:31], zero[:1])[0])
    assert not inverse(arm, level, points, zero + 0.2)[1].any()  # six joints have no swivel


def test_an_arm_of_too_few_joints_is_refused() -> None:
    with pytest.raises(ValueError, match="has 5 joints; an arm needs 6 or 7"):
        read_arm(read_urdf(URDF), [f"left_{joint}" for joint in JOINTS[:5]], "left_tool")


def test_a_file_that_is_no_urdf_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"missing\.urdf"):
        read_urdf(str(tmp_path / "missing.urdf"))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('xyz="0 0 1"', 'xyz="0 0 0"', "an axis without direction"),
        ('xyz="0 0 1"', 'xyz="0 1"', "'0 1' where three numbers of at most 1,000,000 belong"),
        ('xyz="0 0 1"', 'xyz="1e300 0 1"', "'1e300 0 1' where three numbers"),
        ('lower="', 'lower="99" was="', "wanted the lower limit first"),
        ('type="revolute"', 'type="prismatic"', "is prismatic; wanted a revolute or continuous joint"),
        ('lower="', 'lower="nan" was="', "'lower' is nan"),
        ('radius="', 'radius="1e-9" was="', "give a thicker one"),
        ('<link name="left_tool"', '<link name="left_tol"', "no link 'left_tool', which the arm"),
        ('<joint name="left_elbow"', '<joint name="left_elbo"', "no joint 'left_elbow', which the arm"),
        ("</robot>", '<joint name="o"><parent link="base"/><child link="base"/></joint></robot>', "hangs on itself"),
    ],
)
def test_an_invalid_robot_description_is_refused_with_a_message(tmp_path: Path, old: str, new: str, said: str) -> None:
    text = Path(URDF).read_text()
    assert old in text
    file = tmp_path / "broken.urdf"
    file.write_text(text.replace(old, new))
    with pytest.raises(ValueError, match=re.escape(said)):
        read_arm(read_urdf(str(file)), [f"left_{joint}" for joint in JOINTS], "left_tool")


def test_an_arm_that_rises_from_its_base_has_its_elbow_above_and_its_wrist_far_from_its_limits() -> None:
    (robot,) = load("iiwa-serving").embodiment.robots
    (hand,) = robot.hands
    arm = read_arm(read_robot(robot), hand.arm, hand.tip, hand.turned)
    zero = np.zeros(1)
    level = np.eye(3)[None]
    q, valid = inverse(arm, level, np.array([[0.46, 0.0, 0.81]]), zero)
    assert valid.all()
    assert np.allclose(hand_frames(arm, q)[1], [[0.46, 0.0, 0.81]])
    r, t = link_transforms(arm, q)
    assert (r[0, 2] @ arm.elbow + t[0, 2])[2] > arm.shoulder[2]
    assert np.abs(q[0, 4:]).max() < 1.2
