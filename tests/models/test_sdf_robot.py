"""Conversion of SDF models to URDF: frames, joints, Gazebo tags, and errors."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import pytest

from messages.errors import BadInput
from models.gazebo_tags import parse_gazebo_tags
from models.sdf_robot import is_sdf, model_name, urdf_of_sdf
from models.urdf import parse_urdf

ROVER = """<?xml version="1.0"?>
<sdf version="1.6"><model name="rover">
  <link name="chassis"><pose>0 0 0.1 0 0 0</pose>
    <inertial><pose>0 0 0.02 0 0 0</pose><mass>5</mass><inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.3</izz></inertia>
    </inertial>
    <collision name="c"><geometry><box><size>0.4 0.2 0.1</size></box></geometry>
      <surface><friction><ode><mu>0.7</mu></ode></friction></surface></collision>
    <sensor name="lidar" type="ray"><ray><scan><horizontal><samples>90</samples><min_angle>-1</min_angle>
      <max_angle>1</max_angle></horizontal></scan><range><min>0.1</min><max>5</max></range></ray>
      <plugin name="laser" filename="libgazebo_ros_laser.so"><topicName>scan</topicName></plugin></sensor>
  </link>
  <link name="left"><pose>0 0.15 0.05 -1.5707963 0 0</pose>
    <collision name="c"><geometry><cylinder><radius>0.05</radius><length>0.02</length></cylinder></geometry></collision>
  </link>
  <link name="right"><pose>0 -0.15 0.05 -1.5707963 0 0</pose>
    <collision name="c"><geometry><cylinder><radius>0.05</radius><length>0.02</length></cylinder></geometry></collision>
  </link>
  <link name="caster"><pose>-0.15 0 0.02 0 0 0</pose>
    <collision name="c"><geometry><sphere><radius>0.02</radius></sphere></geometry></collision></link>
  <joint name="left_joint" type="revolute"><parent>chassis</parent><child>left</child>
    <axis><xyz>0 0 1</xyz><limit><effort>3</effort></limit></axis></joint>
  <joint name="right_joint" type="revolute"><parent>chassis</parent><child>right</child>
    <axis><xyz>0 0 1</xyz></axis></joint>
  <joint name="slide" type="prismatic"><pose>0 0 0.01 0 0 0</pose><parent>chassis</parent><child>caster</child>
    <axis><xyz>0 0 1</xyz><limit><lower>-0.01</lower><upper>0.02</upper></limit>
    <dynamics><damping>4</damping></dynamics></axis></joint>
  <plugin name="drive" filename="libgazebo_ros_diff_drive.so"><leftJoint>left_joint</leftJoint>
    <rightJoint>right_joint</rightJoint><wheelSeparation>0.3</wheelSeparation><wheelDiameter>0.1</wheelDiameter>
  </plugin>
</model></sdf>"""


def numbers(text: str | None) -> list[float]:
    return [float(each) for each in (text or "").split()]


def test_a_rover_keeps_its_frames_its_joints_and_its_drive() -> None:
    made = urdf_of_sdf(ROVER)
    assert is_sdf(ROVER)
    assert not is_sdf(made.urdf)
    assert model_name(ROVER) == model_name(made.urdf) == "rover"
    robot = parse_urdf(made.urdf)
    assert robot.root == "chassis"
    joints = {each.name: each for each in robot.joints}
    assert [joints[each].kind for each in ("left_joint", "right_joint", "slide")] == [
        "continuous",
        "continuous",
        "prismatic",
    ]
    assert joints["slide"].limits.lower == -0.01
    assert joints["slide"].limits.damping == 4
    root = ElementTree.fromstring(made.urdf)
    chassis, left, _, caster = root.findall("link")
    assert numbers(chassis.find("collision/origin").get("xyz")) == [0, 0, 0.1], "the root is the model's frame"  # type: ignore[union-attr]
    assert numbers(chassis.find("inertial/origin").get("xyz")) == pytest.approx([0, 0, 0.12])  # type: ignore[union-attr]
    assert numbers(left.find("collision/origin").get("xyz")) == [0, 0, 0]  # type: ignore[union-attr]
    assert numbers(root.find("joint[@name='left_joint']/origin").get("xyz")) == pytest.approx([0, 0.15, 0.05])  # type: ignore[union-attr]
    assert numbers(root.find("joint[@name='slide']/origin").get("xyz")) == pytest.approx([-0.15, 0, 0.03])  # type: ignore[union-attr]
    assert numbers(caster.find("collision/origin").get("xyz")) == pytest.approx([0, 0, -0.01]), "the joint is above"  # type: ignore[union-attr]
    tags = parse_gazebo_tags(made.urdf)
    assert tags.drive is not None
    assert (tags.drive.left_joints, tags.drive.separation) == (("left_joint",), 0.3)
    assert tags.laser is not None
    assert tags.friction["chassis"].coefficient == 0.7


def test_an_axis_is_in_the_frame_that_its_version_or_its_tags_state() -> None:
    def axis(version: str, frame: str = "", flag: str = "") -> list[float]:
        text = (
            f'<sdf version="{version}"><model name="m"><frame name="tilted"><pose>0 0 0 0 0 1.5707963267948966</pose>'
            '</frame><link name="a"/><link name="b"><pose>0 0.5 0 -1.5707963267948966 0 0</pose></link>'
            '<joint name="j" type="revolute"><parent>a</parent><child>b</child>'
            f"<axis><xyz {frame}>0 1 0</xyz>{flag}</axis></joint></model></sdf>"
        )
        found = ElementTree.fromstring(urdf_of_sdf(text).urdf).find("joint/axis")
        assert found is not None
        return numbers(found.get("xyz"))

    flag = "<use_parent_model_frame>{}</use_parent_model_frame>"
    across, own = pytest.approx([0, 0, 1], abs=1e-9), [0, 1, 0]
    for of_model in (
        axis("1.6", flag=flag.format(1)),
        axis("1.7", 'expressed_in="__model__"'),
        axis("1.4"),
        axis("1.10", 'expressed_in="a"'),
    ):
        assert of_model == across
    for of_joint in (
        axis("1.6"),
        axis("1.10"),
        axis("1.4", flag=flag.format(0)),
        axis("1.7", 'expressed_in="b"'),
        axis("1.7", 'expressed_in="j"'),
    ):
        assert of_joint == pytest.approx(own, abs=1e-9)
    assert axis("1.7", 'expressed_in="tilted"') == pytest.approx([-1, 0, 0], abs=1e-9)


def test_a_model_that_is_fixed_to_the_world_still_has_joints() -> None:
    text = """<sdf version="1.5"><model name="m"><link name="a"/><link name="b"/><link name="c"/>
      <joint name="hold" type="fixed"><parent>world</parent><child>a</child></joint>
      <joint name="turn" type="revolute"><parent>a</parent><child>b</child></joint>
      <joint name="odd" type="ball"><parent>b</parent><child>c</child></joint>
      <joint name="loop" type="revolute"><parent>a</parent><child>c</child></joint></model></sdf>"""
    made = urdf_of_sdf(text)
    assert parse_gazebo_tags(made.urdf).static
    assert {each.name: each.kind for each in parse_urdf(made.urdf).joints} == {"turn": "continuous", "odd": "fixed"}
    assert "joint 'odd' of the type 'ball' is fixed here" in made.notes[0]
    assert "joint 'loop' closes a loop" in made.notes[1]


def test_moments_follow_from_all_shapes_and_their_orientation() -> None:
    box = (
        '<collision name="{}"><pose>{} 0 0 0 0 {}</pose><geometry><box><size>0.6 0.6 0.2</size></box></geometry>'
        "</collision>"
    )

    def inertial_of(*parts: str) -> ElementTree.Element:
        inertial = "<inertial><mass>3</mass></inertial>"
        text = f'<sdf version="1.5"><model name="m"><link name="l">{inertial}{"".join(parts)}</link></model></sdf>'
        found = ElementTree.fromstring(urdf_of_sdf(text).urdf).find("link/inertial")
        assert found is not None
        return found

    def moments(inertial: ElementTree.Element) -> list[float]:
        return [float(inertial.find("inertia").get(each)) for each in ("ixx", "iyy", "izz")]  # type: ignore[union-attr, arg-type]

    x, y, z = 3 * (0.36 + 0.04) / 12, 3 * (0.36 + 0.04) / 12, 3 * (0.36 + 0.36) / 12
    for yaw in (0.0, math.pi / 4, math.pi / 2):
        assert moments(inertial_of(box.format("a", 0, yaw))) == pytest.approx([x, y, z])
    both = inertial_of(box.format("a", 0.2, 0), box.format("b", 0.8, 0))
    assert numbers(both.find("origin").get("xyz")) == pytest.approx([0.5, 0, 0])  # type: ignore[union-attr]
    assert moments(both) == pytest.approx([x, y + 3 * 0.3**2, z + 3 * 0.3**2]), "Steiner"


def test_what_is_no_model_is_said() -> None:
    def model(inner: str) -> str:
        return f'<sdf version="1.5"><model name="m">{inner}</model></sdf>'

    joint = '<joint name="j" type="{}"><parent>{}</parent><child>{}</child></joint>'
    ring = joint.format("fixed", "a", "b") + joint.format("fixed", "b", "a")
    for text, reason in (
        ("<sdf version='1.5'/>", "has 0 models"),
        (model(""), "no links"),
        (model('<link name="a"/>' + joint.format("revolute", "a", "bb")), "joint 'j': unknown link 'bb'"),
        (model('<link name="a"/><link name="a"/>'), "two links of the same name"),
        (model('<link name="a"/>' + joint.format("revolute", "world", "a")), "revolute to the world"),
        (
            model('<link name="a"/><link name="b"/>' + ring),
            "form a ring",
        ),
        (model('<link name="a"/><joint name="j" type="fixed"><child>a</child></joint>'), "model.sdf:1: "),
        ("<sdf version='1.5'><model", "not XML"),
    ):
        with pytest.raises(BadInput, match=reason):
            urdf_of_sdf(text)


def test_hostile_texts_take_no_longer_than_others() -> None:
    """1 MiB of opening tags without an end: searching for each end again would take minutes."""
    for begin in ("<!--", "<gazebo ", "<model ", "<model name", "<robot name="):
        text = begin * ((1 << 20) // len(begin))
        with pytest.raises(BadInput):
            urdf_of_sdf(text)
        assert model_name(text) == ""
        assert is_sdf(text) == (begin == "<gazebo ")
