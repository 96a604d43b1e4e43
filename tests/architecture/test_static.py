"""Types and style hold on this tree; the settings are strict enough to refuse what they should."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from services.runtime.process import ROOT
from tests.harness.project_files import PACKAGES


def run(*arguments: str, at: Path = ROOT) -> tuple[int, str]:
    """Exit status and output of a module run in ``at``."""
    ran = subprocess.run(
        [sys.executable, "-m", *arguments], cwd=at, capture_output=True, text=True, timeout=280, check=False
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


@pytest.mark.timeout(300)
def test_types_hold() -> None:
    status, said = run("mypy")
    assert status == 0, said


def test_style_holds() -> None:
    status, said = run("ruff", "check", ".")
    assert status == 0, said


def test_format_holds() -> None:
    status, said = run("ruff", "format", "--check", ".")
    assert status == 0, said


@pytest.mark.parametrize(
    ("code", "complaint"),
    [
        ("def twice(x):\n    return 2 * x\n", "no-untyped-def"),
        ('def twice(x: int) -> int:\n    return "2"\n', "return-value"),
        ("def first(each: list) -> None: ...\n", "type-arg"),
    ],
)
def test_a_planted_type_error_is_found(project: Path, code: str, complaint: str) -> None:
    (project / "services" / "planted.py").write_text(f'"""Planted."""\n\n\n{code}')
    status, said = run("mypy", "--cache-dir", str(ROOT / ".mypy_cache" / "planted"), at=project)
    assert status == 1
    assert complaint in said


@pytest.mark.parametrize(
    ("code", "complaint"),
    [
        ('"""Planted."""\n\nimport os\n', "F401"),
        ("x = 1\n", "D100"),
        ('"""Planted."""\n\ntry:\n    x = 1\nexcept Exception:\n    pass\n', "BLE001"),
    ],
)
def test_a_planted_lapse_of_style_is_found(project: Path, code: str, complaint: str) -> None:
    (project / "deploy" / "planted.py").write_text(code)
    status, said = run("ruff", "check", ".", at=project)
    assert status == 1
    assert complaint in said


def test_planted_formatting_is_found(project: Path) -> None:
    (project / "deploy" / "planted.py").write_text("x = {'a':1}\n")
    assert run("ruff", "format", "--check", ".", at=project)[0] == 1
