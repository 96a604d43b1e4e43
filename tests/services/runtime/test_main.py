"""``main`` called without what a service needs: it says what, with an example."""

from __future__ import annotations

from typing import Any

import pytest

from services.runtime.main import main
from tests.harness.cases import case

MISTAKES: dict[str, tuple[Any, dict[str, Any]]] = {
    "main needs the service's name and about": (print, {}),
    "main needs the service's about": (print, {"name": "a"}),
    "main does not know 'rat'; did you mean 'rate'?": (print, {"name": "a", "about": "b", "rat": 25}),
    "main takes a Service or a loop run(ctx), not 'run'": ("run", {"name": "a", "about": "b"}),
}


def test_a_wrong_declaration_is_told_with_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    for fault, (loop, declaration) in MISTAKES.items():
        with case(fault), pytest.raises(SystemExit) as ended:
            main(loop, **declaration)
        assert ended.value.code == 2
        told = capsys.readouterr().err
        assert fault in told
        assert 'main(run, name="my_robot", about="Drives a square.", rate=25)' in told
