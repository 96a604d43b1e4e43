"""Every configuration key that we write is known to Zenoh and parsed with the intended value."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest
import zenoh

from services.runtime.errors import BadInput
from services.runtime.transport.zenoh_config import LINKING_S, Role, configuration, default_router, endpoint

ROLES: tuple[Role, ...] = ("router", "direct", "star")


def _leaves(tree: dict[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{path}{name}/")
        else:
            yield f"{path}{name}", value


def _holds(made: Any, wanted: Any) -> bool:
    """Whether Zenoh parsed a value as given; it may add keys to records in lists."""
    if isinstance(wanted, dict):
        return all(name in made and _holds(made[name], value) for name, value in wanted.items())
    if isinstance(wanted, list):
        return len(made) == len(wanted) and all(map(_holds, made, wanted))
    return bool(made == wanted)


@pytest.mark.parametrize("role", ROLES)
@pytest.mark.parametrize("reliable", [False, True])
def test_zenoh_takes_every_key(role: Role, reliable: bool) -> None:
    tree = configuration(role, ("127.0.0.1:7447",), ("tcp/127.0.0.1:0",), "lab", reliable)
    made = dict(_leaves(json.loads(str(zenoh.Config.from_json5(json.dumps(tree))))))
    for path, value in _leaves(tree):
        assert _holds(made[path], value), path


def test_in_lockstep_the_router_waits_for_room_as_long_as_the_nodes() -> None:
    def patience(role: Role, reliable: bool) -> int:
        queue = configuration(role, reliable=reliable)["transport"]["link"]["tx"]["queue"]
        return int(queue["congestion_control"]["drop"]["wait_before_drop"])

    assert {patience(role, reliable=True) for role in ROLES} == {2_000_000}
    assert patience("router", reliable=False) == 10_000


def test_processes_of_one_machine_have_time_to_link_though_they_get_no_processor() -> None:
    def timeouts(role: Role, connect: tuple[str, ...] = (), listen: tuple[str, ...] = ()) -> tuple[int, int]:
        unicast = configuration(role, connect, listen)["transport"]["unicast"]
        return unicast["open_timeout"], unicast["accept_timeout"]

    socket, tcp = default_router(), "tcp/127.0.0.1:7447"
    patient, quick = (LINKING_S * 1000,) * 2, (2000, 1000)
    assert timeouts("router", listen=(socket,)) == patient
    assert timeouts("direct", (socket,)) == timeouts("star", (socket,)) == patient
    assert timeouts("direct", (tcp,)) == timeouts("star", (tcp,)) == timeouts("router", (), (socket, tcp)) == quick


def test_the_routers_rules_name_no_keys() -> None:
    """Zenoh keeps what each key matches, and reads it without a lock while links close (``_BATCHED``)."""
    (rule,) = configuration("router")["qos"]["network"]
    assert "key_exprs" not in rule
    assert (rule["messages"], rule["overwrite"]) == (["put"], {"express": False})


def test_an_unknown_key_would_be_noticed() -> None:
    with pytest.raises(zenoh.ZError):
        zenoh.Config.from_json5(json.dumps({"transport": {"link": {"tx": {"leese": 1}}}}))


@pytest.mark.parametrize("role", ROLES)
def test_nothing_listens_beyond_the_loopback(role: Role) -> None:
    tree = configuration(role, ("tcp/127.0.0.1:7447",), ("tcp/127.0.0.1:7447",) if role == "router" else ())
    assert all("127.0.0.1" in each for each in tree["listen"]["endpoints"])
    assert tree["scouting"]["multicast"]["enabled"] is False
    assert tree["transport"]["shared_memory"]["enabled"] is False
    assert tree["listen"]["endpoints"] or role == "star"


def test_a_domain_isolates() -> None:
    assert configuration("direct", domain="lab")["namespace"] == "lab"
    assert "namespace" not in configuration("direct")


@pytest.mark.parametrize("text", ["", "7447", "tcp/127.0.0.1", "tcp/:7447", "127.0.0.1:99999", "http/127.0.0.1:80"])
def test_a_bad_endpoint_is_refused(text: str) -> None:
    with pytest.raises(BadInput, match="is not an endpoint"):
        endpoint(text)
