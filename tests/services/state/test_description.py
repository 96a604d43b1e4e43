"""Foreign URDFs are read, or rejected with the mistake and its place."""

from __future__ import annotations

import math

import pytest

from models import MODELS, WHEELED, urdf_path
from models.urdf import BadUrdf, parse_urdf, read_joints
from tests.services.state.sample_urdfs import GRIPPER, LIMIT, joint_urdf, robot_urdf


@pytest.mark.parametrize("name", MODELS)
def test_the_models_are_read_as_the_simulation_reads_them(name: str) -> None:
    described = parse_urdf(urdf_path(name).read_text())
    assert described.joints == read_joints(name)
    assert described.root == ("base_footprint" if name in WHEELED else "root")


def test_limits_mimicry_and_axes_are_read() -> None:
    found = {each.name: each for each in parse_urdf(GRIPPER).joints}
    assert (found["shoulder"].limits.lower, found["shoulder"].limits.upper) == (-1, 2)
    assert found["right"].axis == (0, 1, 0), "an axis has length 1"
    assert found["wrist"].axis == (1, 0, 0)
    unlimited = parse_urdf(robot_urdf(joint_urdf("j", "continuous", "a", "b", '<limit effort="1e16" velocity="inf"/>')))
    limits = unlimited.joints[0].limits
    assert (limits.lower, limits.upper, limits.effort, limits.velocity) == (None, None, 1e6, 1e6)
    mimic = found["left"].mimic
    assert mimic is not None
    assert (mimic.joint, mimic.factor, mimic.offset) == ("right", -1, 0.001)


def test_a_sliding_joint_goes_along_its_axis_and_a_turning_one_about_it() -> None:
    found = {each.name: each for each in parse_urdf(GRIPPER).joints}
    assert found["right"].transform(0.02) == ((0, 0.02, 0), (0, 0, 0, 1))
    turned = joint_urdf(
        "j", "prismatic", "a", "b", '<origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/><limit upper="1"/>'
    )
    place, turn = parse_urdf(robot_urdf(turned)).joints[0].transform(0.5)
    assert place == pytest.approx((1, 0.5, 0))
    assert turn == pytest.approx((0, 0, math.sqrt(0.5), math.sqrt(0.5)))
    assert found["wrist"].transform(math.pi)[1] == pytest.approx((math.sqrt(0.5), math.sqrt(0.5), 0, 0), abs=1e-12)


@pytest.mark.parametrize(
    ("urdf", "told"),
    [
        ("", "not XML"),
        ("package://robot/urdf/robot.urdf", "is it a xacro or a path"),
        ("<sdf/>", "root is <sdf>"),
        ("<robot name='x'/>", "has no link"),
        ("<!DOCTYPE r [<!ENTITY a 'b'>]><robot><link name='&a;'/></robot>", "document type"),
        ("<robot>" + " " * (1 << 20) + "</robot>", "the limit is 1048576"),
        ("<robot>" + "<a>" * 1500 + "</a>" * 1500 + "</robot>", "elements more than 100 deep, at line 1"),
        (
            robot_urdf(joint_urdf("j", "revolute", "a", "b", '<limit lower="nan" upper="1"/>')),
            "lower='nan' is not a number",
        ),
        (robot_urdf(joint_urdf("j", "hinge", "a", "b")), "unknown type 'hinge'"),
        (robot_urdf(joint_urdf("", "fixed", "a", "b")), "has no name"),
        (robot_urdf(joint_urdf("j", "fixed", "a", "b").replace('<child link="b"/>', "")), "no <child"),
        (robot_urdf(joint_urdf("j", "fixed", "a", "b")).replace('<link name="b"/>', ""), "there is no link 'b'"),
        (robot_urdf(joint_urdf("j", "revolute", "a", "b")), "has no <limit>"),
        (robot_urdf(joint_urdf("j", "revolute", "a", "b", '<limit lower="2" upper="1"/>')), "lies above"),
        (robot_urdf(joint_urdf("j", "fixed", "a", "b", '<origin xyz="0 0"/>')), "not three numbers"),
        (robot_urdf(joint_urdf("j", "fixed", "a", "b", '<origin xyz="nan 0 0"/>')), "exceeds"),
        (robot_urdf(joint_urdf("j", "fixed", "a", "b", '<origin rpy="0 1e300 0"/>')), "exceeds"),
        (robot_urdf(joint_urdf("j", "continuous", "a", "b", '<axis xyz="0 0 0"/>')), "axis is 0 0 0"),
        (
            robot_urdf(joint_urdf("j", "fixed", "a", "b"), joint_urdf("j", "fixed", "b", "c")),
            "joint 'j' occurs twice",
        ),
        (
            robot_urdf(joint_urdf("j", "fixed", "a", "c"), joint_urdf("k", "fixed", "b", "c")),
            "'c' has two parents, 'a' and 'b'",
        ),
        (robot_urdf(joint_urdf("j", "fixed", "a", "b"), joint_urdf("k", "fixed", "b", "a")), "in a loop"),
        (robot_urdf(joint_urdf("j", "fixed", "a", "b"), links="c"), "'a', 'c' have no parent"),
        (robot_urdf(joint_urdf("j", "continuous", "a", "b", "<mimic/>")), "names no joint"),
        (
            robot_urdf(joint_urdf("j", "continuous", "a", "b", '<limit effort="strong"/>')),
            "joint 'j': effort='strong' is not a number",
        ),
        (
            '<robot name="r"><link name="a"><inertial><mass value="heavy"/></inertial></link></robot>',
            "link 'a': value='heavy' is not a number",
        ),
        (
            robot_urdf(joint_urdf("j", "continuous", "a", "b", '<mimic joint="k" multiplier="much"/>')),
            "multiplier='much' is not a number",
        ),
        (
            robot_urdf(
                joint_urdf("j", "revolute", "a", "b", f'{LIMIT}<mimic joint="k"/>'),
                joint_urdf("k", "revolute", "b", "c", f'{LIMIT}<mimic joint="j"/>'),
            ),
            "in a circle",
        ),
    ],
)
def test_what_is_no_robot_is_refused(urdf: str, told: str) -> None:
    with pytest.raises(BadUrdf, match=told.replace("(", r"\(")):
        parse_urdf(urdf)


def test_a_robot_within_an_element_urdf_is_read_as_joint_state_publisher_does() -> None:
    robot = robot_urdf(joint_urdf("arm/lift", "continuous", "a", "b"))
    start = robot.index("<robot")
    framed = f"{robot[:start]}<urdf>\n{robot[start:]}\n</urdf>"
    assert [each.name for each in parse_urdf(framed).joints] == ["arm/lift"]
    for odd in ("<urdf/>", "<urdf><link name='a'/></urdf>", f"<urdf>{robot[start:] * 2}</urdf>"):
        with pytest.raises(BadUrdf, match="not <robot>"):
            parse_urdf(odd)


def test_what_ros_takes_is_taken_and_what_does_nothing_is_told() -> None:
    """Each occurs in published files: urdfdom reads them, and robot_state_publisher publishes their frames."""
    fixed = joint_urdf("j", "fixed", "a", "b")
    described = parse_urdf(
        robot_urdf(fixed, joint_urdf("k", "fixed", "b", "c", '<mimic joint="j" multiplier="1" offset="0"/>'))
    )
    assert [each.mimic for each in described.joints] == [None, None]
    assert described.warnings == ("joint 'k' is fixed and mimics 'j': its <mimic> is ignored",)
    for followed, what in (("j", "is fixed"), ("nobody", "does not exist")):
        described = parse_urdf(
            robot_urdf(fixed, joint_urdf("k", "continuous", "b", "c", f'<mimic joint="{followed}"/>'))
        )
        assert described.joints[1].mimic is None
        assert described.warnings == (f"joint 'k' mimics {followed!r}, which {what}: its <mimic> is ignored",)
    for low, high in (("-1e16", "1e16"), ("-inf", "inf")):
        free = parse_urdf(
            robot_urdf(joint_urdf("j", "revolute", "a", "b", f'<limit lower="{low}" upper="{high}"/>'))
        ).joints[0]
        assert (free.limits.lower, free.limits.upper) == (-1e6, 1e6)
    odd = robot_urdf(joint_urdf("j", "fixed", "a", "b", '<axis xyz="none"/>')).replace(
        "<robot", "<robot xmlns='http://ros.org'"
    )
    odd = odd.replace("?>", ' encoding="utf-16"?><!-- <!DOCTYPE x> -->', 1).replace("</robot>", "<xacro:p/></robot>")
    assert parse_urdf(odd).root == "a"


@pytest.mark.slow
def test_a_long_chain_is_read_in_no_time() -> None:
    chain = [
        joint_urdf(f"j{n}", "continuous", f"l{n}", f"l{n + 1}", f'<mimic joint="j{n + 1}"/>' if n < 998 else "")
        for n in range(999)
    ]
    assert len(parse_urdf(robot_urdf(*chain)).joints) == 999
