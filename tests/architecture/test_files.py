"""Every file of the packages begins with a docstring; only one file uses MessagePack."""

from __future__ import annotations

import ast
import re

import pytest

from services.runtime.process import ROOT
from tests.harness.project_files import PACKAGES, project_files

SOURCES = [path for package in PACKAGES for path in project_files(".py", under=ROOT / package)]
NAMES = [str(path.relative_to(ROOT)) for path in SOURCES]
FIRST_TEXT = re.compile(r'(?:#.*\n|\s)*r?"""\s*\S')
"""A docstring, possibly after comments; a pattern, as parsing every file would take a second."""
LEFTOVER = re.compile(r"\b(?:T[O]DO|F[I]XME|X[X]X|H[A]CK)\b")


def test_every_file_says_what_it_is() -> None:
    texts = {name: path.read_text() for name, path in zip(NAMES, SOURCES, strict=True)}
    assert [name for name, text in texts.items() if text and not FIRST_TEXT.match(text)] == []


def test_every_folder_of_code_is_a_package() -> None:
    """Without ``__init__.py`` the import contracts would ignore a folder; ROS 1's commands are plain programs."""
    folders = {path.parent for path in SOURCES} - {ROOT / "services/ros1/command-line"}
    assert [str(each) for each in sorted(folders) if not (each / "__init__.py").is_file()] == []


def test_nothing_is_left_for_later() -> None:
    assert [
        str(path) for path in project_files(".py", ".md", ".toml", ".sh") if LEFTOVER.search(path.read_text())
    ] == []


def touches_messagepack(source: str) -> bool:
    """Whether a module imports ``msgpack``, or uses ``msgspec.msgpack`` in any way."""
    if "msgpack" not in source:
        return False
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Attribute(value=ast.Name(id="msgspec"), attr="msgpack"):
                return True
            case ast.Import(names=names) if any(re.match(r"msgpack\b|msgspec\.msgpack\b", n.name) for n in names):
                return True
            case ast.ImportFrom(module=str(module)) if re.match(r"msgpack\b|msgspec\.msgpack\b", module):
                return True
            case ast.ImportFrom(module="msgspec", names=names) if any(n.name == "msgpack" for n in names):
                return True
    return False


def test_the_codec_alone_knows_messagepack() -> None:
    found = [name for name, path in zip(NAMES, SOURCES, strict=True) if touches_messagepack(path.read_text())]
    assert found == ["messages/base.py"]


@pytest.mark.parametrize(
    "planted",
    [
        "import msgspec\n\nread = msgspec.msgpack.decode\n",
        "def later():\n    import msgspec.msgpack\n",
        "from msgspec import Meta, msgpack\n",
        "from msgspec.msgpack import Decoder\n",
        "import msgpack\n",
    ],
)
def test_planted_messagepack_is_found(planted: str) -> None:
    assert touches_messagepack(planted)
    assert not touches_messagepack("import msgspec\nfrom msgspec import Meta\nread = msgspec.json.decode\n")
