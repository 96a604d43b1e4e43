"""Imports of message packages: standard ones, a workspace's with its own modules, and missing ones."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from messages.interfaces import UnknownType, catalogue
from services.script.interface_finder import install
from tests.harness.ros1 import ros1_imports

FILES = {
    "msg/Step.msg": "Header header\nfloat64[] xs\nuint8 FAST=2\n",
    "msg/Lost.msg": "int32 a\nnowhere/Thing thing\n",
    "srv/Ask.srv": "int64 a\n---\nStep step\n",
    "action/Count.action": "int32 n\n---\nint32 r\n---\nint32 f\n",
    "src/walking/__init__.py": "HERE = 1\n",
    "src/walking/gait.py": "def legs():\n    return 2\n",
    "cfg/Gait.cfg": "gen.generate('walking', 'walker', 'Walk')\n",
}


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """A package ``walking`` in a workspace, findable by imports."""
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    catalogue.cache_clear()
    with ros1_imports():
        sys.path.append(str(tmp_path / "src"))
        install(catalogue(), lambda name: tmp_path if name in ("walking", "tools") else None)
        yield tmp_path
    for name in [each for each in sys.modules if each.partition(".")[0] in ("walking", "tools")]:
        del sys.modules[name]
    catalogue.cache_clear()


def run(code: str) -> dict[str, object]:
    names: dict[str, object] = {}
    exec(code, names)
    return names


def test_a_package_has_its_modules_and_its_messages(folder: Path) -> None:
    names = run(
        "import walking.gait, walking.msg, walking.msg as m\n"
        "from walking.msg import Step, CountAction, CountGoal\n"
        "from walking.srv import *\n"
        "from walking.msg._Step import Step as again\n"
        "legs, here, one = walking.gait.legs(), walking.HERE, m.Step is Step is again\n"
        "step, action = AskResponse().step, CountAction()\n"
    )
    assert (names["legs"], names["here"], names["one"]) == (2, 1, True)
    assert (names["step"], names["step"].FAST) == (names["Step"](), 2)  # type: ignore[operator,attr-defined]
    assert {"Ask", "AskRequest", "AskResponse"} <= set(names)


@pytest.mark.slow
def test_every_standard_package_is_imported_whole(folder: Path) -> None:
    for package in catalogue().packages():
        for kind in ("msg", "srv"):
            if catalogue().types(package, kind) and package != "walking":
                names = run(f"from {package}.{kind} import *")
                assert set(catalogue().types(package, kind)) <= set(names)


def test_what_is_missing_is_named(folder: Path) -> None:
    for code, error, reason in (
        ("from walking.msg import Stop", ImportError, "cannot import name 'Stop' from 'walking.msg'"),
        ("import walking.msg\nwalking.msg.Stop", AttributeError, "did you mean 'Step'"),
        ("from walking.msg import Lost", UnknownType, f"{folder}/msg/Lost.msg:2: unknown package 'nowhere'"),
        ("import std_msgs.srv", ModuleNotFoundError, "No module named 'std_msgs.srv'"),
        ("import not_there.msg", ModuleNotFoundError, "No module named 'not_there'"),
        ("import walking.cfg.GaitConfig", ModuleNotFoundError, "No module named 'walking.cfg.GaitConfig'"),
    ):
        with pytest.raises(error) as raised:
            run(code)
        assert reason in str(raised.value)
