"""The interface catalogue: the standard packages of ROS, and a workspace's own packages with clear errors."""

from __future__ import annotations

from pathlib import Path

import pytest

from messages.cdr.definitions import parse, text_of
from messages.errors import BadInput
from messages.interfaces import BadDefinition, Catalogue, Constant, Field, UnknownType
from messages.interfaces.definition import parse_action, parse_message, parse_service
from tests.harness.cases import case

MD5 = [line.split() for line in (Path(__file__).parent / "ros1_md5.txt").read_text().splitlines()]
"""Checksums computed by ROS Noetic's genmsg from the original files."""


def test_ros_1_types_have_the_checksums_of_ros_1() -> None:
    catalogue = Catalogue()
    assert {name: catalogue.md5(name) for _, name in MD5} == {name: md5 for md5, name in MD5}


def test_every_type_is_whole_in_both_forms() -> None:
    catalogue = Catalogue()
    messages = [
        *catalogue.all_types("msg"),
        *(part.name for name in catalogue.all_types("srv") for part in catalogue.service(name).messages),
        *(part.name for name in catalogue.all_types("action") for part in catalogue.action(name).messages),
    ]
    assert len(messages) > 500
    for name in messages:
        with case(name):
            assert catalogue.full_text(name).startswith(catalogue.message(name).text)
            types = catalogue.definitions(name)
            again = parse(name, text_of(name, types))
            assert {each: [str(field) for field in again[each]] for each in types} == {
                each: [str(field) for field in fields] for each, fields in types.items()
            }


def test_forms_of_the_two_ros() -> None:
    catalogue = Catalogue()
    names = lambda ros: [field.name for field in catalogue.message("sensor_msgs/CameraInfo", ros).fields]  # noqa: E731
    assert names(1)[4:8] == ["D", "K", "R", "P"]
    assert names(2)[4:8] == ["d", "k", "r", "p"]
    assert [str(field) for field in catalogue.message("std_msgs/Header").fields] == [
        "uint32 seq",
        "time stamp",
        "string frame_id",
    ]
    assert [str(field) for field in catalogue.message("std_msgs/msg/Header", 2).fields] == [
        "builtin_interfaces/Time stamp",
        "string frame_id",
    ]
    assert catalogue.message("geometry_msgs/Quaternion", 2).fields[3].default == "1"
    assert catalogue.service("std_srvs/srv/SetBool").text == "bool data\n---\nbool success\nstring message\n"


def test_what_a_definition_may_hold() -> None:
    read = parse_message(
        "pkg/Some",
        "# a comment\nint32 X=-1   # one\nuint8 MASK=0x1f\nfloat32 PI=3.14\nbool YES=True\n"
        "string TEXT= it's # all this\n"
        'string<=9 QUOTED="a b"\nbyte B=-1\n\nHeader header\nOther[3] own\nfloat64 x 1.5\nstring name "a b" # why\n'
        "uint8[<=4] few\nstring[] names\ntime when\nother_pkg/msg/Thing thing # why\n",
    )
    assert read.constants == (
        Constant("X", "int32", -1, "-1"),
        Constant("MASK", "uint8", 31, "0x1f"),
        Constant("PI", "float32", 3.14, "3.14"),
        Constant("YES", "bool", True, "True"),
        Constant("TEXT", "string", "it's # all this", "it's # all this"),
        Constant("QUOTED", "string", "a b", '"a b"'),
        Constant("B", "byte", -1, "-1"),
    )
    assert read.fields == (
        Field("header", "std_msgs/Header"),
        Field("own", "pkg/Other", 3),
        Field("x", "float64", default="1.5"),
        Field("name", "string", default='"a b"'),
        Field("few", "uint8", -1, 4),
        Field("names", "string", -1),
        Field("when", "time"),
        Field("thing", "other_pkg/Thing"),
    )
    action = parse_action("pkg/Count", "int32 n\n---\n---\nint32 f # now\n")
    assert [each.name.removeprefix("pkg/Count") for each in action.messages] == [
        "Action",
        "ActionGoal",
        "ActionResult",
        "ActionFeedback",
        "Goal",
        "Result",
        "Feedback",
    ]


def test_a_bad_definition_is_refused_with_file_and_line() -> None:
    for text, reason in (
        ("int32 a\nfloat64\n", "x.msg:2: 'float64' is not a field: a type and a name are needed"),
        ("int32 a;\n", "x.msg:1: 'int32 a;' is not a field: a line does not end in ';'"),
        ("int32 a\nint8 a\n", "x.msg:2: a is defined twice"),
        ("int8 N=300\n", "x.msg:1: N: 300 does not fit int8"),
        ("int8 N=many\n", "x.msg:1: N: invalid literal"),
        ("geometry_msgs/Pose P=1\n", "x.msg:1: P: a constant cannot be of type geometry_msgs/Pose"),
        ("bool B=perhaps\n", "x.msg:1: B: 'perhaps' is not a bool"),
        ("int32[ a\n", "x.msg:1: 'int32[ a' is not a field"),
        ("\n" * 10_001, "at most 10000 lines"),
    ):
        with case(text[:20]), pytest.raises(BadDefinition) as error:
            parse_message("pkg/X", text, "x.msg")
        assert reason in str(error.value)
    with pytest.raises(BadDefinition, match="1 lines '---' instead of 2"):
        parse_action("pkg/Ask", "int32 a\n---\n")
    alone = parse_service("pkg/Ask", "int32 a # of '---'")
    assert ([each.name for each in alone.request.fields], alone.response.fields) == (["a"], ())
    with pytest.raises(BadDefinition, match=r"pkg/Ask:2: too many lines '---'"):
        parse_service("pkg/Ask", "---\n---\n")


def make_package(folder: Path, files: dict[str, str | bytes]) -> Path:
    """Write a package's folder with these definitions; return it."""
    for name, text in files.items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return folder


def test_a_package_of_a_workspace(tmp_path: Path) -> None:
    folder = make_package(
        tmp_path,
        {
            "msg/Step.msg": "Header header\nfloat64[] xs\nstring NAME=hello # all\nduration d\n",
            "srv/Ask.srv": "int64 a\n---\nint64 b\nStep g\n",
            "action/Count.action": "int32 n\n---\nint32 r\n---\nint32 f\n",
        },
    )
    catalogue = Catalogue(lambda name: folder if name == "walk" else None)
    assert catalogue.types("walk", "msg") == ["Step"]
    assert catalogue.md5("walk/Step") == "181ec30f158ba0c563da142863bae884"
    assert list(catalogue.definitions("walk/AskResponse")) == [
        "walk/AskResponse",
        "walk/Step",
        "std_msgs/Header",
        "builtin_interfaces/Time",
        "builtin_interfaces/Duration",
    ]
    assert [field.type for field in catalogue.message("walk/CountActionGoal").fields] == [
        "std_msgs/Header",
        "actionlib_msgs/GoalID",
        "walk/CountGoal",
    ]
    assert not catalogue.has_package("talk")
    assert "walk" in catalogue.packages()


def test_what_is_wrong_in_a_workspace_is_named(tmp_path: Path) -> None:
    folder = make_package(
        tmp_path,
        {
            "msg/Self.msg": "int32 a\nSelf[] inner\n",
            "msg/Lost.msg": "int32 a\n\ngeometry_msgs/Poze pose # where\n",
            "srv/Lost2.srv": "---\nnowhere/Thing thing\n",
            "msg/Long.msg": "int8[2000000] many\n",
            "msg/None.msg": "int8[0] none\n",
            "msg/Binary.msg": b"int8 \xff\n",
            "msg/Large.msg": "# " + "x" * (1 << 20),
        },
    )
    catalogue = Catalogue(lambda name: folder if name == "bad" else None)
    for name, reason in (
        ("bad/Self", "bad/Self contains itself"),
        ("bad/Lost", f"{folder}/msg/Lost.msg:3: geometry_msgs has no message 'Poze'; did you mean 'geometry_msgs/Pose"),
        ("bad/Lost2Response", f"{folder}/srv/Lost2.srv:2: unknown package 'nowhere'"),
        ("bad/Long", "Long.msg:1: an array of 2000000 values"),
        ("bad/None", "None.msg:1: an array of 0 values"),
        ("bad/Binary", "Binary.msg: it is not UTF-8"),
        ("bad/Large", "Large.msg: a definition has at most 1048576 bytes"),
        ("bad/Lots", "bad has no message 'Lots'; did you mean 'bad/Lost'?"),
        ("std_msg/String", "unknown package 'std_msg'; did you mean 'std_msgs'?"),
    ):
        with case(name), pytest.raises(BadInput) as error:
            catalogue.closure(name)
        assert reason in str(error.value)
    with pytest.raises(UnknownType):
        catalogue.service("std_srvs/Bool")


def test_a_workspace_comes_before_the_standard(tmp_path: Path) -> None:
    folder = make_package(tmp_path, {"msg/String.msg": "int32 data\n"})
    catalogue = Catalogue()
    before = catalogue.md5("std_msgs/String")
    assert catalogue.add_package("std_msgs", folder)
    assert catalogue.md5("std_msgs/String") != before
    assert catalogue.types("std_msgs", "msg") == ["String"]
    assert not catalogue.add_package("geometry_msgs", tmp_path / "nothing")
    assert catalogue.types("geometry_msgs", "msg")


def test_definitions_lie_where_the_package_says(tmp_path: Path) -> None:
    folder = make_package(
        tmp_path, {"messages/A.msg": "int32 a\n", "defs/srv/B.srv": "---\n", "msg/C.msg": "A a\n", "out/D.msg": ""}
    )
    (folder / "CMakeLists.txt").write_text(
        "add_message_files(\n  DIRECTORY messages # DIRECTORY out\n  FILES A.msg)\nadd_message_files(FILES C.msg)\n"
        'add_service_files(DIRECTORY "defs/srv" FILES B.srv)\nadd_action_files(DIRECTORY ../up)\n'
    )
    catalogue = Catalogue()
    assert catalogue.add_package("own", folder)
    assert (catalogue.types("own", "msg"), catalogue.types("own", "srv")) == (["A", "C"], ["B"])
