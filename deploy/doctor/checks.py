"""All checks in their order, and their findings as text or JSON."""

from __future__ import annotations

from collections.abc import Sequence

from deploy import VERSION
from deploy.doctor import Check, Finding, fail, fleet, installation, machine, network
from deploy.live.output import write_json, write_text
from services.runtime.errors import BadInput
from services.runtime.network_address import NetworkAddress, resolve_address
from services.runtime.transport.zenoh_config import endpoint


def run_checks(connect: str = "", domain: str = "", port: int | None = None) -> list[Finding]:
    """The findings of all checks."""
    checks: list[Check] = [
        machine.platform_supported,
        machine.python_version,
        installation.version,
        installation.environment,
        installation.packages,
        installation.libraries,
        machine.cores_and_memory,
        machine.clock,
        machine.loopback,
        machine.display,
        machine.vulkan,
        machine.run_folder_writable,
        machine.state_folder_writable,
        fleet.orphans,
        fleet.fleets,
    ]
    findings = [finding for check in checks for finding in check()]
    try:
        place = resolve_address(connect, domain, port)
        place = NetworkAddress(endpoint(place.router), place.domain)
    except BadInput as error:
        return [*findings, fail("network", str(error), "name one, with --port or --connect")]
    asked = bool(connect) or port is not None
    return [*findings, *network.ports(place), *network.access(), *network.router(place, asked)]


def print_findings(findings: Sequence[Finding], as_json: bool) -> None:
    """Print a line for each finding, with the remedy below it, and the counts."""
    if as_json:
        write_json({"version": VERSION, "checks": [each._asdict() for each in findings]})
        return
    width = max(len(each.name) for each in findings)
    for each in findings:
        write_text(f"{each.state:<4}  {each.name:<{width}}  {each.why}\n")
        if each.do:
            write_text(f"{'':<4}  {'':<{width}}  -> {each.do}\n")
    counts = {state: sum(each.state == state for each in findings) for state in ("ok", "warn", "fail")}
    write_text(f"{len(findings)} checks: {counts['ok']} ok, {counts['warn']} warnings, {counts['fail']} failures\n")
