"""The options of a script's process before its file, and the script's own after it."""

from __future__ import annotations

from pathlib import Path

import pytest

from services.runtime.main import parse_options
from services.script.command_line import _COMMAND


def test_options_after_the_file_are_the_script_s(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "drive.py"
    file.touch()

    def parse(*words: str) -> dict[str, object]:
        monkeypatch.setattr("sys.argv", ["script", *words])
        return parse_options("script", _COMMAND, list(words), "script")

    options = parse("--wall-time", str(file), "--lockstep")
    assert (options["args"], options["lockstep"], options["wall_time"]) == (("--lockstep",), False, True)
    assert parse("--lockstep", str(file))["name"] == "drive"
    with pytest.raises(SystemExit):
        parse("--wall-time", "--lockstep", str(file))
    assert "--wall-time and --lockstep exclude each other" in capsys.readouterr().err
