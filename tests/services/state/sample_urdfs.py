"""Robots for the tests of the state service."""

from __future__ import annotations


def robot_urdf(*joints: str, links: str = "") -> str:
    """Return a URDF of these joints and the links that they name."""
    import re

    names = dict.fromkeys([*re.findall(r'link="([^"]+)"', "".join(joints)), *links.split()])
    body = "".join(f'<link name="{each}"/>' for each in names)
    return f'<?xml version="1.0"?>\n<robot name="test">{body}{"".join(joints)}</robot>'


def joint_urdf(name: str, kind: str, parent: str, child: str, inside: str = "") -> str:
    """Return a joint element with ``inside`` as its further content."""
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


LIMIT = '<limit lower="-1" upper="2" effort="1" velocity="1"/>'

GRIPPER = robot_urdf(
    joint_urdf("mount", "fixed", "base", "post", '<origin xyz="0 0 0.5"/>'),
    joint_urdf("shoulder", "revolute", "post", "arm", f'<origin xyz="0 0 0.1"/><axis xyz="0 1 0"/>{LIMIT}'),
    joint_urdf("wrist", "continuous", "arm", "hand", '<origin xyz="0.3 0 0" rpy="0 0 1.5707963267948966"/>'),
    joint_urdf("right", "prismatic", "hand", "right_finger", '<axis xyz="0 2 0"/><limit lower="0.01" upper="0.05"/>'),
    joint_urdf(
        "left",
        "prismatic",
        "hand",
        "left_finger",
        '<axis xyz="0 1 0"/><limit lower="-0.05" upper="0"/><mimic joint="right" multiplier="-1" offset="0.001"/>',
    ),
    joint_urdf("tip", "revolute", "left_finger", "nail", f'{LIMIT}<mimic joint="left" multiplier="10"/>'),
    joint_urdf("camera", "fixed", "hand", "/eye"),
)
"""An arm with two fingers, one of which mimics the other; a nail mimics that one."""
