"""``elea panel``: open the web page of a running fleet, serving one if it has none."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from deploy.commands.options import fleet_option, json_option
from services.runtime.errors import EleaError
from services.runtime.fleet_instances import FleetInstance, running_fleets
from services.runtime.network_address import resolve_address, select_fleet
from services.runtime.process import PARENT, ROOT

if TYPE_CHECKING:
    from services.panel.address import Address
    from services.runtime.network_address import NetworkAddress

_START_TIMEOUT_S = 15.0
"""Wall time for a panel to serve its page."""

_POLL_PERIOD_S = 0.5


@click.command("panel")
@click.option(
    "--page-port", type=click.IntRange(0, 65535), help="Port of a page that this command serves; 8600 by default."
)
@click.option("--no-open", is_flag=True, help="Only print the address; do not open a browser.")
@click.option("--connect", metavar="ENDPOINT", default="", help="Router to join; the running fleet's by default.")
@click.option("--domain", default="", help="Domain of the fleet.")
@fleet_option
@json_option
def command(page_port: int | None, no_open: bool, connect: str, domain: str, port: int | None, as_json: bool) -> None:
    """Print the address of the running fleet's web page, and open it if there is a display.

    A fleet without a panel gets one, served by this command until the fleet stops or Ctrl-C. The address contains a
    token: anyone who has it can drive the robots.
    """
    fleet = select_fleet(port) if not connect and running_fleets() else None
    if fleet is not None and (address := _page_of_fleet(fleet)) is not None:
        _print_address(address, as_json, no_open)
        return
    raise SystemExit(_serve_page(resolve_address(connect, domain, port), page_port, as_json, no_open, fleet))


def _page_of_fleet(fleet: FleetInstance) -> Address | None:
    """Return the page of a fleet with a running panel."""
    from services.panel.address import ADDRESS_FILE, read_address
    from services.runtime.ports import port_in_use

    address = read_address(Path(fleet.folder) / ADDRESS_FILE)
    if address is None or not Path(f"/proc/{address.pid}").exists():
        return None
    return address if port_in_use(address.port, 2.0) else None


def _serve_page(
    network: NetworkAddress, page_port: int | None, as_json: bool, no_open: bool, fleet: FleetInstance | None
) -> int:
    """Run a panel until it or its fleet stops; return its exit status."""
    from services.panel.address import read_address
    from services.runtime.light_node import open_transport

    with open_transport(network.router, network.domain):
        pass  # checks that there is a router
    with tempfile.TemporaryDirectory(prefix="elea-panel-") as folder:
        file = Path(folder) / "panel.json"
        arguments = [*network.arguments, "--param", f"address={file}"]
        arguments += ["--param", f"port={page_port}"] if page_port is not None else []
        child = subprocess.Popen(
            [sys.executable, "-P", "-m", "services", "panel", *arguments],
            env={**os.environ, "PYTHONPATH": str(ROOT), PARENT: str(os.getpid())},
        )
        try:
            deadline = time.monotonic() + _START_TIMEOUT_S
            while (address := read_address(file)) is None:
                if child.poll() is not None:
                    raise EleaError("the panel exited before it served its page: see its messages above")
                if time.monotonic() > deadline:
                    raise EleaError(f"the panel did not open its page within {_START_TIMEOUT_S:g} s")
                time.sleep(0.05)
            _print_address(address, as_json, no_open)
            until = "the fleet ends, or Ctrl-C" if fleet is not None else "Ctrl-C"
            sys.stderr.write(f"this fleet runs no panel: this command serves the page until {until}\n")
            while child.poll() is None:
                if fleet is not None and fleet not in running_fleets():
                    sys.stderr.write(f"{fleet.fleet} has ended, and its page with it\n")
                    child.send_signal(signal.SIGINT)
                    return child.wait(_START_TIMEOUT_S)
                time.sleep(_POLL_PERIOD_S)
            return child.returncode
        except KeyboardInterrupt:
            child.send_signal(signal.SIGINT)
            return child.wait(_START_TIMEOUT_S)
        finally:
            if child.poll() is None:
                child.terminate()


def _print_address(address: Address, as_json: bool, no_open: bool) -> None:
    facts = {"url": address.url, "port": address.port, "pid": address.pid}
    sys.stdout.write(json.dumps(facts) + "\n" if as_json else f"{address.url}\n")
    sys.stdout.flush()
    if not (no_open or as_json) and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        import webbrowser

        from services.panel.address import one_time_url

        try:
            webbrowser.open(one_time_url(address))  # not the token: other users can see the browser's command line
        except OSError as error:
            sys.stderr.write(f"elea: no browser was opened ({error}): open the address above\n")
