"""Static inspection of a script's source."""

from __future__ import annotations

from pathlib import Path

import pytest

from messages.errors import BadInput
from services.script.inspect_script import ScriptFacts, inspect_script, is_python, legal_node_name, runs_nothing

SCRIPTS = {
    "import rospy\nrospy.init_node('talker', anonymous=True)\n": ScriptFacts("ros1", "talker", True),
    "import rospy\nprint 'old'\nrospy.init_node( \"my_node\" )\n": ScriptFacts("ros1", "my_node"),
    "from rospy import *\nNAME = 'named'\ndef go():\n    init_node(NAME)\n": ScriptFacts("ros1", "named"),
    "import rospy\nimport sys\nrospy.init_node(sys.argv[1])\n": ScriptFacts("ros1", ""),
    "import roslib; roslib.load_manifest('x')\n"
    "import rospy\nrospy.init_node(name='Custom Rover Spawner')\n": ScriptFacts("ros1", "Custom_Rover_Spawner"),
    "try:\n\timport rospy\nexcept ImportError, e:\n        raise\n": ScriptFacts("ros1"),
    "import rclpy\nfrom rclpy.node import Node\n": ScriptFacts("ros2"),
    "from services.runtime import main\nimport tf\n": ScriptFacts(""),
    "import math\n": ScriptFacts(""),
    "raise RuntimeError('executed')\nimport rospy\n": ScriptFacts("ros1"),
}


def test_a_script_is_told_by_its_imports_and_named_by_its_node(tmp_path: Path) -> None:
    for number, (text, facts) in enumerate(SCRIPTS.items()):
        file = tmp_path / f"script{number}.py"
        file.write_text(text)
        assert inspect_script(file) == facts, text


def test_modules_of_its_package_tell_what_a_thin_script_is_written_for(tmp_path: Path) -> None:
    for folder in ("scripts", "src/rover"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "src/rover/__init__.py").write_text("")
    (tmp_path / "src/rover/node.py").write_text("from rospy import init_node\nimport rover.node\n")
    (tmp_path / "scripts/start").write_text("#!/usr/bin/env python3\nfrom rover.node import main\nmain()\n")
    (tmp_path / "scripts/tool").write_bytes(b"\x7fELF")
    assert inspect_script(tmp_path / "scripts/start").api == "ros1"
    assert is_python(tmp_path / "scripts/start")
    assert not is_python(tmp_path / "scripts/tool")


def test_text_in_any_encoding_is_read(tmp_path: Path) -> None:
    file = tmp_path / "latin.py"
    file.write_bytes("# -*- coding: latin-1 -*-\nimport rospy # é\nrospy.init_node('a')\n".encode("latin-1"))
    assert inspect_script(file).node_name == "a"
    file.write_bytes(b"import rospy # \xff\xfe\nrospy.init_node('b')\n")
    assert inspect_script(file).node_name == "b"


def test_what_is_no_script_is_refused(tmp_path: Path) -> None:
    for path, said in {tmp_path / "gone.py": "there is no file", tmp_path: "there is no file"}.items():
        with pytest.raises(BadInput, match=said):
            inspect_script(path)


def test_a_file_that_is_not_there_is_named_with_the_nearest(tmp_path: Path) -> None:
    (tmp_path / "controller.py").write_text("")
    with pytest.raises(BadInput, match=r"there is no file .*/controler\.py; did you mean 'controller\.py'\?"):
        inspect_script(tmp_path / "controler.py")


def test_a_controller_that_never_calls_main_runs_nothing(tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    defined = (
        '"""Drives."""\nfrom services.runtime import STOP, main\nSPEED = float("0.1")\ndef run(ctx):\n    main(run)\n'
    )
    for text, nothing in {
        defined: True,
        f"{defined}main(run)\n": False,
        f"{defined}if __name__ == '__main__':\n    main(run)\n": False,
        f"{defined}status = main(run)\n": False,
        f"{defined}print(SPEED)\n": False,
        "def run(ctx):\n    pass\n": False,
        f"{defined}def\n": False,
    }.items():
        file.write_text(text)
        assert runs_nothing(file) is nothing, text


def test_names_become_legal() -> None:
    names = {"a b": "a_b", "3d": "_3d", "/ns/x-y": "x_y", "": "", " talker ": "talker"}
    assert {name: legal_node_name(name) for name in names} == names
