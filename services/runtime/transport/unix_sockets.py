"""Unix sockets that connect the nodes of one machine: their paths, and the protection from other users.

The sockets of a fleet are in a folder of mode 0700 owned by the user, named after the fleet's port. The folder protects
them: the kernel lets no other user (except root) connect to a socket in it (path_resolution(7)).
"""

from __future__ import annotations

import fcntl
import os
import socket
import stat
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from services.runtime.errors import BadInput
from services.runtime.user_folders import socket_suffix

PROTOCOL = "unixsock-stream"
"""Zenoh's protocol name for Unix sockets."""
ROUTER = "router.sock"
MAX_PATH_LENGTH = 107
"""Maximum bytes of a socket's path: sun_path has 108 with the terminating zero (unix(7))."""
_NODE = len("/0123456789.sock")
"""Bytes of the name of a node's own socket in the folder, with the slash; no name in it is longer."""
_YOUNG_S = 2.0
"""Wall time [s] within which a process that has created its lock file holds the lock."""


def socket_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder of the sockets of all fleets of this user.

    It is ``elea`` in XDG_RUNTIME_DIR (XDG base directory specification) if that belongs to this user, which it may not
    under ``sudo``. Otherwise it is ``elea-UID`` in the temporary folder. A home other than the account's adds a suffix.
    """
    suffix = socket_suffix(environment)
    given = Path(environment.get("XDG_RUNTIME_DIR", ""))
    try:
        if given.is_absolute() and given.stat().st_uid == os.geteuid():
            return given / f"elea{suffix}"
    except OSError:
        pass
    import tempfile  # here, since it is slow and rarely needed

    return Path(tempfile.gettempdir()) / f"elea-{os.geteuid()}{suffix}"


def router_endpoint(port: int, environment: Mapping[str, str] = os.environ) -> str:
    """Return the endpoint of the router of the fleet with this port, which is only a name: no TCP port is opened."""
    return router_in(socket_folder(environment) / str(port))


def router_in(folder: Path) -> str:
    """Return the endpoint of a router with its sockets in ``folder``, which only the user can enter."""
    return f"{PROTOCOL}/{folder / ROUTER}"


def node_endpoint(router: str, session: str) -> str:
    """Return the endpoint of a node's session that connects to ``router``, in the same folder."""
    return f"{PROTOCOL}/{node_socket(path_of(router).parent, session)}"


def node_socket(folder: Path, session: str) -> Path:
    """Return the path of a session's socket: its name is the beginning of the session's id of 32 hex digits."""
    return folder / f"{session[:10]}.sock"


def is_unix(endpoint: str) -> bool:
    """Return whether an endpoint is a Unix socket."""
    return endpoint.startswith(f"{PROTOCOL}/")


def path_of(endpoint: str) -> Path:
    """Return the path of a Unix socket's endpoint."""
    return Path(endpoint.partition("/")[2])


def check_path(text: str) -> None:
    """Raise BadInput for a path that cannot be a socket, or that Zenoh would split."""
    path = Path(text)
    if not path.is_absolute() or path.name in ("", "..") or any(each in text for each in "?#;"):
        raise BadInput(f"{text!r} is not the path of a socket: write {PROTOCOL}//absolute/path/router.sock")
    longest = max(len(os.fsencode(path)), len(os.fsencode(path.parent)) + _NODE)
    if longest > MAX_PATH_LENGTH:
        raise BadInput(
            f"the path {text} is too long for Unix sockets: the longest one in its folder takes {longest} bytes, the "
            f"limit is {MAX_PATH_LENGTH}: set XDG_RUNTIME_DIR (or TMPDIR) to a folder of yours with a shorter path"
        )


def make_private(folder: Path) -> None:
    """Check that only this user can access a folder of sockets; if it is in ``socket_folder``, create it first.

    Raises BadInput.
    """
    home = socket_folder()
    for each in (home, folder) if folder.parent == home else (folder,):
        try:
            if folder.parent == home:
                each.mkdir(mode=0o700)
        except FileExistsError:
            pass
        except OSError as error:
            raise BadInput(
                f"the folder {each} for Unix sockets cannot be created ({error.strerror}): "
                "set XDG_RUNTIME_DIR to a folder of yours"
            ) from None
        _check(each)


def check_reachable(endpoint: str, timeout: float = 2.0) -> None:
    """Raise OSError unless an endpoint (Unix or ``tcp``) accepts a connection within ``timeout`` [s]."""
    if is_unix(endpoint):
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
            probe.settimeout(timeout)
            probe.connect(str(path_of(endpoint)))
        return
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    socket.create_connection((host.strip("[]"), int(port)), timeout=timeout).close()


def remove_stale(folder: Path) -> None:
    """Remove the sockets left by killed processes in a fleet's folder, and the folder itself if it is then empty.

    Files that cannot be removed stay; they are harmless.
    """
    with suppress(OSError):
        for lock in folder.glob("*.sock.lock"):
            path = lock.with_suffix("")
            if not _is_young(lock) and not is_held(path):
                path.unlink(missing_ok=True)
                lock.unlink(missing_ok=True)
        folder.rmdir()


def is_held(path: Path) -> bool:
    """Return whether a process listens on this socket.

    Zenoh locks the file ``PATH.lock`` for as long as it listens; the kernel releases it when the process ends.
    """
    try:
        with _lock_of(path).open("rb") as file:
            fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
            return False
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True


def _lock_of(path: Path) -> Path:
    return path.with_name(f"{path.name}.lock")


def _is_young(lock: Path) -> bool:
    """Whether the process that created this file may not have locked it yet."""
    try:
        return time.time() - lock.stat().st_mtime < _YOUNG_S
    except FileNotFoundError:
        return False


def _check(folder: Path) -> None:
    try:
        found = folder.lstat()
    except OSError as error:
        raise BadInput(
            f"the folder {folder} for Unix sockets cannot be read ({error.strerror}): is a fleet up? "
            "A logout removes the files in XDG_RUNTIME_DIR"
        ) from None
    mode = stat.S_IMODE(found.st_mode)
    if not stat.S_ISDIR(found.st_mode):
        what = "a symbolic link" if stat.S_ISLNK(found.st_mode) else "not a folder"
        raise BadInput(f"{folder} is {what}, and Unix sockets need a folder there: remove it, if it is yours")
    if found.st_uid != os.geteuid():
        raise BadInput(
            f"the folder {folder} belongs to the user with uid {found.st_uid}, who could replace the "
            "router: set XDG_RUNTIME_DIR to a folder of yours, or name your own router with --connect"
        )
    if mode != 0o700:
        raise BadInput(
            f"the folder {folder} has mode {mode:04o}, so other users may reach the robots: chmod 700 {folder}"
        )
