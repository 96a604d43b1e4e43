"""The progress of a fleet on stderr: a live line on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from deploy.live.output import printable
from deploy.run_folder import write_state
from deploy.supervisor.log_file import last_line, log_name
from deploy.supervisor.managed_process import ManagedProcess
from messages.elea import FleetState, ProcessState
from services.panel.address import ADDRESS_FILE, read_address
from services.runtime.errors import list_names

PLAIN_PERIOD_S = 10.0
"""Wall time [s] between two lines about a healthy fleet, where no live line can be shown."""

WAITING_PERIOD_S = 5.0
"""Wall time [s] between two lines about the nodes that simulation time waits for."""

_PROBLEM_STATES = ("backing off", "failed")


FEW_PROCESSES = 16
"""Maximum number of processes for which a line reports each that is ready; with more, only the live
line counts them.
"""

NAMED = 5
"""Maximum number of processes named in the live line."""


class ProgressDisplay(Protocol):
    """An output for progress."""

    def print_line(self, line: str) -> None:
        """Print a permanent line."""
        ...

    def set_status(self, line: str) -> None:
        """Show the current status."""
        ...


class PlainDisplay:
    """Prints lines on stderr; a changed status is printed at most every PLAIN_PERIOD_S."""

    def __init__(self) -> None:
        self._shown, self._next = "", time.monotonic() + PLAIN_PERIOD_S

    def print_line(self, line: str) -> None:
        sys.stderr.write(printable(f"{line}\n"))
        sys.stderr.flush()

    def set_status(self, line: str) -> None:
        if line != self._shown and time.monotonic() > self._next:
            self._shown, self._next = line, time.monotonic() + PLAIN_PERIOD_S
            self.print_line(line)


@contextmanager
def open_display() -> Iterator[ProgressDisplay]:
    """Open the display that stderr supports."""
    if not sys.stderr.isatty():
        yield PlainDisplay()
        return
    from rich.console import Console

    console = Console(stderr=True, highlight=False)
    with console.status("starting") as status:

        class LiveDisplay:
            def print_line(self, line: str) -> None:
                console.print(printable(line), markup=False)

            def set_status(self, line: str) -> None:
                status.update(line)

        yield LiveDisplay()


def waiting_line(names: Sequence[str], processes: int) -> str:
    """Return what a fleet waits for, in one line; for many processes, the number ready and the names of some."""
    if processes <= FEW_PROCESSES:
        return f"waiting for {', '.join(names)}"
    return f"{processes - len(names)} of {processes} processes ready, waiting for {list_names(names, NAMED)}"


class ProgressReporter:
    """Shows the state of the fleet on a display and writes it to the run's folder; ``news`` returns lines to print."""

    def __init__(self, screen: ProgressDisplay, folder: Path, news: Callable[[], Iterable[str]] = tuple) -> None:
        self._screen, self._folder, self._news = screen, folder, news
        self._started = time.monotonic()
        self._complete = False
        self._next_wait = self._started + WAITING_PERIOD_S
        self._quoted: set[str] = set()
        self._starved: set[str] = set()

    def on_state_change(self, process: ManagedProcess, fleet: FleetState) -> None:
        """Report a process's change of state."""
        write_state(self._folder, fleet)
        shown = process.state_message()
        if process.state in _PROBLEM_STATES:
            self._report_problem(process, shown)
        if (
            process.spec.kind == "panel"
            and process.state == "ready"
            and (page := read_address(self._folder / ADDRESS_FILE))
        ):
            self._screen.print_line(f"web page of this fleet: {page.url}")
        ready = sum(each.state == "ready" for each in fleet.processes)
        finished = sum(each.state == "finished" for each in fleet.processes)
        if ready + finished == len(fleet.processes) and not self._complete:
            self._complete = True
            how = "ready or finished" if finished else "ready"
            seconds = time.monotonic() - self._started
            self._screen.print_line(f"all {len(fleet.processes)} processes {how} after {seconds:.1f} s")
        elif not self._complete and process.state == "ready" and len(fleet.processes) <= FEW_PROCESSES:
            self._screen.print_line(f"{shown.name} ready ({ready} of {len(fleet.processes)})")

    def _report_problem(self, process: ManagedProcess, shown: ProcessState) -> None:
        """Print a process's problem, and the last line of its log unless it was printed before."""
        name, reason = shown.name, shown.reason
        words = last_line(self._folder / "logs" / log_name(name)) if reason.startswith("exit status") else ""
        if words and words in reason and process.spec.required:
            return  # the end of the fleet reports the same
        nodes_of = f" (the process of {', '.join(shown.nodes)})" if shown.nodes else ""
        self._screen.print_line(f"{name}{nodes_of} {shown.state}: {reason}; see ./elea logs {name}")
        if words and words not in reason and words not in self._quoted:
            self._quoted.add(words)
            self._screen.print_line(f"  {words}")

    def _report_starved(self, processes: Sequence[ManagedProcess]) -> None:
        """Report each process once for which the machine is too busy; several at a time in one line."""
        now = time.monotonic()
        found = [
            (process.spec.name, silent)
            for process in processes
            if (silent := process.starved_for(now)) and process.spec.name not in self._starved
        ]
        if not found:
            return
        self._starved.update(name for name, _ in found)
        names = [name for name, _ in found]
        it = "it is waiting" if len(names) == 1 else "they are waiting"
        self._screen.print_line(
            f"{list_names(names, NAMED)}: no heartbeat for {max(each for _, each in found):.1f} s, {it} for a "
            "processor: this machine is too busy for the fleet"
        )

    def on_note(self, text: str) -> None:
        """Show a problem of the supervision as a whole instead of problems of single processes."""
        self._screen.print_line(text)

    def _report_waiting(self, processes: Sequence[ManagedProcess]) -> None:
        """Print now and then which nodes simulation time waits for."""
        now = time.monotonic()
        for process in processes:
            if process.spec.kind == "sim" and process.activity == "waiting" and process.note and now > self._next_wait:
                self._next_wait = now + WAITING_PERIOD_S
                self._screen.print_line(process.note)

    def on_poll(self, processes: Sequence[ManagedProcess]) -> None:
        """Update the display after a check of heartbeats."""
        for line in self._news():
            self._screen.print_line(line)
        self._report_starved(processes)
        self._report_waiting(processes)
        waiting = [
            process.spec.name for process in processes if process.state in ("waiting", "starting", *_PROBLEM_STATES)
        ]
        notes = [process.note for process in processes if process.spec.kind in ("grader", "sim") and process.note]
        if any(process.state == "stopping" for process in processes):
            self._screen.set_status("stopping")
        elif waiting:
            self._screen.set_status(waiting_line(waiting, len(processes)))
        else:
            self._screen.set_status("; ".join(notes) or "running")
