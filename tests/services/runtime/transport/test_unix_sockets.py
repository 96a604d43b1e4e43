"""Unix sockets: their folder, protection from other users, and leftovers of killed processes."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from services.runtime.errors import BadInput
from services.runtime.process import ROOT
from services.runtime.transport import unix_sockets
from services.runtime.transport.unix_sockets import (
    check_reachable,
    make_private,
    path_of,
    remove_stale,
    router_endpoint,
    router_in,
)
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.waiting import wait_until

LISTENER = """
import sys, time
from services.runtime.transport.zenoh_config import configuration
from services.runtime.transport.zenoh import ZenohTransport
role, router = sys.argv[1:]
tree = configuration(role, listen=(router,)) if role == "router" else configuration(role, (router,))
with ZenohTransport(tree):
    print("up", flush=True)
    time.sleep(600)
"""


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder private to this user, with a short path."""
    with tempfile.TemporaryDirectory() as made:
        yield Path(made)


def of_another_user(folder: Path) -> Path:
    """Return another user's folder of mode 0700: a new one, or without root an existing one."""
    if os.geteuid() != 0:
        return Path("/root")
    made = folder / "another"
    made.mkdir(mode=0o700)
    os.chown(made, 65534, 65534)
    return made


def listener(role: str, router: str) -> subprocess.Popen[str]:
    """Start another process that listens."""
    made = subprocess.Popen(
        [sys.executable, "-P", "-c", LISTENER, role, router],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert made.stdout is not None
    assert made.stdout.readline() == "up\n"
    return made


def test_the_folder_is_the_users_alone_wherever_it_lies(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    assert path_of(router_endpoint(7447)) == folder / "elea" / "7447" / "router.sock"
    old = os.umask(0o002)
    try:
        make_private(path_of(router_endpoint(7447)).parent)
    finally:
        os.umask(old)
    assert [(folder / each).stat().st_mode & 0o777 for each in ("elea", "elea/7447")] == [0o700, 0o700]
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    for unfit in ("", "relative", str(folder / "missing"), str(of_another_user(folder))):
        monkeypatch.setenv("XDG_RUNTIME_DIR", unfit)
        assert path_of(router_endpoint(1)).parent == folder / f"elea-{os.geteuid()}" / "1", unfit


def test_a_folder_that_others_can_reach_is_refused_with_the_remedy(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    planted, base = folder / "elea" / "7447", folder / "elea"
    base.mkdir(mode=0o755)
    with pytest.raises(BadInput, match=f"mode 0755, so other users may reach the robots: chmod 700 {base}$"):
        make_private(planted)
    base.chmod(0o700)
    with pytest.raises(BadInput, match=r"belongs to the user with uid \d+, .*: set XDG_RUNTIME_DIR"):
        make_private(of_another_user(folder))
    planted.symlink_to(folder)
    with pytest.raises(BadInput, match="7447 is a symbolic link"):
        make_private(planted)
    planted.unlink()
    planted.touch()
    with pytest.raises(BadInput, match="7447 is not a folder"):
        make_private(planted)
    with pytest.raises(BadInput, match=r"cannot be read .*: is a fleet up"):
        make_private(folder / "nowhere" / "7447")
    with (
        pytest.raises(BadInput, match="7447 is not a folder"),
        ZenohTransport(configuration("star", (router_in(planted),))),
    ):
        pass


def test_the_limit_of_a_path_is_the_systems(folder: Path) -> None:
    """The longest accepted folder leaves space for the router's and the nodes' sockets; one byte more is rejected."""
    room = unix_sockets.MAX_PATH_LENGTH - len(str(folder)) - 1 - len("/0123456789.sock")
    longest = folder / ("x" * room)
    longest.mkdir(mode=0o700)
    router = router_in(longest)
    with ZenohTransport(configuration("router", listen=(router,))), ZenohTransport(configuration("direct", (router,))):
        assert max(len(str(each)) for each in longest.glob("*.sock")) == unix_sockets.MAX_PATH_LENGTH
    with pytest.raises(BadInput, match="takes 108 bytes, the limit is 107: set XDG_RUNTIME_DIR"):
        configuration("direct", (router_in(folder / ("x" * (room + 1))),))


def test_what_killed_processes_left_neither_blocks_nor_stays(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    meeting = folder / "f"
    meeting.mkdir(mode=0o700)
    router = router_in(meeting)
    killed = [listener("router", router), listener("direct", router)]
    for each in killed:
        each.send_signal(signal.SIGKILL)
        each.wait()
    assert len(list(meeting.glob("*.sock"))) == 2
    with pytest.raises(OSError, match="refused"):
        check_reachable(router)

    monkeypatch.setattr(unix_sockets, "_YOUNG_S", 3600.0)
    with ZenohTransport(configuration("router", listen=(router,))):
        check_reachable(router)
        with ZenohTransport(configuration("direct", (router,))):
            assert len(list(meeting.glob("*.sock"))) == 3
            remove_stale(meeting)
            assert len(list(meeting.glob("*.sock"))) == 3, "what is young may belong to who just opens it"
            monkeypatch.setattr(unix_sockets, "_YOUNG_S", 0.0)
            remove_stale(meeting)
            left = list(meeting.glob("*.sock"))
            assert len(left) == 2, "the living keep theirs"
            assert meeting / "router.sock" in left
            check_reachable(router)
    remove_stale(meeting)
    assert not meeting.exists()
    remove_stale(meeting)


def test_a_router_returns_where_its_predecessor_was_killed(folder: Path) -> None:
    router = router_in(folder)
    first = listener("router", router)
    with ZenohTransport(configuration("direct", (router,))) as peer:
        token = peer.declare_token("lab/token")
        first.send_signal(signal.SIGKILL)
        first.wait()
        second = listener("router", router)
        try:
            with ZenohTransport(configuration("star", (router,))) as client:
                wait_until(lambda: client.tokens("lab/*") == ["lab/token"], 20.0, "the peer joining the new router")
        finally:
            second.kill()
            second.wait()
            token.close()


def test_knocking(folder: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        check_reachable(f"tcp/127.0.0.1:{server.getsockname()[1]}")
    with pytest.raises(OSError, match="No such file"):
        check_reachable(router_in(folder))
