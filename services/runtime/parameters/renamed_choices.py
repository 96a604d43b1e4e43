"""Renamed choices of parameters: a request with the old name is refused with the new one, a saved value is migrated."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

RENAMED_CHOICES = {"seed": "tutorial"}
"""Old names and what they are called now, for every parameter that has the new choice and not the old one."""


def renamed_choice(value: Any, choices: Collection[str]) -> str | None:
    """Return what ``value`` is called now, if it is the old name of one of ``choices``; else None."""
    if not isinstance(value, str) or value in choices:
        return None
    new = RENAMED_CHOICES.get(value)
    return new if new in choices else None
