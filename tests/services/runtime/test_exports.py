"""The names that ``services.runtime`` exports to controllers: exactly the documented ones."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import messages
import models
import services
from services import runtime
from services.runtime.process import ROOT

HEAVY = (
    "import sys, services.runtime; print(*sorted({'services.runtime.context', 'zenoh', 'numpy'} & set(sys.modules)))"
)


def test_the_list_is_what_the_file_imports_and_each_name_is_there() -> None:
    tree = ast.parse(Path(runtime.__file__).read_text())
    imported = {
        each.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module not in ("typing", "services.runtime")
        for each in node.names
    }
    assert set(runtime.__all__) == imported
    assert [name for name in runtime.__all__ if not hasattr(runtime, name)] == []
    assert runtime.Tick.__module__ == "services.runtime.context"
    assert not hasattr(runtime, "Contxt")


def test_it_loads_nothing_of_the_running_loop() -> None:
    command = [sys.executable, "-c", HEAVY]
    assert subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout == "\n"


def test_the_packages_are_typed() -> None:
    assert all((Path(each.__path__[0]) / "py.typed").is_file() for each in (services, messages, models))
