"""Standard output that its reader may close at any time, as ``head`` does; the command then ends quietly."""

from __future__ import annotations

import os
import re
import select
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn

_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Characters that move the cursor, set a terminal's title, write its clipboard or change its text direction."""


def printable(text: str) -> str:
    """Escape the control characters in text from the network, a bag or a log.

    Line breaks and tabs stay.
    """
    return _CONTROL.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def write_text(text: str, *, flush: bool = False) -> None:
    """Write text with its control characters escaped."""
    with _exit_on_output_errors():
        sys.stdout.write(printable(text))
        if flush:
            sys.stdout.flush()


def write_json(value: Any, *, lines: bool = False) -> None:
    """Write a JSON document; with ``lines`` on one line and flushed. NaN and infinities become null, bytes base64."""
    import msgspec

    written = msgspec.json.encode(value)
    write_text((written if lines else msgspec.json.format(written, indent=2)).decode() + "\n", flush=lines)


def format_table(rows: Iterable[Sequence[str]]) -> str:
    """Return rows as lines with aligned columns."""
    table = [tuple(row) for row in rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in table
    )


def write_listing(about: Mapping[str, str], as_json: bool) -> None:
    """Write names with a line about each, as a table or as JSON."""
    if as_json:
        write_json([{"name": name, "about": text} for name, text in about.items()])
        return
    width = max(map(len, about))
    write_text("".join(f"{name:<{width}}  {text}\n" for name, text in about.items()))


def write_note(text: str) -> None:
    """Write a note besides the output, on standard error."""
    sys.stderr.write(printable(f"elea: {text}\n"))
    sys.stderr.flush()


def is_pipe_closed() -> bool:
    """Return whether the reader of standard output has closed the pipe."""
    if sys.stdout.closed:
        return True
    poll = select.poll()
    poll.register(sys.stdout.fileno(), 0)
    return any(event & (select.POLLERR | select.POLLNVAL) for _, event in poll.poll(0))


def exit_quietly(status: int = 0) -> NoReturn:
    """Exit after the reader closed the pipe, without an error."""
    discard_output()
    raise SystemExit(status)


def discard_output() -> None:
    """Discard further output, so that flushing the buffers cannot fail."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def ignore_output_errors() -> Iterator[None]:
    """Ignore a closed pipe or a full disk for output besides the real work: it does not change the exit status."""
    try:
        yield
    except OSError:
        discard_output()


@contextmanager
def _exit_on_output_errors() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:
        exit_quietly()
    except OSError as error:
        write_note(f"the output cannot be written: {error.strerror}")
        exit_quietly(1)
