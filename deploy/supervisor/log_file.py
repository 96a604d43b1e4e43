"""The log of a process: a file of bounded size; failing writes never block or end the process."""

from __future__ import annotations

import os
import queue
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

MAX_LOG_BYTES = 8 << 20
"""Maximum size of a log file [bytes]; beyond it, the file is renamed to ``.1``, replacing an older one."""

MAX_LINE_LENGTH = 500
"""Maximum length of the last line of a process's log, as reported."""

MAX_QUEUED_CHUNKS = 64
"""Maximum number of queued chunks of at most 64 KiB when the disk does not respond, e.g. a network drive; further
output is dropped, and its lines are counted.
"""
WRITE_TIMEOUT_S = 1.0
"""Wall time to wait for the disk before lines are dropped: no burst is lost on a disk that works."""

MAX_SHOWN_LINES = 100
"""Maximum number of lines of one chunk shown on the screen: a process that prints megabytes does not flood it."""

_CHUNK = 1 << 16
_TRACEBACK = "Traceback (most recent call last):"
NOTE = "--- "
"""Prefix of the supervisor's own lines."""


def log_name(process: str) -> str:
    """Return the file name of a process's log: ``tb3_0/waypoint`` logs to ``tb3_0.waypoint.log``."""
    return f"{process.replace('/', '.')}.log"


ShowLine = Callable[[str], None]
"""Shows a line of a process on the screen."""


def start_log_writer(
    pipe: int, path: Path, largest: int = MAX_LOG_BYTES, show: ShowLine | None = None
) -> threading.Thread:
    """Log the file descriptor ``pipe`` to its end and close it; return a thread that ends with the last write.

    With ``show``, lines are also shown, at most MAX_SHOWN_LINES of a chunk. One thread reads and another writes: a disk
    that hangs does not fill the pipe, which would block the process.
    """
    waiting: queue.Queue[bytes | None] = queue.Queue(MAX_QUEUED_CHUNKS)
    writer = threading.Thread(target=_write, args=(waiting, path, largest, show), name=f"log {path.name}", daemon=True)
    writer.start()
    threading.Thread(target=_read, args=(pipe, waiting), name=f"pipe {path.name}", daemon=True).start()
    return writer


def append_note(path: Path, text: str) -> None:
    """Append a line of the supervisor; a disk that refuses it must not end the fleet."""
    try:
        _append(path, f"{_missing_line_break(path)}{NOTE}{text}\n".encode())
    except OSError:
        return


def _missing_line_break(path: Path) -> str:
    """Return a line break if the last line of a log is incomplete, else nothing."""
    try:
        with path.open("rb") as file:
            file.seek(-1, os.SEEK_END)
            return "" if file.read(1) == b"\n" else "\n"
    except OSError:  # there is no log yet, or it is empty
        return ""


def last_line(path: Path) -> str:
    """Return the process's last message, at most MAX_LINE_LENGTH characters; empty if it wrote nothing.

    That is its last line, or the error that ended it, even if its exit hooks printed something after the traceback.
    """
    try:
        with path.open("rb") as file:
            file.seek(max(0, path.stat().st_size - _CHUNK))
            lines = file.read(_CHUNK).decode(errors="replace").splitlines()
    except OSError:
        return ""
    while lines and (not lines[-1].strip() or lines[-1].startswith(NOTE)):
        lines.pop()
    if not lines:
        return ""
    begin = next((at for at in range(len(lines), 0, -1) if lines[at - 1].startswith(NOTE)), 0)
    return (_error(lines[begin:]) or lines[-1].strip())[:MAX_LINE_LENGTH]


def _error(lines: Sequence[str]) -> str:
    """Return the error of the last traceback of a main program; tracebacks of callbacks and threads end no process."""
    begun = (at for at in range(len(lines) - 2, -1, -1) if lines[at] == _TRACEBACK)
    at = next((at for at in begun if lines[at + 1].endswith(", in <module>")), None)
    return "" if at is None else next((line.strip() for line in lines[at + 1 :] if line[:1].strip()), "")


def _read(pipe: int, waiting: queue.Queue[bytes | None]) -> None:
    dropped = 0
    with os.fdopen(pipe, "rb", buffering=0) as source:
        while chunk := source.read(_CHUNK):
            if dropped and not waiting.full():
                waiting.put(_dropped(dropped))
                dropped = 0
            try:
                waiting.put(chunk, timeout=0.001 if dropped else WRITE_TIMEOUT_S)
            except queue.Full:
                dropped += chunk.count(b"\n")
    if dropped:
        waiting.put(_dropped(dropped))
    waiting.put(None)


def _dropped(lines: int) -> bytes:
    return f"\n{NOTE}{lines} lines were dropped: the disk was too slow\n".encode()


def _write(waiting: queue.Queue[bytes | None], path: Path, largest: int, show: ShowLine | None) -> None:
    """Write the chunks; drop one if the disk is full or gone, since the process must go on."""
    begun = b""
    while (chunk := waiting.get()) is not None:
        if show is not None:
            begun = _show(begun + chunk, show)
        try:
            if path.exists() and path.stat().st_size + len(chunk) > largest:
                path.replace(path.with_name(f"{path.name}.1"))
            _append(path, chunk)
        except OSError:
            continue


def _show(chunk: bytes, show: ShowLine) -> bytes:
    """Show the complete lines of a chunk; return the incomplete rest."""
    *lines, begun = chunk.split(b"\n")
    for line in lines[:MAX_SHOWN_LINES]:
        show(line.decode(errors="replace"))
    if len(lines) > MAX_SHOWN_LINES:
        show(f"({len(lines) - MAX_SHOWN_LINES} lines more in the log)")
    return begun[-_CHUNK:]


def _append(path: Path, chunk: bytes) -> None:
    """Append to a log; never follow a link, since other users may be able to write in the folder of the results."""
    descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW, 0o666)
    with os.fdopen(descriptor, "ab", buffering=0) as file:
        file.write(chunk)
