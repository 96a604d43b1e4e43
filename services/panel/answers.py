"""Answers and complaints, as pages take them."""

from __future__ import annotations

import msgspec

from services.panel.page import Page


def answer(page: Page, number: int, ok: bool, text: object) -> None:
    """Answer what a page has asked under ``number``."""
    page.stream(msgspec.json.encode({"k": "reply", "id": number, "ok": ok, "is": text}).decode())
    page.flush()


def tell_error(page: Page, reason: str) -> None:
    """Tell a page what was wrong with what it said."""
    page.stream(msgspec.json.encode({"k": "error", "reason": reason[:500]}).decode())
    page.flush()
