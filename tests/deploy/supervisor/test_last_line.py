"""The last message of a process that ended by itself, as shown on the terminal."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.supervisor.log_file import MAX_LINE_LENGTH, append_note, last_line

ERROR = """Traceback (most recent call last):
  File "drive.py", line 3, in <module>
    gain = gains["gain"]
           ~~~~~^^^^^^^^
KeyError: 'gain'
"""
CAUGHT = ERROR.replace("<module>", "scan")


@pytest.mark.parametrize(
    ("written", "words"),
    [
        ("", ""),
        ("one\nparams: no file\n\n", "params: no file"),
        ("half a line", "half a line"),
        ("\n--- a ready\n", ""),
        ("\xff\xfe bytes\n", "\xff\xfe bytes"),
        (f"{ERROR}[INFO] [3.000000]: the robot stops\n\n", "KeyError: 'gain'"),
        (f"ValueError: one\n\nDuring handling, another one occurred:\n\n{ERROR}done\n", "KeyError: 'gain'"),
        (f"[ERROR] [3.000000]: bad callback: <function scan>\n{CAUGHT}no wall\n", "no wall"),
        (f"{ERROR}--- a backing off: exit status 1\nno wall\n", "no wall"),
        ("x" * (2 * MAX_LINE_LENGTH), "x" * MAX_LINE_LENGTH),
    ],
)
def test_its_last_line_counts_and_the_supervisor_s_own_do_not(tmp_path: Path, written: str, words: str) -> None:
    log = tmp_path / "a.log"
    assert last_line(log) == ""
    log.write_text(written)
    assert last_line(log) == words
    append_note(log, "a failed: exit status 2")
    assert last_line(log) == words
    assert log.read_text().splitlines()[-1] == "--- a failed: exit status 2"
