"""``elea up``: run a fleet to its report."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import msgspec

from deploy.commands.completion import FLEET
from deploy.fleet import MODES, REMOVED_MODES, Fleet, RunConfig, ServiceConfig
from deploy.fleet_file import find_fleet, read_fleet, saved_parameters_file
from services.runtime.errors import BadInput

if TYPE_CHECKING:
    from deploy.report.record import Report


class _Mode(click.Choice[str]):
    """A mode of time; one that there was once is refused with what to take instead."""

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        if value in REMOVED_MODES:
            self.fail(REMOVED_MODES[value], param, ctx)
        return super().convert(value, param, ctx)


@click.command("up")
@click.argument("fleet", default="lab", type=FLEET)
@click.option("--mode", type=_Mode(MODES), help="How time runs; the fleet's by default.")
@click.option("--factor", type=float, help="Simulated per wall-clock second, in real time.")
@click.option("--duration", type=float, metavar="S", help="End after S seconds of simulation time.")
@click.option("--detach", is_flag=True, help="Return when all is ready; end it with ./elea down.")
@click.option("--report", metavar="DIR", default="", help="Folder of the results; runs/TIME-FLEET by default.")
@click.option("--seed", type=int, metavar="N", help="Seed of the sensors' noise.")
@click.option("--domain", default="", help="Isolates fleets of one network from each other.")
@click.option("--connect", multiple=True, metavar="ENDPOINT", help="Router of another machine, as tcp/host:7447.")
@click.option("--port", type=int, help="Tells this fleet from others; the TCP port of one that listens on TCP.")
@click.option("--listen", multiple=True, metavar="ENDPOINT", help="Let others in, too, as at tcp/127.0.0.1:7447.")
@click.option("--insecure", is_flag=True, help="Allow --listen on addresses that other machines can reach.")
@click.option("--params", metavar="FILE", default="", help="File of saved parameters; params/FLEET.db by default.")
@click.option("--no-saved", is_flag=True, help="Leave saved parameters out, and save none.")
@click.option("--record", is_flag=True, help="Record all topics into a bag beside the report.")
@click.option("--no-view", is_flag=True, help="Do not open the viewer, nor serve the run to one.")
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON.")
def command(fleet: str, detach: bool, report: str, as_json: bool, **options: Any) -> None:
    """Run FLEET, one of deploy/fleets or a TOML file, to its report; lab by default.

    Ctrl-C ends the run with a report on what was driven so far and exit status 130 (0 for a fleet that never ends by
    itself); a second one kills. The status is 0 when every check of the report holds, 1 if not, 2 for bad input.
    """
    if detach:
        from deploy.detach import start_detached

        described = override_run(read_fleet(find_fleet(fleet)), options)
        raise SystemExit(start_detached(described.name, report, as_json))
    raise SystemExit(_run(override_run(read_fleet(find_fleet(fleet)), options), report, as_json, options))


def override_run(fleet: Fleet, options: dict[str, Any]) -> Fleet:
    """The fleet with what the command line says about its run; raises BadInput."""
    stated = {
        name: options[name] for name in ("mode", "factor", "duration", "seed", "port") if options[name] is not None
    }
    if fleet.run.ends == "never" and stated.get("duration"):
        stated["ends"] = "duration"
    try:
        run = msgspec.convert({**msgspec.to_builtins(fleet.run), **stated}, RunConfig)
    except msgspec.ValidationError as error:
        text, _, name = str(error).partition(" - at `$.")
        raise BadInput(f"--{name.rstrip('`')}: {text}") from None
    if options.get("record") and not any(each.kind == "recorder" for each in fleet.service):
        fleet = msgspec.structs.replace(fleet, service=(*fleet.service, ServiceConfig(kind="recorder")))
    return msgspec.structs.replace(fleet, run=run)


def _run(fleet: Fleet, report: str, as_json: bool, options: dict[str, Any]) -> int:
    from deploy.live.output import ignore_output_errors
    from deploy.progress import open_display
    from deploy.run_fleet import run_fleet
    from deploy.run_folder import make_run_folder
    from deploy.service_parameters import RunOptions
    from services.runtime.transport.zenoh_config import check_listen, endpoint

    if options["params"] and options["no_saved"]:
        raise BadInput("--params and --no-saved contradict each other: give one of them")
    saved = None if options["no_saved"] else Path(options["params"] or saved_parameters_file(fleet.name)).absolute()
    links = tuple(endpoint(each) for each in options["connect"])
    listen = check_listen(options["listen"], options["insecure"])
    folder = make_run_folder(fleet.name, report)
    terms = RunOptions(
        folder=folder,
        saved=saved,
        domain=options["domain"],
        links=links,
        listen=listen,
        insecure=options["insecure"],
        view=not options["no_view"],
    )
    with open_display() as shown:
        result = run_fleet(fleet, terms, shown)
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
