"""Assigns a fleet's services to processes: the containers that the key ``share`` asks for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import msgspec

from deploy.controller_files import KIND as CONTROLLER_MANAGER
from deploy.controller_files import manager_rate
from deploy.fleet import Fleet, RobotConfig, ServiceConfig
from deploy.fleet_validation import all_services, service_identity
from deploy.restart_policy import RestartPolicy
from deploy.service_parameters import BUILTIN_SERVICES
from models.toml_source import TomlKey, TomlSource
from services.catalog import is_script, load_service
from services.runtime.errors import BadInput


class PlacedService(msgspec.Struct, frozen=True):
    """A service of a fleet, and its robot."""

    service: ServiceConfig
    robot: RobotConfig | None

    @property
    def node(self) -> str:
        """The name of its node."""
        return service_identity(self.service, self.robot).node

    @property
    def required(self) -> bool:
        """Whether the fleet ends with this service."""
        return self.service.required if self.service.required is not None else self.service.kind in BUILTIN_SERVICES


class ProcessGroup(NamedTuple):
    """The services of one process; that of a single service has no name of its own."""

    name: str
    members: tuple[PlacedService, ...]


class _Share(NamedTuple):
    """Key of services that share processes: ``prefix`` names the processes, each with at most ``limit`` nodes."""

    prefix: str
    kind: str = ""
    limit: int | None = None


def group_services(placed: Sequence[PlacedService], fleet: Fleet) -> list[ProcessGroup]:
    """Group services into processes, ordered by their first services; a service with none to share with is alone.

    Services that need several processes are distributed over them evenly, in order.
    """
    shares = [_share_of(each, fleet) for each in placed]
    members: dict[_Share, list[PlacedService]] = {}
    for share, each in zip(shares, placed, strict=True):
        if share is not None:
            members.setdefault(share, []).append(each)
    groups: list[ProcessGroup] = []
    numbers = Counter[str]()
    for share, each in zip(shares, placed, strict=True):
        if share is None:
            groups.append(ProcessGroup("", (each,)))
        elif (together := members.pop(share, None)) is not None:
            for part in _spread(together, share.limit):
                numbers[share.prefix] += 1
                name = share.prefix if share.limit is None else f"{share.prefix}-{numbers[share.prefix]}"
                groups.append(ProcessGroup(name if len(part) > 1 else "", tuple(part)))
    return groups


def check_sharing(fleet: Fleet, source: TomlSource) -> None:
    """Raise BadInput for services that cannot share a process, or not with each other."""
    first: dict[_Share, tuple[tuple[TomlKey, ...], PlacedService]] = {}
    nodes = {service_identity(member, owner).node.removeprefix("/") for _, member, owner in all_services(fleet)}
    for path, member, owner in all_services(fleet):
        if member.share is None:
            continue
        where = source.location(*path, "share")
        if why := reason_alone(member.kind):
            raise BadInput(f"{where}: {member.kind} cannot share a process: {why}; leave share out")
        placed = PlacedService(member, owner)
        if (share := _share_of(placed, fleet)) is None:
            continue
        if share.prefix in nodes and share.limit is None:
            raise BadInput(f"{where}: there is a node /{share.prefix}: give the group of services another name")
        there, known = first.setdefault(share, (path, placed))
        group = f'share = "{member.share}"' if isinstance(member.share, str) else f"share = {member.share}"
        at = source.location(*there, "share")
        mine, others = service_rate(placed), service_rate(known)
        if mine != others:
            raise BadInput(
                f"{where}: {group}: {member.kind} ticks at {_rate(mine)}, {known.service.kind} ({at}) at "
                f"{_rate(others)}: nodes that share a process have one rate; give each rate a group of its own"
            )
        if _policy(member) != _policy(known.service):
            raise BadInput(
                f"{where}: {group}: {member.kind} and {known.service.kind} ({at}) have different restart policies: "
                "nodes that share a process have one"
            )


def reason_alone(kind: str) -> str:
    """Return why services of a kind need a process of their own; empty if they can share one."""
    if kind in BUILTIN_SERVICES:
        return "every fleet has one, which all others need"
    if is_script(kind):
        return "a program of ROS has threads of its own, and blocks"
    return load_service(kind).reason_alone


def service_rate(placed: PlacedService) -> float | None:
    """Return the tick rate of a service [Hz] as stated in the fleet file or by its kind, None if it has no ticks."""
    service = placed.service
    if service.kind == CONTROLLER_MANAGER:
        return manager_rate(service, placed.robot)
    declared = load_service(service.kind)
    stated = service.parameters.get(declared.rate_parameter, declared.rate)
    return None if stated is None else float(stated)


def _share_of(placed: PlacedService, fleet: Fleet) -> _Share | None:
    """Return the sharing key of a service, None if it is alone.

    A number groups services by their kind; the run's ``share`` groups all others that can share and have the same rate.
    """
    service = placed.service
    match service.share:
        case str() as name:
            return _Share(name)
        case int() as limit:
            return _Share(load_service(service.kind).name, service.kind, limit) if limit > 1 else None
    if fleet.run.share is None or reason_alone(service.kind) or service.restart is not None:
        return None
    rate = service_rate(placed)
    return _Share("shared" if rate is None else f"shared-{rate:g}hz", limit=fleet.run.share)


def _spread(members: Sequence[PlacedService], limit: int | None) -> Iterator[Sequence[PlacedService]]:
    """Split the members into as few parts as ``limit`` allows, with lengths that differ by at most one."""
    parts = 1 if limit is None else -(-len(members) // limit)
    ends = [len(members) * number // parts for number in range(parts + 1)]
    for begin, end in pairwise(ends):
        yield members[begin:end]


def _policy(service: ServiceConfig) -> RestartPolicy:
    match service.restart:
        case None:
            return RestartPolicy()
        case RestartPolicy() as policy:
            return policy
        case when:
            return RestartPolicy(when=when)


def _rate(rate: float | None) -> str:
    return "no rate" if rate is None else f"{rate:g} Hz"
