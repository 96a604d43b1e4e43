"""Time limits for the answers of a parameter service whose thread may be late: they only end what hangs."""

from __future__ import annotations

import pytest

ANSWER_S = 60.0


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("client.START_S", "client.ANSWER_S", "subscription.CHANGE_S"):
        monkeypatch.setattr(f"services.runtime.parameters.{name}", ANSWER_S)
