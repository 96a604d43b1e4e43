"""``down`` ends a fleet with a report even if its processes were stopped, hung or restarted before."""

from __future__ import annotations

from pathlib import Path

import pytest

from messages.base import encode
from messages.names import key
from messages.requests import SUPERVISOR_START, SUPERVISOR_STOP, Name
from services.runtime.light_node import open_transport
from services.runtime.requests import call
from services.runtime.transport.unix_sockets import router_endpoint
from tests.deploy.supervisor.supervisor_harness import has_ended
from tests.deploy.test_run import FleetCommandLine
from tests.harness.stopping import stop_process
from tests.harness.waiting import wait_until

pytestmark = pytest.mark.waits

HUNG = """
import signal, time
from services.runtime import Service, main


def run(ctx):
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    for tick in ctx.ticks():
        if tick.time:
            time.sleep(1000)


main(Service(name="hung", about="Hangs at its second tick and hears no signal.", run=run, rate=10))
"""


def test_down_after_a_stopped_process_a_hung_one_and_two_starts_at_once(tmp_path: Path) -> None:
    terminal = FleetCommandLine(tmp_path)
    (tmp_path / "hung.py").write_text(HUNG)
    fleet = Path(terminal.fleet("real", "never", ""))
    fleet.write_text(fleet.read_text() + '[[service]]\nkind = "hung.py"\n')
    up = terminal.start("up", str(fleet), "--report", str(terminal.results), "--no-view", "--no-picture", "--no-saved")
    try:
        wait_until(lambda: (tmp_path / "results" / "processes.json").exists(), 60, "a run")
        names = ("router", "sim", "params", "grader", "r/waypoint")

        def all_ready() -> bool:
            shown = terminal.processes()
            return all(shown[each]["state"] == "ready" for each in names)

        wait_until(all_ready, 60, "all processes", every=0.1)
        pids = {name: each["pid"] for name, each in terminal.processes().items()}
        with open_transport(router_endpoint(terminal.port)) as transport:
            call(transport, SUPERVISOR_STOP, key(SUPERVISOR_STOP.name), Name(name="r/waypoint"), 60.0)
            wait_until(lambda: has_ended(pids["r/waypoint"]))
            wait_until(lambda: terminal.processes()["r/waypoint"]["state"] == "stopped", 30, every=0.1)
            asked = key(SUPERVISOR_START.name)
            both = [transport.query_async(asked, encode(Name(name="r/waypoint")), 60.0) for _ in range(2)]
            wait_until(lambda: all(each.poll() is not None for each in both), 60)
        terminal.wait_until_ready("r/waypoint", 0)
        hung = terminal.processes()["hung"]["pid"]
        stop_process(terminal.processes()["sim"]["pid"])
        down = terminal.start("down")
        out, err = down.communicate(timeout=90)
        assert (down.returncode, out) == (0, f"one has stopped; results in {terminal.results}\n"), err
        assert "killing its supervisor" not in err
        assert up.wait(60) in (0, 1)
        assert terminal.report()["run"]["ended"] == "stopped"
        assert [pid for pid in (*pids.values(), hung) if pid and not has_ended(pid)] == []
    finally:
        terminal.start("down").communicate(timeout=90)
        up.communicate(timeout=90)


def test_down_says_that_the_report_is_missing(tmp_path: Path) -> None:
    """The grader can't write its measurements, as on a full disk."""
    terminal = FleetCommandLine(tmp_path)
    terminal.run("up", terminal.fleet("real", "never", ""), "--detach", "--no-saved", "--report", str(terminal.results))
    (terminal.results / "measurements.json").mkdir()
    down = terminal.start("down")
    out, err = down.communicate(timeout=90)
    assert (down.returncode, out) == (1, f"one has stopped; results in {terminal.results}\n")
    assert "elea: no report: " in err
    assert "measurements.json" in err
