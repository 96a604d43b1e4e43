"""A run's output and files: full and hanging disks, closed pipes, planted links, control characters."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from deploy.detach import start_detached
from deploy.live.output import printable, write_text
from deploy.run_folder import MIN_FREE_BYTES, make_run_folder
from deploy.supervisor.log_file import MAX_QUEUED_CHUNKS, MAX_SHOWN_LINES, start_log_writer
from services.grader.results import write_atomic
from services.runtime.errors import BadInput
from services.runtime.graph import Entity
from tests.deploy.test_run import FleetCommandLine
from tests.harness.waiting import wait_until

SUPERVISOR = """
import sys, time
from pathlib import Path
from deploy.run_folder import write_state
from messages.elea import FleetState, ProcessState

states = (("router", "ready"), ("brief", "finished"), ("optional", "failed"))
processes = tuple(ProcessState(name=name, state=state) for name, state in states)
write_state(Path(sys.argv[-1]), FleetState(fleet="one", mode="real", processes=processes))
time.sleep(60)
raise SystemExit(1)
"""

ESCAPES = ("\x1b]52;c;cm0gLXJm\x07", "\x1b[2J", "\x9b2J", "\u202eevil", "\x00", "\x7f", "\u2028")


def test_closed_pipe_ends_no_run_and_does_not_change_its_status(tmp_path: Path) -> None:
    terminal = FleetCommandLine(tmp_path)
    fleet = terminal.fleet("lockstep", "goals", "[0.1, 0]")
    command = [sys.executable, "-P", "-m", "deploy", "up", fleet, "--no-saved", "--no-picture"]
    command += ["--report", str(terminal.results)]
    out, into = os.pipe()
    up = subprocess.Popen(command, env=terminal.environment, cwd=tmp_path, stdout=into, stderr=into)
    os.close(into)
    try:
        assert os.read(out, 1)  # it has written; then the reader closes the pipe
    finally:
        os.close(out)
    assert up.wait(300) == 0
    assert terminal.report()["ok"] is True


def test_verbs_whose_reader_is_gone_end_quietly(tmp_path: Path) -> None:
    for arguments, status in ((["--help"], 0), (["ps"], 0), (["down"], 2)):
        out, into = os.pipe()
        os.close(out)
        command = [sys.executable, "-P", "-m", "deploy", *arguments]
        environment = FleetCommandLine(tmp_path).environment
        assert subprocess.run(command, env=environment, stdout=into, stderr=into, timeout=60).returncode == status
        os.close(into)


def test_full_disk_is_told_before_a_run_in_the_background(tmp_path: Path) -> None:
    def full() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))

    terminal = FleetCommandLine(tmp_path)
    command = [sys.executable, "-P", "-m", "deploy", "up", terminal.fleet("real", "never", ""), "--detach"]
    command += ["--report", str(terminal.results)]
    done = subprocess.run(
        command, env=terminal.environment, preexec_fn=full, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2
    assert f"the folder {terminal.results} cannot be written: File too large" in done.stderr
    assert "--report" in done.stderr


@pytest.mark.process
def test_supervisor_that_ends_without_a_word_is_told_of(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mute.py").write_text("raise SystemExit(1)\n")
    folder = tmp_path / "run"
    assert start_detached("one", str(folder), as_json=False, argv=["run", str(tmp_path / "mute.py")]) == 1
    said = f"the supervisor ended with exit status 1 and has written nothing to {folder / 'supervisor.log'}"
    assert said in capfd.readouterr().err


@pytest.mark.process
def test_fleet_in_the_background_has_started_though_a_process_has_done_its_work(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "supervisor.py").write_text(SUPERVISOR)
    argv = ["run", str(tmp_path / "supervisor.py")]
    assert start_detached("one", str(tmp_path / "run"), as_json=True, argv=argv) == 0
    os.kill(json.loads(capfd.readouterr().out)["pid"], signal.SIGKILL)


def test_hanging_disk_blocks_nobody_who_logs(tmp_path: Path) -> None:
    log = tmp_path / "a.log"
    os.mkfifo(log)  # open() blocks until there is a reader, as on an unreachable network drive
    out, into = os.pipe()
    writer = start_log_writer(out, log, largest=1 << 40)
    line, lines = b"x" * 1023 + b"\n", 3 * MAX_QUEUED_CHUNKS * 64
    with os.fdopen(into, "wb") as end:
        for _ in range(lines):
            end.write(line)
    reader = os.open(log, os.O_RDWR | os.O_NONBLOCK)  # open for writing too: then no end of file between two writers
    came = bytearray()

    def drained() -> bool:
        ended = not writer.is_alive()
        with suppress(BlockingIOError):
            while chunk := os.read(reader, 1 << 20):
                came.extend(chunk)
        return ended

    wait_until(drained, 60, "the disk is back, and all that was kept is written")
    os.close(reader)
    told = [int(each.split()[1]) for each in bytes(came).split(b"\n") if b"were dropped" in each]
    assert sum(told) == lines - came.count(line) > 0
    assert sum(told) >= lines // 3


def test_planted_links_lead_nowhere(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.mkdir()
    precious = victim / "precious.log"
    precious.write_text("mine")
    for name in ("logs", "bag"):
        folder = tmp_path / f"planted-{name}"
        folder.mkdir()
        (folder / name).symlink_to(victim)
        with pytest.raises(BadInput, match=f"{name} is a symbolic link"):
            make_run_folder("lab", str(folder))
    folder = make_run_folder("lab", str(tmp_path / "run"))
    for link in (folder / f".report.json.{os.getpid()}", folder / "logs" / "a.log", folder / "report.json"):
        link.symlink_to(precious)
    write_atomic(folder / "report.json", b"{}")
    assert json.loads((folder / "report.json").read_text()) == {}
    out, into = os.pipe()
    writer = start_log_writer(out, folder / "logs" / "a.log")
    os.write(into, b"hello\n")
    os.close(into)
    wait_until(lambda: not writer.is_alive())
    assert precious.read_text() == "mine"
    assert not list(folder.glob("tmp*"))
    assert sum(each.stat().st_size for each in folder.rglob("*") if each.is_file()) < MIN_FREE_BYTES


def test_lines_of_a_process_are_shown_whole_and_not_without_end(tmp_path: Path) -> None:
    out, into = os.pipe()
    shown: list[str] = []
    writer = start_log_writer(out, tmp_path / "a.log", show=shown.append)
    os.write(into, b"one\ntw")
    wait_until(lambda: shown == ["one"])
    os.write(into, b"o \xff\n" + b"many\n" * (MAX_SHOWN_LINES + 9))
    os.close(into)
    wait_until(lambda: not writer.is_alive())
    assert shown[:3] == ["one", "two \ufffd", "many"]
    assert len(shown) <= 2 * MAX_SHOWN_LINES
    assert shown[-1] == "(10 lines more in the log)"
    assert (tmp_path / "a.log").read_bytes().count(b"many") == MAX_SHOWN_LINES + 9


def test_a_token_with_a_control_character_is_none() -> None:
    good = Entity("1f", "pub", "/a", "/b", "pkg/Type", "SENSOR")
    assert Entity.parse(good.key) == good
    for text in ESCAPES:
        for kind, first in (("pub", 3), ("node", 4)):
            chunks = good.key.replace("pub", kind).split("/")
            for at in range(first, len(chunks)):
                assert Entity.parse("/".join([*chunks[:at], chunks[at] + text, *chunks[at + 1 :]])) is None


def test_what_is_printed_shows_control_characters(capsys: pytest.CaptureFixture[str]) -> None:
    for text in ESCAPES:
        write_text(f"name {text}\ta\u00e4\u4e2d\n")
        out = capsys.readouterr().out
        assert out == printable(out) == f"name {printable(text)}\ta\u00e4\u4e2d\n"
        assert all(each.isprintable() for each in out.strip("\n").replace("\t", ""))
        assert "\\u" in out
