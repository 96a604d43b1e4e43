"""``elea doctor``: check the machine, the installation and the network."""

from __future__ import annotations

import click

from deploy.commands.options import json_option, port_option


@click.command("doctor")
@click.option("--connect", metavar="ENDPOINT", default="", help="Router to ask; the running fleet's by default.")
@click.option("--domain", default="", help="Domain of the fleet.")
@port_option
@json_option
def command(connect: str, domain: str, port: int | None, as_json: bool) -> None:
    """Check what could keep Elea from running here: the machine, the installation, and the fleet that runs.

    Each check is ok, a warning or a failure, with what it saw and what to do. The exit status is 1 when one fails.
    """
    from deploy.doctor.examine import examine, show

    findings = examine(connect, domain, port)
    show(findings, as_json)
    raise SystemExit(1 if any(each.state == "fail" for each in findings) else 0)
