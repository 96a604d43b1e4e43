"""``main`` where it can't run a service: with a wrong declaration, or in a file that another one imports."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import pytest

from services.runtime.errors import BadInput
from services.runtime.main import main
from services.runtime.service import load_user_service
from tests.harness.cases import case

MISTAKES: dict[str, tuple[Any, dict[str, Any]]] = {
    "main needs the service's name and about": (print, {}),
    "main needs the service's about": (print, {"name": "a"}),
    "main has no argument 'rat'; did you mean 'rate'?": (print, {"name": "a", "about": "b", "rat": 25}),
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


CONTROLLER = """from services.runtime import main


def run(ctx):
    pass


%s
"""
CALL = 'main(run, name="imported", about="-")'


def test_an_import_of_a_controller_starts_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither in a program nor in a fleet, which once took the imported file's service for the importing file's."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "bare_call.py").write_text(CONTROLLER % CALL)
    (tmp_path / "guarded_call.py").write_text(CONTROLLER % f'if __name__ == "__main__":\n    {CALL}')
    told = r"bare_call\.py:8: an import of bare_call would start its service: .* under `if __name__ == \"__main__\":`"
    with pytest.raises(BadInput, match=told):
        importlib.import_module("bare_call")
    assert callable(importlib.import_module("guarded_call").run)
    assert load_user_service(str(tmp_path / "guarded_call.py")).name == "imported"
    importer = tmp_path / "importer.py"
    importer.write_text(
        "from services.runtime import main\nfrom bare_call import run\nmain(run, name='own', about='-')\n"
    )
    with pytest.raises(BadInput, match=r"importer\.py:2: .*bare_call\.py:8: an import of bare_call"):
        load_user_service(str(importer))
