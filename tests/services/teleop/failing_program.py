"""Reads the terminal, then fails: ``python -m tests.services.teleop.failing_program raise``, or ``thread``."""

from __future__ import annotations

import sys
import threading

from services.runtime.process import die_with_threads
from services.teleop.terminal import Terminal


def fail() -> None:
    raise RuntimeError("on purpose")


die_with_threads()
with Terminal() as keyboard:
    while not keyboard.read_events(0.1):
        pass
    if sys.argv[1] == "raise":
        fail()
    threading.Thread(target=fail).start()
    while True:
        keyboard.read_events(0.1)
