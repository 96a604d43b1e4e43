"""``.cfg`` files: the module that ROS's generator would write, and errors with file and line."""

from __future__ import annotations

from math import inf
from pathlib import Path

import pytest

from services.runtime.errors import BadInput
from services.script.reconfigure_config import (
    ParameterGenerator,
    config_module,
    config_modules,
    enum_constants,
    extract_params,
)

ARM = """#!/usr/bin/env python
PACKAGE = "arm"
from dynamic_reconfigure.parameter_generator_catkin import *
gen = ParameterGenerator()
gen.add("count", int_t, 0, "How many", 50, 0, 100)
gen.add("gain", double_t, 1, "The gain", .5, 0, 1)
gen.add("free", double_t, 1, "Unbounded", 3)
gen.add("title", str_t, 2, "A text", "Hello World")
gen.add("on", bool_t, 4, "A switch", True)
sizes = gen.enum([gen.const("Small", int_t, 0, "A small one"), gen.const("Medium", int_t, 1, "A medium one")], "Sizes")
gen.add("size", int_t, 0, "The size", 1, 0, 3, edit_method=sizes)
group = gen.add_group("My group", type="collapse", state=False)
group.add("inner", int_t, 8, "Inside", 2, 0, 5)
group.add_group("sub", type="tab").add("deep", double_t, 16, "Deep inside", 2, 0, 5)
exit(gen.generate(PACKAGE, "arm", "Arm"))
"""


def write(folder: Path, text: str, name: str = "Arm.cfg") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_the_module_is_that_of_a_build(tmp_path: Path) -> None:
    made = config_module(write(tmp_path, ARM))
    assert made["defaults"] == {
        "count": 50,
        "gain": 0.5,
        "free": 3.0,
        "title": "Hello World",
        "on": True,
        "size": 1,
        "inner": 2,
        "deep": 2.0,
    }
    assert [type(made["defaults"][each]) for each in ("free", "deep", "count", "on")] == [float, float, int, bool]
    assert made["min"] == {
        "count": 0,
        "gain": 0.0,
        "free": -inf,
        "title": "",
        "on": False,
        "size": 0,
        "inner": 0,
        "deep": 0.0,
    }
    assert (made["max"]["free"], made["max"]["on"], made["max"]["count"]) == (inf, True, 100)
    assert made["level"] == {
        "count": 0,
        "gain": 1,
        "free": 1,
        "title": 2,
        "on": 4,
        "size": 0,
        "inner": 8,
        "deep": 16,
    }
    assert (made["all_level"], made["type"]["deep"], made["inf"]) == (31, "double", inf)
    assert (made["Arm_Small"], made["Arm_Medium"]) == (0, 1)
    root = made["config_description"]
    assert {name: value for name, value in root.items() if name not in ("parameters", "groups")} == {
        "name": "Default",
        "type": "",
        "state": True,
        "cstate": "true",
        "id": 0,
        "parent": 0,
        "srcline": 4,
        "srcfile": "Arm.cfg",
        "class": "DEFAULT",
        "parentclass": "",
        "parentname": "Default",
        "field": "default",
        "upper": "DEFAULT",
        "lower": "groups",
    }
    (group,) = root["groups"]
    (sub,) = group["groups"]
    assert [group[each] for each in ("name", "type", "state", "cstate", "id", "parent", "class", "field")] == [
        "My_group",
        "collapse",
        False,
        "false",
        1,
        0,
        "DEFAULT::MY_GROUP",
        "DEFAULT::my_group",
    ]
    assert [sub[each] for each in ("name", "id", "parent", "class", "parentclass", "field", "lower")] == [
        "sub",
        2,
        1,
        "DEFAULT::MY_GROUP::SUB",
        "DEFAULT::MY_GROUP",
        "DEFAULT::MY_GROUP::sub",
        "sub",
    ]
    assert root["parameters"][1] == {
        "name": "gain",
        "type": "double",
        "default": 0.5,
        "level": 1,
        "description": "The gain",
        "min": 0.0,
        "max": 1.0,
        "srcline": 6,
        "srcfile": "Arm.cfg",
        "edit_method": "",
        "ctype": "double",
        "cconsttype": "const double",
    }
    (size,) = (each for each in extract_params(root) if each["name"] == "size")
    assert [(each.name, each.value) for each in enum_constants(size)] == [("Small", 0), ("Medium", 1)]


def test_old_files_are_understood(tmp_path: Path) -> None:
    """Python 2, rosbuild's imports, the levels of driver_base, a plain call at the end, and several configs in one."""
    made = config_modules(
        write(
            tmp_path,
            "PACKAGE='old'\n"
            "import roslib; roslib.load_manifest(PACKAGE)\n"
            "from dynamic_reconfigure.parameter_generator import *\n"
            "from driver_base.msg import SensorLevels\n"
            "from math import pi\n"
            "import sys\n"
            "gen = ParameterGenerator()\n"
            'gen.add("angle", double_t, SensorLevels.RECONFIGURE_STOP, "An angle", 0, -pi, pi)\n'
            "if False:\n"
            "\tprint 'mixed'\n"
            "print gen\n"
            "gen.generate(PACKAGE, 'old', 'Old')\n"
            "sys.exit(gen.generate(PACKAGE, 'old', 'Other'))\n",
            "old.cfg",
        )
    )
    assert list(made) == ["OldConfig", "OtherConfig"]
    assert made["OldConfig"]["level"] == {"angle": 1}
    assert made["OldConfig"]["max"]["angle"] == pytest.approx(3.14159, abs=1e-5)
    by_module = write(
        tmp_path,
        "import dynamic_reconfigure.parameter_generator_catkin as pgc\n"
        "from dynamic_reconfigure import parameter_generator_catkin\n"
        "gen = pgc.ParameterGenerator()\n"
        "gen.add('x', parameter_generator_catkin.int_t, 0, 'x')\n"
        "exit(gen.generate('p', 'n', 'By'))\n",
        "By.cfg",
    )
    assert config_module(by_module)["max"] == {"x": 2**31 - 1}


def test_what_is_wrong_is_said_with_file_and_line(tmp_path: Path) -> None:
    head = "from dynamic_reconfigure.parameter_generator_catkin import *\ngen = ParameterGenerator()\n"
    for text, reason in (
        (
            head + "gen.add('x', int_t, 0, 'x', 1.5)",
            r"bad.cfg:3: TypeError: x has the type int, but its default is 1.5",
        ),
        (head + "gen.add('x', int_t, 0, 'x', 1, 5, 2)", r"bad.cfg:3: ValueError: x: min 5 is above max 2"),
        (head + "gen.add('x', str_t, 0, 'x', 'a', max='b')", r"bad.cfg:3: .* x is a str, which takes no min and max"),
        (head + "gen.add('2x', int_t, 0, 'x')", r"bad.cfg:3: .*'2x' is not a valid parameter name"),
        (head + "gen.add('x', 'long', 0, 'x')", r"bad.cfg:3: .*expected str_t, bool_t, int_t or double_t"),
        (head + "gen.add('x', int_t, 0, 'x')\ngen.add('x', int_t, 0, 'x')", r"bad.cfg:4: .*added twice"),
        (head + "gen.enum([], 'none')", r"bad.cfg:3: .*different types, or there are none"),
        (head + "gen.const('A', int_t, 1, \"it's\")", r"bad.cfg:3: .*quotes"),
        (head + "import no_such_thing", r"bad.cfg:3: it imports no_such_thing, which was not found"),
        (head + "exit(1)", r"bad.cfg:3: it ends with exit\(1\)|bad.cfg: it ends with exit\(1\)"),
        (head + "gen.add('x', int_t, 0, 'x')", r"bad.cfg: .*generate\(\) is never called"),
        (head + "def (", r"bad.cfg:3: "),
        (head + "1 / 0", r"bad.cfg:3: ZeroDivisionError"),
        ("#" * (1 << 20) + "\n", r"bad.cfg: it is larger than 1048576 bytes"),
    ):
        with pytest.raises(BadInput, match=reason):
            config_module(write(tmp_path, text, "bad.cfg"))
    with pytest.raises(BadInput, match=r"missing\.cfg: it cannot be read: No such file"):
        config_module(tmp_path / "missing.cfg")


def test_a_generator_that_is_inherited_from_numbers_its_groups_itself() -> None:
    class Variables(ParameterGenerator):
        def __init__(self) -> None:
            self.group = self.Group(self, "Default", "", True, 0, 0)
            self.constants = []

    variables = Variables()
    variables.add("size", "int", 0, "a size", 2, 0, 3)
    variables.add_group("more").add("speed", "double", 0, "a speed", 0.5)
    told = variables.group.to_dict()
    assert (told["id"], told["parent"], [each["name"] for each in told["parameters"]]) == (0, 0, ["size"])
    assert [(each["id"], each["parent"]) for each in told["groups"]] == [(1, 0)]
