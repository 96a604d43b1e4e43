"""Robot descriptions in a bag match its frames: links get the prefix that the frames have."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from messages.base import Message
from messages.cdr.sidecar import StringExtra, join
from messages.geometry import TransformStamped
from messages.std import String
from messages.tf import TFMessage
from models import MODELS, urdf_path
from models.urdf import parse_urdf
from services.recorder.urdf_prefix import UrdfPrefixer, prefix_links

URDF = """<?xml version="1.0"?>
<!-- A base with an arm. -->
<robot name="thing">
  <link name="base"/><link name="arm"><sensor><parent link="base"/></sensor></link>
  <joint name="base" type="fixed"><parent link="base"/><child link="arm"/></joint>
  <gazebo reference="arm"/><gazebo reference="nothing"/>
</robot>
"""


def split(topic: str, text: str, *frames: str) -> tuple[Message, Message | None]:
    """Return the recorded description and its sidecar, after these frames were received."""
    fitting = UrdfPrefixer()
    fitting.add_frames([TFMessage(transforms=tuple(TransformStamped(child_frame_id=each) for each in frames))])
    return fitting.apply(topic, String(data=text))


@pytest.mark.parametrize(
    ("topic", "frames", "prefix"),
    [
        ("/r/robot_description", (), "r/"),
        ("/r/robot_description", ("r/base", "r/arm", "q/arm"), "r/"),
        ("/robot_description", ("r/base", "r/arm"), "r/"),
        ("/lab/r/robot_description", ("/lab/r/arm",), "lab/r/"),
        ("/lab/r/robot_description", ("r/arm", "q/arm"), "r/"),
        ("/lab/r/robot_description", ("my/own/arm", "q/wheel"), "my/own/"),
        ("/lab/r/robot_description", ("one/arm", "two/arm"), "lab/r/"),
    ],
)
def test_links_bear_the_prefix_that_the_frames_have(topic: str, frames: tuple[str, ...], prefix: str) -> None:
    recorded, beside = split(topic, URDF, *frames)
    assert isinstance(recorded, String)
    robot = ElementTree.fromstring(recorded.data)
    assert robot.get("name") == prefix.strip("/")
    assert [each.get("name") for each in robot.findall("link")] == [f"{prefix}base", f"{prefix}arm"]
    assert [each.get("link") for each in robot.iter("parent")] == [f"{prefix}base"] * 2
    assert [each.get("reference") for each in robot.findall("gazebo")] == [f"{prefix}arm", "nothing"]
    assert [each.get("name") for each in robot.findall("joint")] == ["base"], "joint states know it by this name"
    assert beside == StringExtra(data=URDF)
    assert join(recorded, beside) == String(data=URDF), "and is played back as it was"


@pytest.mark.parametrize(
    ("topic", "text", "frames"),
    [
        ("/robot_description", URDF, ()),
        ("/robot_description", URDF, ("base", "arm", "b/arm")),
        ("/r/robot_description", URDF, ("arm",)),
        ("/r/robot_description", prefix_links(URDF, "r/"), ()),
        ("/r/robot_description", "<robot/>", ()),
        ("/r/robot_description", "no XML", ()),
        ("/r/robot_description", f"<!DOCTYPE x>{URDF}", ()),
        ("/r/text", URDF, ()),
    ],
)
def test_what_fits_or_is_no_description_stays_as_it_is(topic: str, text: str, frames: tuple[str, ...]) -> None:
    assert split(topic, text, *frames) == (String(data=text), None)


@pytest.mark.parametrize("model", MODELS)
def test_every_model_is_the_same_robot_with_a_prefix(model: str) -> None:
    text = urdf_path(model).read_text()
    before, after = parse_urdf(text), parse_urdf(prefix_links(text, "r/"))
    assert after.root == f"r/{before.root}"
    assert [each.name for each in after.joints] == [each.name for each in before.joints]
    assert [each.child for each in after.joints] == [f"r/{each.child}" for each in before.joints]
    assert [each.xyz for each in after.joints] == [each.xyz for each in before.joints]


def test_a_description_that_is_nested_without_end_is_recorded_as_it_is() -> None:
    """Writing XML is recursive: 1,500 nested elements crashed the recorder, and each restarted one."""
    deep = URDF.replace("</robot>", "<a>" * 1500 + "</a>" * 1500 + "</robot>")
    assert split("/r/robot_description", deep, "r/base") == (String(data=deep), None)
