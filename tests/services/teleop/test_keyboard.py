"""The terminal as a source of keys, in this process, on a pseudo-terminal."""

from __future__ import annotations

import os
import pty
import select
import termios
import threading
import time
from collections.abc import Iterator

import pytest

from services.runtime.errors import BadInput, Stopped
from services.teleop.terminal import STALL_S, Terminal, require_terminal
from tests.harness.waiting import wait_until


@pytest.fixture
def pseudo_terminal() -> Iterator[tuple[int, int]]:
    """The user's and the program's ends of a pseudo-terminal."""
    master, slave = pty.openpty()
    yield master, slave
    for each in (master, slave):
        try:
            os.close(each)
        except OSError:
            assert each == master, "the test closes the person's end alone"


def test_keys_come_one_by_one_without_echo_and_what_was_typed_before_is_dropped(
    pseudo_terminal: tuple[int, int],
) -> None:
    master, slave = pseudo_terminal
    os.write(master, b"iii")
    # The echo shows that the terminal has received it.
    assert b"".join(os.read(master, 1) for _ in range(3)) == b"iii"
    with Terminal(slave) as keyboard:
        assert keyboard.read_events(0.0) == []
        os.write(master, b"j\x1a")
        assert [each.key for each in keyboard.read_events(5.0)] == ["j", "other"]
        os.set_blocking(master, False)
        with pytest.raises(BlockingIOError):
            os.read(master, 100)


def test_the_terminal_and_the_hook_are_given_back_whatever_happens(pseudo_terminal: tuple[int, int]) -> None:
    _, slave = pseudo_terminal
    before, hook = termios.tcgetattr(slave), threading.excepthook
    try:
        with Terminal(slave):
            assert termios.tcgetattr(slave) != before
            assert threading.excepthook is not hook
            raise RuntimeError
    except RuntimeError:
        pass
    assert termios.tcgetattr(slave) == before
    assert threading.excepthook is hook


def test_a_terminal_that_is_gone_ends_the_loop_and_is_left_without_an_error(pseudo_terminal: tuple[int, int]) -> None:
    master, slave = pseudo_terminal
    with Terminal(slave) as keyboard:
        os.close(master)
        with pytest.raises(Stopped, match="the terminal"):
            keyboard.read_events(5.0)


def test_keys_that_were_read_late_say_so(pseudo_terminal: tuple[int, int]) -> None:
    master, slave = pseudo_terminal
    with Terminal(slave) as keyboard:
        before = time.monotonic()
        keyboard.read_events(0.0)
        since = time.monotonic()
        wait_until(lambda: time.monotonic() > since + 2 * STALL_S)
        os.write(master, b"i")
        wait_until(lambda: select.select([slave], [], [], 0)[0], what="the key at the terminal's other end")
        (press,) = keyboard.read_events(0.02)
        assert 2 * STALL_S < press.stall <= press.time - before


def test_what_is_no_terminal_is_refused_with_what_to_do() -> None:
    read, write = os.pipe()
    try:
        with pytest.raises(BadInput, match=r"standard input is not a terminal.*--keys 'i@0.5-2'"):
            require_terminal(read)
    finally:
        os.close(read)
        os.close(write)
