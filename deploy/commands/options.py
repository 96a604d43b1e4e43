"""Options that several commands share."""

from __future__ import annotations

import functools
from collections.abc import Callable
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, TypeVar

import click

from deploy.commands.completion import RUNNING_FLEET
from services.runtime.network_address import port_of_fleet, resolve_address

F = TypeVar("F", bound=Callable[..., Any])

json_option: Callable[[F], F] = click.option("--json", "as_json", is_flag=True, help="Print JSON.")


filter_option: Callable[[F], F] = click.option(
    "--filter",
    "pattern",
    default="",
    metavar="PATTERN",
    help="Only names that contain this text or match this pattern, e.g. 'tb3_1*/odom'.",
)


def fits(name: str, pattern: str) -> bool:
    """Return whether a name contains the text ``pattern``, or matches it if it has ``*``, ``?`` or ``[``; slashes
    before it are optional.
    """
    if not any(each in pattern for each in "*?["):
        return pattern in name
    return fnmatchcase(name.lstrip("/"), pattern.lstrip("/"))


def own_robot_options(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options for a robot file of the user's; the command gets ``packages`` and ``xacro_args``."""

    @click.option(
        "--package",
        "packages",
        multiple=True,
        type=click.Path(path_type=Path),
        help="Folder of a ROS package, or of several, for package://; may be repeated.",
    )
    @click.option(
        "--arg", "arguments", multiple=True, metavar="NAME:=VALUE", help="Argument of a xacro; may be repeated."
    )
    @functools.wraps(verb)
    def with_arguments(arguments: tuple[str, ...], **values: Any) -> Any:
        return verb(xacro_args=dict(map(_xacro_argument, arguments)), **values)

    return with_arguments


def _xacro_argument(pair: str) -> tuple[str, str]:
    name, found, value = pair.partition(":=")
    if not (name and found):
        raise click.BadParameter(f"{pair!r} is not NAME:=VALUE", param_hint="--arg")
    return name, value


def fleet_option(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--fleet`` and ``--port``, either of which selects one of several running fleets; the
    command gets ``port``.
    """

    @click.option("--fleet", metavar="NAME", type=RUNNING_FLEET, help="Name of the fleet, if several are running.")
    @click.option("--port", type=click.IntRange(1, 65535), help="Port of the fleet, if several are running.")
    @functools.wraps(verb)
    def chosen(fleet: str | None, port: int | None, **values: Any) -> Any:
        return verb(port=port if fleet is None else port_of_fleet(fleet, port), **values)

    return chosen


def network_options(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Add options for the network; the command gets an ``address``, by default that of the running fleet."""

    @click.option("--connect", metavar="ENDPOINT", default="", help="Router to join; the running fleet's by default.")
    @click.option("--domain", default="", help="Domain of the fleet.")
    @fleet_option
    @functools.wraps(verb)
    def addressed(connect: str, domain: str, port: int | None, **values: Any) -> Any:
        return verb(address=resolve_address(connect, domain, port), **values)

    return addressed
