"""The command line of every service, the same for all: ``python -m services NAME`` and files that call ``main``."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from dataclasses import fields
from types import FrameType
from typing import Any, overload

import click
import msgspec

from messages.errors import did_you_mean
from services.runtime.errors import TRY_AGAIN, BadInput, EleaError, Stopped, TryAgain
from services.runtime.parameters.base import Parameters
from services.runtime.parameters.schema import describe_range, describe_relations
from services.runtime.parameters.validation import build, describe_parameters, read_assignments, stated
from services.runtime.service import Role, Run, Service, capture


@overload
def main(service: Service) -> None: ...
@overload
def main(
    service: Run,
    *,
    name: str,
    about: str,
    rate: float | None = None,
    parameters: type[Parameters] = Parameters,
    role: Role = "member",
) -> None: ...
def main(service: Service | Run, **declaration: Any) -> None:
    """Parse the command line, run a service and exit with its status.

    Args:
        service: The declaration of the service, or its loop ``run(ctx)``.
        **declaration: With a loop, the other fields of ``Service``: name, about, rate, parameters, role.

    Raises:
        BadInput: The calling file is being imported by another one.
    """
    _check_not_imported(sys._getframe(1))
    if not isinstance(service, Service):
        _check_declaration(service, declaration)
        service = Service(run=service, **declaration)
    capture(service)
    run_command_line(service, sys.argv[1:])


def _check_not_imported(caller: FrameType) -> None:
    """Raise BadInput if ``main`` is called at the top level of an imported module: the import would start a service."""
    module = caller.f_globals.get("__name__")
    if caller.f_code.co_name == "<module>" and module != "__main__":
        raise BadInput(
            f"{caller.f_code.co_filename}:{caller.f_lineno}: an import of {module} would start its service: "
            'put the call of main under `if __name__ == "__main__":`'
        )


def _check_declaration(run: object, declaration: dict[str, Any]) -> None:
    """Exit with an error and an example if the arguments of ``main`` do not declare a service."""
    known = [each.name for each in fields(Service) if each.name != "run"]
    unknown = [each for each in declaration if each not in known]
    missing = [each for each in ("name", "about") if not declaration.get(each)]
    if callable(run) and not unknown and not missing:
        return
    if not callable(run):
        fault = f"main takes a Service or a loop run(ctx), not {run!r:.80}"
    elif unknown:
        fault = f"main has no argument {unknown[0]!r}{did_you_mean(unknown[0], known)}"
    else:
        fault = f"main needs the service's {' and '.join(missing)}"
    sys.stderr.write(
        f'{sys.argv[0]}: {fault}; for example main(run, name="my_robot", about="Drives a square.", rate=25)\n'
    )
    sys.exit(2)


def run_command_line(service: Service, arguments: list[str], program: str | None = None) -> None:
    """Run the service with the options in ``arguments`` and end the process.

    The exit status is 0, 1 after an error, 2 for bad input, and TRY_AGAIN if the same may work later.

    Args:
        service: The declaration of the service.
        arguments: The options of the command line.
        program: The command in the usage line; that of ``./elea run`` comes first.
    """

    def run(options: dict[str, Any]) -> None:
        from services.runtime.start import run_service

        run_service(service, options)

    run_program(service.name, service_command(service), arguments, program, run)


def run_program(
    name: str, command: click.Command, arguments: list[str], program: str | None, run: Callable[[dict[str, Any]], None]
) -> None:
    """Parse ``arguments`` with ``command``, call ``run`` with the options, and end the process.

    Args:
        name: Name of the program in its messages.
        command: The command line; its callback returns the options, or None if there is nothing to run.
        arguments: The arguments of the command line.
        program: The command in the usage line; that of ``./elea run`` comes first.
        run: Runs until the end; raises the error that ends it.
    """
    from services.runtime import process

    options = parse_options(name, command, arguments, os.environ.pop(process.PROGRAM, program))
    process.die_with_parent()
    process.die_with_threads()
    process.exit_now(_run(name, run, options))


def parse_options(name: str, command: click.Command, arguments: list[str], program: str | None) -> dict[str, Any]:
    """Return the options that ``command`` parses; ends the process if they are wrong or there is nothing to run.

    The arguments are those of ``run_program``.
    """
    from services.runtime import process

    process.lossy_stderr()
    try:
        process.check_import_roots()
        options = command.main(arguments, program, standalone_mode=False)
    except click.ClickException as error:
        error.show()
        sys.exit(2)
    except click.exceptions.Abort:
        sys.exit(1)
    except BadInput as error:
        sys.stderr.write(f"{name}: {error}\n")
        sys.exit(2)
    if not isinstance(options, dict):
        sys.exit(0)
    return options


def _stop_at_start() -> None:
    """Exit at once on a signal during start-up, when nothing needs an orderly shutdown yet."""
    raise Stopped("the process was asked to end")


def _run(name: str, run: Callable[[dict[str, Any]], None], options: dict[str, Any]) -> int:
    """Run the program and return its exit status."""
    from services.runtime import process

    status = 1
    try:
        process.install_signal_handlers(_stop_at_start)
        run(options)
        status = 0
    except Stopped:
        status = 0
    except BadInput as error:
        sys.stderr.write(f"{name}: {error}\n")
        status = TRY_AGAIN if isinstance(error, TryAgain) else 2
    except EleaError as error:
        sys.stderr.write(f"{name}: {error}\n")
    process.exit_within(process.CLOSE_S, status)
    return status


def service_command(service: Service) -> click.Command:
    """Return the click command of a service; its callback returns the options, checked without the network."""

    def check(param: tuple[str, ...], fleet_param: tuple[str, ...], **options: Any) -> dict[str, Any] | None:
        from messages.names import BadName, Identity, parse_assignment, parse_remap

        remap = options.pop("remap")
        private = [assigned for each in remap if (assigned := parse_assignment(each)) is not None]
        try:
            rules = tuple(parse_remap(each) for each in remap if parse_assignment(each) is None)
            options["identity"] = Identity.of(options.pop("name") or service.name, options.pop("namespace"), rules)
        except BadName as error:
            raise BadInput(str(error)) from None
        options["fleet"] = read_assignments(fleet_param, "--fleet-param")
        options["command_line"] = read_assignments((*(f"{name}={value}" for name, value in private), *param))
        build(service.parameters, options["fleet"], "--fleet-param")
        options["params"] = build(service.parameters, {**options["fleet"], **options["command_line"]}, "--param")
        if options.pop("print_config"):
            click.echo(json.dumps(describe_config(service, options), indent=2))
            return None
        return options

    option = click.Option
    return click.Command(
        service.name,
        callback=check,
        help=service.about,
        epilog=_epilog(service.parameters),
        params=[
            option(["--namespace"], default="/", help="Namespace of the node's relative names, such as /tb3_0."),
            option(["--name"], default="", help=f"Name of the node; {service.name} by default."),
            option(["--remap"], multiple=True, metavar="FROM:=TO", help="Use another name; _K:=V sets a parameter."),
            option(["--param"], multiple=True, metavar="K=V", help="Set a parameter; may be repeated."),
            option(
                ["--fleet-param"], multiple=True, metavar="K=V", help="Set a parameter, but let --param override it."
            ),
            *network_options(),
        ],
    )


def network_options() -> list[click.Option]:
    """Return the network options of a process with one node or several."""
    option = click.Option
    levels, topologies = click.Choice(["debug", "info", "warn", "error"]), click.Choice(["direct", "star"])
    return [
        option(
            ["--connect"], multiple=True, metavar="ENDPOINT", help="Router to join; your own on port 7447 by default."
        ),
        option(["--domain"], default="", help="Domain of the fleet; it separates fleets on the same network."),
        option(
            ["--topology"], type=topologies, default="direct", help="Connect to nodes directly, or only via the router."
        ),
        option(["--lockstep"], is_flag=True, help="Run in lockstep: the simulation waits for this node."),
        option(["--await-params"], is_flag=True, help="Wait at start-up for the parameter service, for up to 10 s."),
        option(["--log-level"], type=levels, default="info", help="Log this level and above."),
        option(["--print-config"], is_flag=True, help="Show what would run, and exit."),
    ]


def _epilog(record: type[Parameters]) -> str:
    """Return the help text of the parameters, one paragraph each."""
    lines = []
    for each in describe_parameters(record):
        facts = f"{each.default!r} by default", describe_range(each) or each.unit, describe_relations(each)
        lines.append(f"  {each.name} ({', '.join(part for part in facts if part)}): {each.text}")
    return "\b\nParameters:\n" + "\n".join(lines) if lines else ""


def describe_config(service: Service, options: dict[str, Any]) -> dict[str, Any]:
    """Describe what would run; ``origins`` has the source of each parameter that is not the default."""
    shown = dict(options)
    fleet, command_line = (stated(service.parameters, shown.pop(each)) for each in ("fleet", "command_line"))
    shown["origins"] = dict.fromkeys(fleet, "fleet") | dict.fromkeys(command_line, "command line")
    return {"service": service.name, **msgspec.to_builtins(shown)}
