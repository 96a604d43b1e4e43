"""Reads README.md and the pages of docs: sections and code blocks."""

from __future__ import annotations

import re
from pathlib import Path

from services.runtime.process import ROOT

README: Path = ROOT / "README.md"
DOCS: Path = ROOT / "docs"


def section(title: str, text: str | None = None) -> str:
    """Return the text under the heading ``## title``, in README.md by default."""
    found = re.search(
        rf"^## {re.escape(title)}\n(.*?)(?=^## |\Z)", text or README.read_text(), re.MULTILINE | re.DOTALL
    )
    assert found, f"no section {title!r}"
    return found[1]


def blocks(language: str, text: str) -> list[str]:
    """Return the code blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
