"""Runs all checks in order, and prints their findings as text or JSON."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from deploy import VERSION
from deploy.doctor import Check, Finding, fail, fleet, installation, machine, network
from deploy.live.output import write_json, write_text
from services.runtime.errors import BadInput
from services.runtime.network_address import NetworkAddress, resolve_address
from services.runtime.transport.zenoh_config import endpoint


def run_checks(connect: str = "", domain: str = "", port: int | None = None) -> list[Finding]:
    """Return the findings of all checks; those of the network listen in the meantime."""
    checks: list[Check] = [
        machine.platform_supported,
        machine.python_version,
        installation.version,
        installation.environment,
        installation.packages,
        installation.libraries,
        machine.physics_engines,
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
    address, unusable = None, ""
    try:
        address = resolve_address(connect, domain, port)
        address = NetworkAddress(endpoint(address.router), address.domain)
    except BadInput as error:
        unusable = str(error)
    asked = bool(connect) or port is not None
    with ThreadPoolExecutor(1) as pool:
        heard = pool.submit(lambda: list(network.router(address, asked)) if address is not None else [])
        findings = [finding for check in checks for finding in check()]
        if address is None:
            return [*findings, fail("network", unusable, "name one, with --port or --connect")]
        return [*findings, *network.ports(address), *network.access(), *merge_alike(heard.result())]


def merge_alike(findings: Sequence[Finding]) -> list[Finding]:
    """Merge findings that are the same for more than MOST_ALIKE nodes into one that names these."""
    alike: dict[Finding, list[str]] = {}
    for each in findings:
        kind, _, name = each.name.partition(" ")
        alike.setdefault(each._replace(name=kind if name else each.name), []).append(name)
    merged, most = [], network.MOST_ALIKE
    for each, names in alike.items():
        if len(names) > most:
            listed = ", ".join(names[:most])
            merged.append(
                each._replace(
                    name=f"{len(names)} {each.name}s", why=f"{each.why}: {listed} and {len(names) - most} more"
                )
            )
        else:
            merged += [each._replace(name=f"{each.name} {name}".rstrip()) for name in names]
    return merged


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
