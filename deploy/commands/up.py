"""``elea up``: run a fleet and report on it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import msgspec

from deploy.commands.completion import FLEET
from deploy.fleet import MODES, REMOVED_MODES, Fleet, RunConfig, ServiceConfig
from deploy.fleet_file import find_fleet, read_fleet, saved_parameters_file
from deploy.fleet_overrides import HELP
from services.runtime.errors import BadInput
from services.runtime.process import SWEEP, die_with_parent
from services.sim.engines import ENGINES, check_engine

if TYPE_CHECKING:
    from deploy.report.record import Report


SHARE = 25
"""Number of nodes per process for ``--share`` without a value."""


class _Mode(click.Choice[str]):
    """A time mode; a removed mode is refused with its replacement."""

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        if value in REMOVED_MODES:
            self.fail(REMOVED_MODES[value], param, ctx)
        return super().convert(value, param, ctx)


@click.command("up")
@click.argument("fleet", default="lab", type=FLEET)
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help=HELP)
@click.option(
    "--robots", type=int, metavar="N", help="Number of robots of a fleet with a grid, as --set grid.robots=N."
)
@click.option("--mode", type=_Mode(MODES), help="How time runs; the fleet's by default.")
@click.option("--engine", type=click.Choice(ENGINES), help="Physics engine; the fleet's, or pybullet, by default.")
@click.option("--factor", type=float, help="Simulated seconds per wall-clock second, in mode real.")
@click.option("--duration", type=float, metavar="S", help="End after S seconds of simulation time.")
@click.option("--detach", is_flag=True, help="Return when the fleet is ready; stop it with ./elea down.")
@click.option("--report", metavar="DIR", default="", help="Folder for the results; TIME-FLEET below --runs by default.")
@click.option("--runs", metavar="DIR", default="", help="Parent folder of the run folders; runs by default.")
@click.option("--seed", type=int, metavar="N", help="Random seed of the sensor noise.")
@click.option(
    "--share",
    type=click.IntRange(2, 1000),
    is_flag=False,
    flag_value=SHARE,
    metavar="[N]",
    help=f"Run services that can share a process together, N nodes in each ({SHARE}).",
)
@click.option("--domain", default="", help="Isolate the fleet from others on the same network.")
@click.option(
    "--connect", multiple=True, metavar="ENDPOINT", help="Router on another machine to join, e.g. tcp/host:7447."
)
@click.option("--port", type=int, help="Port that identifies this fleet, and on which it listens if it uses TCP.")
@click.option(
    "--listen", multiple=True, metavar="ENDPOINT", help="Also accept connections here, e.g. tcp/127.0.0.1:7447."
)
@click.option("--insecure", is_flag=True, help="Allow --listen on addresses that other machines can reach.")
@click.option("--params", metavar="FILE", default="", help="File of saved parameters; params/FLEET.db by default.")
@click.option("--no-saved", is_flag=True, help="Neither use nor save saved parameters.")
@click.option("--record", is_flag=True, help="Record all topics into a bag next to the report.")
@click.option("--no-view", is_flag=True, help="Neither open a viewer nor serve the run to one.")
@click.option("--no-picture", is_flag=True, help="Write no report.png; drawing it takes half a second.")
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON.")
def command(
    fleet: str,
    detach: bool,
    report: str,
    runs: str,
    as_json: bool,
    overrides: tuple[str, ...],
    robots: int | None,
    **options: Any,
) -> None:
    """Run FLEET (lab by default) and report on it: one that comes with Elea, listed in docs/fleets.md, or a TOML file.

    Ctrl-C stops the run and reports on it so far, with exit status 130 (0 for a fleet that never ends on its own); a
    second Ctrl-C kills it. The exit status is 0 if every check of the report passes, 1 if not, 2 for bad input.
    """
    die_with_parent(SWEEP)
    described = override_run(read_fleet(find_fleet(fleet), overrides, robots), options)
    if robots is not None:
        overrides = (*overrides, f"grid.robots={robots}")
    if detach:
        from deploy.detach import start_detached

        raise SystemExit(start_detached(described.name, report, as_json, runs))
    raise SystemExit(run_described(described, report, runs, as_json, overrides, options))


def override_run(fleet: Fleet, options: dict[str, Any]) -> Fleet:
    """Apply the command line's options to the fleet's run; raises BadInput."""
    names = ("mode", "engine", "factor", "duration", "seed", "port", "share")
    stated = {name: options[name] for name in names if options.get(name) is not None}
    if fleet.run.ends == "never" and stated.get("duration"):
        stated["ends"] = "duration"
    try:
        run = msgspec.convert({**msgspec.to_builtins(fleet.run), **stated}, RunConfig)
    except msgspec.ValidationError as error:
        text, _, rest = str(error).partition(" - at `$.")
        name = rest.rstrip("`")
        raise BadInput(f"--{name} {stated[name]}: {text}") from None
    if options.get("engine"):
        check_engine(options["engine"], "--engine")
    if options.get("record") and not any(each.kind == "recorder" for each in fleet.service):
        fleet = msgspec.structs.replace(fleet, service=(*fleet.service, ServiceConfig(kind="recorder")))
    if options.get("share"):
        fleet = _reshare(fleet, options["share"])
    return msgspec.structs.replace(fleet, run=run)


def _reshare(fleet: Fleet, nodes: int) -> Fleet:
    """Return the fleet with ``nodes`` per process wherever it states another number; groups by name stay."""

    def changed(services: tuple[ServiceConfig, ...]) -> tuple[ServiceConfig, ...]:
        return tuple(
            msgspec.structs.replace(each, share=nodes) if isinstance(each.share, int) else each for each in services
        )

    return msgspec.structs.replace(
        fleet,
        service=changed(fleet.service),
        every_robot=changed(fleet.every_robot),
        robot=tuple(msgspec.structs.replace(each, services=changed(each.services)) for each in fleet.robot),
    )


def run_described(
    fleet: Fleet, report: str, runs: str, as_json: bool, overrides: tuple[str, ...], options: dict[str, Any]
) -> int:
    """Run a fleet with the options of the command line, print its report, and return the exit status."""
    from deploy.live.output import ignore_output_errors
    from deploy.progress import open_display
    from deploy.run_fleet import run_fleet
    from deploy.run_folder import make_run_folder
    from deploy.service_parameters import RunOptions
    from services.runtime.ports import first_free_port
    from services.runtime.transport.zenoh_config import check_listen, endpoint

    if options["params"] and options["no_saved"]:
        raise BadInput("--params and --no-saved contradict each other: give one of them")
    saved = None if options["no_saved"] else Path(options["params"] or saved_parameters_file(fleet.name)).absolute()
    links = tuple(endpoint(each) for each in options["connect"])
    listen = check_listen(options["listen"], options["insecure"])
    tcp_port = None if options["port"] or not fleet.run.tcp else first_free_port(fleet.run.port)
    folder = make_run_folder(fleet.name, report, runs)
    run_options = RunOptions(
        folder=folder,
        saved=saved,
        domain=options["domain"],
        links=links,
        listen=listen,
        insecure=options["insecure"],
        tcp_port=tcp_port,
        view=not options["no_view"],
        picture=not options["no_picture"],
        overrides=overrides,
    )
    with open_display() as shown:
        if tcp_port not in (None, fleet.run.port):
            shown.print_line(f"TCP port {fleet.run.port} is held by another program; this fleet takes {tcp_port}")
        result = run_fleet(fleet, run_options, shown)
    if result.report is None:
        sys.stderr.write(f"elea: no report: {result.error}\n")
    else:
        with ignore_output_errors():
            _print_result(result.report, folder, as_json)
    return result.exit_status(fleet)


def _print_result(report: Report, folder: Path, as_json: bool) -> None:
    if as_json:
        from deploy.report.write import to_json

        sys.stdout.write(to_json(report).decode())
    else:
        from deploy.report.table import print_report

        print_report(report)
        sys.stdout.write(f"results in {folder}\n")
    sys.stdout.flush()
