"""Well-known nodes that are started by hand: the commands that replace them."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import NoReturn

import pytest

from deploy.launch.run_node import run_known_node


class Replaced(Exception):
    """Raised instead of replacing this process."""


def test_arguments_may_have_spaces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    executed: list[list[str]] = []

    def execve(program: str, arguments: list[str], environment: dict[str, str]) -> NoReturn:
        executed.append(arguments[4:])
        raise Replaced

    monkeypatch.setattr(os, "execve", execve)
    file = tmp_path / "my map.yaml"
    with pytest.raises(Replaced):
        run_known_node("map_server", "map_server", [str(file), "map:=plan"], None)
    with pytest.raises(Replaced):
        run_known_node("tf", "tf_echo", ["map", "base link", "5"], 7447)
    assert executed == [
        ["run", "map_server", "--remap", "map:=plan", "--param", f"map={json.dumps(str(file))}"],
        ["tf", "echo", "--port", "7447", "map", "base link"],
    ]
