"""Types and style are clean in this tree; the settings are strict enough to reject violations."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.commands.check import LINT_STEPS
from services.runtime.process import ROOT
from tests.harness.cases import case
from tests.harness.project_files import PACKAGES


def run(*arguments: str, at: Path = ROOT) -> tuple[int, str]:
    """Run Python with these arguments in ``at``; return exit status and output."""
    ran = subprocess.run(
        [sys.executable, "-P", *arguments],
        cwd=at,
        env={**os.environ, "PYTHONPATH": str(at)},
        capture_output=True,
        text=True,
        timeout=380,
        check=False,
    )
    return ran.returncode, ran.stdout + ran.stderr


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Four empty packages under this project's settings."""
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for package in PACKAGES:
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text('"""Empty."""\n')
    return tmp_path


def test_every_step_of_check_holds() -> None:
    for name, arguments in LINT_STEPS.items():
        with case(name):
            status, output = run(*arguments)
            assert status == 0, output


def test_planted_type_errors_are_found(project: Path) -> None:
    planted = {
        "no-untyped-def": "def twice(x):\n    return 2 * x\n",
        "return-value": 'def twice(x: int) -> int:\n    return "2"\n',
        "type-arg": "def first(each: list) -> None: ...\n",
    }
    for number, code in enumerate(planted.values()):
        (project / "services" / f"planted{number}.py").write_text(f'"""Planted."""\n\n\n{code}')
    status, output = run("-m", "mypy", "--cache-dir", str(ROOT / ".mypy_cache" / "planted"), at=project)
    assert status == 1
    for number, complaint in enumerate(planted):
        assert re.search(rf"planted{number}\.py.*\[{complaint}\]", output), complaint


def test_planted_lapses_of_style_are_found(project: Path) -> None:
    planted = {
        "F401": '"""Planted."""\n\nimport os\n',
        "D100": "x = 1\n",
        "BLE001": '"""Planted."""\n\ntry:\n    x = 1\nexcept Exception:\n    pass\n',
    }
    for number, code in enumerate(planted.values()):
        (project / "deploy" / f"planted{number}.py").write_text(code)
    status, output = run("-m", "ruff", "check", "--output-format", "concise", ".", at=project)
    assert status == 1
    for number, complaint in enumerate(planted):
        assert re.search(rf"planted{number}\.py.*{complaint}", output), complaint


def test_planted_formatting_is_found(project: Path) -> None:
    (project / "deploy" / "planted.py").write_text("x = {'a':1}\n")
    assert run("-m", "ruff", "format", "--check", ".", at=project)[0] == 1
