"""All checks in their order, and their findings as text or JSON."""

from __future__ import annotations

from collections.abc import Sequence

from deploy.doctor import Check, Finding, fail, installation, leftovers, machine, network, places, screen
from deploy.live.output import say, say_json
from deploy.place import Place, place_of
from deploy.version import VERSION
from services.runtime.errors import BadInput
from services.runtime.network.zenoh_config import endpoint


def examine(connect: str = "", domain: str = "", port: int | None = None) -> list[Finding]:
    """The findings of all checks."""
    checks: list[Check] = [
        machine.system,
        machine.python,
        installation.version,
        installation.environment,
        installation.packages,
        installation.libraries,
        machine.capacity,
        machine.clock,
        machine.loopback,
        screen.display,
        screen.vulkan,
        places.results,
        places.state,
        leftovers.processes,
        leftovers.fleets,
    ]
    findings = [finding for check in checks for finding in check()]
    try:
        place = place_of(connect, domain, port)
        place = Place(endpoint(place.router), place.domain)
    except BadInput as error:
        return [*findings, fail("network", str(error), "name one, with --port or --connect")]
    asked = bool(connect) or port is not None
    return [*findings, *network.ports(place), *network.access(), *network.router(place, asked)]


def show(findings: Sequence[Finding], as_json: bool) -> None:
    """A line for each finding, with what to do below it, and a sum."""
    if as_json:
        say_json({"version": VERSION, "checks": [each._asdict() for each in findings]})
        return
    width = max(len(each.name) for each in findings)
    for each in findings:
        say(f"{each.state:<4}  {each.name:<{width}}  {each.why}\n")
        if each.do:
            say(f"{'':<4}  {'':<{width}}  -> {each.do}\n")
    counts = {state: sum(each.state == state for each in findings) for state in ("ok", "warn", "fail")}
    say(f"{len(findings)} checks: {counts['ok']} ok, {counts['warn']} warnings, {counts['fail']} failures\n")
