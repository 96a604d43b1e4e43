"""A node that joins another machine's router gets an error that it must use topology star; with star it works."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from pathlib import Path

import pytest

from messages.names import Identity
from messages.topics import HEALTH
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.transport.unix_sockets import check_reachable, router_in
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.message_recorder import MessageRecorder
from tests.harness.ports import free_port
from tests.harness.processes import Process
from tests.harness.waiting import wait_until
from tests.system.network_namespaces import namespace_pair

pytestmark = pytest.mark.waits

WITHIN_S = 40.0


def test_who_joins_from_another_machine_is_told_to_use_star(tmp_path: Path) -> None:
    with tempfile.TemporaryDirectory() as sockets, namespace_pair() as ends:
        router, tcp = router_in(Path(sockets)), f"tcp/{ends.near_address}:{free_port()}"
        said = tmp_path / "near.log"
        listen = ["-m", "services", "router", "--param", f"listen={router}", "--param", f'also=["{tcp}"]']
        with Process(listen, tmp_path / "refused.log", through=ends.near_command) as refused:
            assert refused.wait(WITHIN_S) == 2
            assert (
                f"listening on {tcp}: anyone who can reach this address can read everything and drive" in refused.text
            )
            assert "say so with --param insecure=true" in refused.text
        listen += ["--param", "insecure=true"]
        with Process(listen, tmp_path / "router.log", through=ends.near_command) as opened:
            wait_until(lambda: _listens(router), WITHIN_S, "the router")
            warning = f"WARN /router: listening on {tcp}: anyone who can reach this address can"
            wait_until(lambda: warning in opened.text, WITHIN_S, "its warning")
            identity = Identity.of("tester")
            with (
                ExitStack() as stack,
                said.open("w") as out,
                ZenohTransport(configuration("direct", (router,))) as transport,
                Node(transport, identity, "tester", Log(identity.node, out=out)) as node,
            ):
                beats = MessageRecorder(node.subscribe(HEALTH))

                def beating(name: str) -> bool:
                    node.spin_once()
                    return any(each.node == name for each in beats.received())

                def cut_off() -> bool:
                    node.spin_once()
                    return "ERROR /cut: this node is cut off from 2 of the 2 nodes" in joined.text

                words = ["-m", "services", "waypoint", "--name", "fellow", "--connect", router]
                stack.enter_context(Process(words, tmp_path / "fellow.log"))
                wait_until(lambda: beating("/fellow"), WITHIN_S, "a heartbeat from peer to peer")
                words = ["-m", "services", "waypoint", "--connect", tcp]
                far = ends.far_command(hide=sockets)
                with Process([*words, "--name", "cut"], tmp_path / "cut.log", through=far) as joined:
                    wait_until(cut_off, WITHIN_S, "the reason")
                    assert "(/fellow, /tester)" in joined.text
                    assert "Start this node with --topology star" in joined.text
                    assert not beating("/cut")
                words += ["--name", "whole", "--topology", "star"]
                with Process(words, tmp_path / "whole.log", through=far):
                    wait_until(lambda: beating("/whole"), WITHIN_S, "a heartbeat through the router")
            assert said.read_text() == "", "who is missed by one alone says nothing"


def _listens(router: str) -> bool:
    try:
        check_reachable(router)
    except OSError:
        return False
    return True
