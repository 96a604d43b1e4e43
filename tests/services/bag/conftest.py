"""Bags in the tests of this folder are written outside time."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from services.bag import mcap_writer


@pytest.fixture(autouse=True)
def timeless_writer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut chunks by size and on request alone: the wall time of the writer would add cuts on a busy machine."""
    monkeypatch.setattr(mcap_writer, "time", SimpleNamespace(monotonic=lambda: 0.0))
