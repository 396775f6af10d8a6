import re
from pathlib import Path

import numpy as np
import pytest

import ontology
from confab import load
from sim.assembly import read_robot
from sim.kinematics import Arm, hand_frames, inverse, link_transforms, read_arm, swivel_of, three_angles, turn
from sim.urdf import Array, read_urdf

URDF = str(ontology.ROOT / "robots" / "two-arms.urdf")
JOINTS = ("shoulder_pitch", "shoulder_yaw", "shoulder_roll", "elbow", "wrist_yaw", "wrist_pitch", "wrist_roll")
X, Y, Z = np.eye(3)


def arm_of(side: str) -> Arm:
    return read_arm(read_urdf(URDF), [f"{side}_{joint}" for joint in JOINTS], f"{side}_tool")


def postures(arm: Arm, count: int) -> Array:
    """Postures within the limits, middle joints of the spheres within a right angle."""
    most = np.array([9.0, 1.5, 9.0, 9.0, 9.0, 1.5, 9.0])
    return np.random.default_rng(0).uniform(np.maximum(arm.lower, -most), np.minimum(arm.upper, most), (count, 7))


@pytest.mark.parametrize("side", ["left", "right"])
def test_inverse_finds_the_posture_that_forward_came_from(side: str) -> None:
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


def test_points_at_which_an_arm_is_nearly_stretched_can_be_kept_off() -> None:
    for arm in (panda(), arm_of("left")):
        q = np.random.default_rng(0).uniform(arm.lower + 0.05, arm.upper - 0.05, (2000, 7))
        given = (*hand_frames(arm, q), swivel_of(arm, q))
        _, anywhere = inverse(arm, *given)
        _, farther = inverse(arm, *given, fold=0.3)
        assert farther.sum() < anywhere.sum()
        r, p, swivel = (part[farther] for part in given)
        for shift in np.vstack([np.eye(3), -np.eye(3)]) * 0.003:  # a little beside, such a point can still be reached
            assert (
                inverse(arm, r, p + shift, swivel)[1].mean()
                > inverse(arm, given[0], given[1] + shift, swivel_of(arm, q))[1][anywhere].mean()
            )


def test_the_last_joint_alone_rolls_such_a_hand_while_the_swivel_stays() -> None:
    arm = panda()
    roll = np.linspace(0.0, 1.2, 20)
    where = np.broadcast_to([0.3, 0.0, 0.95], (20, 3))
    q, valid = inverse(arm, turn(X, roll), where, np.full(20, 1.4))
    assert valid.all()
    moves = np.ptp(q, axis=0)
    assert moves[6] == pytest.approx(1.2)
    assert moves[:6].max() < 1e-6


def test_the_elbow_swivel_leaves_the_hand_where_it_is() -> None:
    arm = arm_of("left")
    swivel = np.linspace(-0.5, 1.0, 20)
    where = np.broadcast_to([0.45, 0.2, 0.85], (20, 3))
    q, valid = inverse(arm, np.broadcast_to(np.eye(3), (20, 3, 3)), where, swivel)
    assert valid.sum() > 5
    np.testing.assert_allclose(hand_frames(arm, q[valid])[1], where[valid], atol=1e-12)
    np.testing.assert_allclose(swivel_of(arm, q[valid]), swivel[valid], atol=1e-9)
    assert np.ptp(q[valid][:, 0]) > 0.1


def test_what_is_out_of_the_arm_s_length_is_not_valid() -> None:
    arm = arm_of("left")
    _, valid = inverse(arm, np.eye(3)[None], np.array([[1.2, 0.2, 0.9]]), np.zeros(1))
    assert not valid.any()


@pytest.mark.parametrize("axes", [(Y, Z, X), (X, Y, Z), (Z, Y, X), (X, Y, X), (Z, Y, Z), (Z, Y, -X)])
def test_three_angles_rebuild_any_rotation(axes: tuple[Array, Array, Array]) -> None:
    draw = np.random.default_rng(1)
    r = turn(X, draw.uniform(-3, 3, 100)) @ turn(Y, draw.uniform(-3, 3, 100)) @ turn(Z, draw.uniform(-3, 3, 100))
    x, y, z = three_angles(r, np.array(axes)).T
    np.testing.assert_allclose(turn(axes[0], x) @ turn(axes[1], y) @ turn(axes[2], z), r, atol=1e-9)


def test_an_arm_whose_axes_do_not_meet_is_refused(tmp_path: Path) -> None:
    text = Path(URDF).read_text(encoding="utf-8")
    bent = tmp_path / "bent.urdf"
    bent.write_text(text.replace('<origin xyz=".30 0 0"', '<origin xyz=".30 0 .05"', 1), encoding="utf-8")
    read_arm(read_urdf(str(bent)), [f"left_{joint}" for joint in JOINTS], "left_tool")  # the elbow still bends it so
    bent.write_text(
        text.replace(
            '<child link="left_wrist_pitch_link"/>\n    <origin xyz="0 0 0"',
            '<child link="left_wrist_pitch_link"/>\n    <origin xyz=".03 0 0"',
        )
    )
    with pytest.raises(ValueError, match="no wrist"):
        read_arm(read_urdf(str(bent)), [f"left_{joint}" for joint in JOINTS], "left_tool")


def test_a_file_that_is_no_urdf_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"missing\.urdf"):
        read_urdf(str(tmp_path / "missing.urdf"))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('xyz="0 0 1"', 'xyz="0 0 0"', "an axis without direction"),
        ('xyz="0 0 1"', 'xyz="0 1"', "'0 1' where three numbers belong"),
        ('lower="', 'lower="nan" was="', "'lower' is nan"),
        ('radius="', 'radius="1e-9" was="', "give a thicker one"),
        ('<link name="left_tool"', '<link name="left_tol"', "no link 'left_tool', which the arm"),
        ('<joint name="left_elbow"', '<joint name="left_elbo"', "no joint 'left_elbow', which the arm"),
        ("</robot>", '<joint name="o"><parent link="base"/><child link="base"/></joint></robot>', "hangs on itself"),
    ],
)
def test_a_robot_that_cannot_be_is_refused_in_words(tmp_path: Path, old: str, new: str, said: str) -> None:
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
