"""Assembly of a robot from its URDF, grippers on its flanges and the joints of a mobile base.

The result is a URDF again, so that physics and kinematics read the same text.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from confab.reasoner.embodiment.values import Hand, Robot
from confab.sim.urdf import Array, UrdfModel, mesh_file, read_model, read_urdf

DRIVE = (("drive_x", "prismatic", "1 0 0"), ("drive_y", "prismatic", "0 1 0"), ("drive_yaw", "continuous", "0 0 1"))
"""Joints below the base of a mobile robot, along x, along y and about z: name, URDF type and axis."""

FARTHEST = 100.0
"""Limits in metres of a mobile base's joints along x and y."""


def read_robot(robot: Robot, base: Array | None = None) -> UrdfModel:
    """Return a robot's model at the zero posture; its base is at `base` (x, y, yaw), by default at the robot's own position.

    Raises
    ------
    ValueError
        A file isn't a URDF robot, or the URDF lacks the flange of a gripper. The message names the file and the reason.
    """
    x, y, z = robot.position
    place, yaw = (x, y, z), robot.yaw
    if base is not None:
        place, yaw = (float(base[0]), float(base[1]), z), float(base[2])
    if plain(robot):
        return read_urdf(robot.urdf, place, yaw)
    return read_model(assembled(robot), robot.urdf, place, yaw)


def plain(robot: Robot) -> bool:
    """Return whether a robot has neither mounted grippers nor a mobile base."""
    return not robot.driving and not any(hand.gripper for hand in robot.hands)


def assembled(robot: Robot) -> str:
    """Return a robot, its grippers and the joints of its mobile base as one URDF text, with absolute paths of meshes."""
    root = _parsed(robot.urdf)
    for hand in robot.hands:
        if hand.gripper:
            _mount(root, hand)
    if robot.driving:
        _drive(root, robot)
    ET.indent(root)  # PyBullet's parser requires short lines
    return ET.tostring(root, encoding="unicode")


def _parsed(path: str) -> ET.Element:
    try:
        root = ET.fromstring(Path(path).read_text(encoding="utf-8"))
        for mesh in root.iter("mesh"):
            mesh.set("filename", str(mesh_file(mesh.get("filename", ""), Path(path).parent)))
    except (OSError, ET.ParseError, ValueError) as problem:
        raise ValueError(f"cannot read the URDF {path}: {problem}") from problem
    return root


def _base(root: ET.Element) -> str:
    """Return the root link, which is the child of no joint."""
    hanging = {child.get("link") for child in root.iter("child")}
    return next(name for link in root.findall("link") if (name := link.get("name", "")) not in hanging)


def _mount(root: ET.Element, hand: Hand) -> None:
    """Add a hand's gripper to the robot; the name of the hand is the prefix of the gripper's names."""
    if all(link.get("name") != hand.flange for link in root.findall("link")):
        raise ValueError(f"the robot's URDF has no link '{hand.flange}', the flange of '{hand.name}'; correct the name")
    gripper = _parsed(hand.gripper)
    base = _base(gripper)
    for element in (*gripper.findall("link"), *gripper.findall("joint"), *gripper.iter("material")):
        if element.get("name"):
            element.set("name", f"{hand.name}.{element.get('name')}")
    for end in (*gripper.iter("parent"), *gripper.iter("child")):
        end.set("link", f"{hand.name}.{end.get('link')}")
    root.extend(list(gripper))
    x, y, z, roll, pitch, yaw = hand.mounting
    joint = ET.SubElement(root, "joint", name=f"{hand.name}.mounting", type="fixed")
    ET.SubElement(joint, "parent", link=hand.flange)
    ET.SubElement(joint, "child", link=f"{hand.name}.{base}")
    ET.SubElement(joint, "origin", xyz=f"{x} {y} {z}", rpy=f"{roll} {pitch} {yaw}")


def _drive(root: ET.Element, robot: Robot) -> None:
    """Mount the base on three joints of the robot's own frame: along x, along y and about z."""
    base, parent = _base(root), "ground"
    _weigh(ET.SubElement(root, "link", name=parent), "0")
    for i, (name, kind, axis) in enumerate(DRIVE):
        child = base if i == len(DRIVE) - 1 else f"{name}_link"
        if child != base:
            _weigh(ET.SubElement(root, "link", name=child), "5")
        joint = ET.SubElement(root, "joint", name=name, type=kind)
        ET.SubElement(joint, "parent", link=parent)
        ET.SubElement(joint, "child", link=child)
        ET.SubElement(joint, "axis", xyz=axis)
        far = str(FARTHEST)
        ET.SubElement(joint, "limit", lower=f"-{far}", upper=far, velocity=str(robot.driving), effort="5000")
        parent = child


def _weigh(link: ET.Element, mass: str) -> None:
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "mass", value=mass)
    ET.SubElement(inertial, "inertia", ixx="1", iyy="1", izz="1", ixy="0", ixz="0", iyz="0")
