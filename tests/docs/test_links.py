"""The targets of the documents' links exist."""

from __future__ import annotations

import pkgutil
import re
from pathlib import Path

import pytest

from services.runtime.process import ROOT
from tests.harness.project_files import project_files

LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
CODE = re.compile(r"`([^`\n]+)`")
DOTTED = re.compile(r"`((?:deploy|messages|models|services|tests)(?:\.\w+)+)(?:\([^`]*\))?`")
PLACE = re.compile(r"[\w.-]+(?:/[\w.-]+)*/?")
TOP = {path.relative_to(ROOT).parts[0] for path in project_files()}
"""Top-level names of the project itself, without results of runs."""

DOCUMENTS = list(project_files(".md"))


def headings(path: Path) -> set[str]:
    """Return the anchors of a document's headings, as common viewers make them."""
    titles = re.findall(r"^#+ (.+)$", path.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(document: Path) -> None:
    lost = []
    for target in LINK.findall(document.read_text()):
        if target.startswith(("http://", "https://")):
            continue
        place, _, anchor = target.partition("#")
        file = document.parent / place if place else document
        if not file.exists() or (anchor and anchor not in headings(file)):
            lost.append(target)
    assert lost == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_files_that_are_named_exist(document: Path) -> None:
    """A path in backticks that starts with a folder of the project exists."""
    text = re.sub(r"^```.*?^```$", "", document.read_text(), flags=re.MULTILINE | re.DOTALL)
    lost = []
    for name in CODE.findall(text):
        inside = PLACE.fullmatch(name) and "/" in name and name.split("/")[0] in TOP
        if inside and not (ROOT / name).exists() and not (document.parent / name).exists():
            lost.append(name)
    assert lost == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_modules_and_functions_that_are_named_exist(document: Path) -> None:
    """For example, ``models.urdf_path(name)`` in backticks is a function of that module."""
    assert [name for name in DOTTED.findall(document.read_text()) if not can_import(name)] == []


def can_import(name: str) -> bool:
    """Whether a dotted name is a module or an attribute of one."""
    try:
        pkgutil.resolve_name(name)
    except (ImportError, AttributeError):
        return False
    return True


def test_a_lost_name_is_found() -> None:
    assert DOTTED.findall("see `models.urdf_path(name)`, `models.model`, `odom.fresh(0.5)`") == [
        "models.urdf_path",
        "models.model",
    ]
    assert can_import("models.urdf_path")
    assert not can_import("models.urdf_pith")
    assert not can_import("models.modal.read")


def test_the_documents_are_there() -> None:
    for name in ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", "LICENSE"):
        assert (ROOT / name).is_file()
    assert "Apache License" in (ROOT / "LICENSE").read_text()
