"""The file with the page's address, for ``./elea panel``: readable only by its owner, since it contains the token."""

from __future__ import annotations

import secrets
from pathlib import Path

import msgspec

from messages.base import DECODE_ERRORS
from services.runtime.atomic_file import write_atomic

ADDRESS_FILE = "panel.json"
"""The file's name in the folder of a run."""


class Address(msgspec.Struct, frozen=True, kw_only=True):
    """The port of the page, its token, and the process id of the panel."""

    port: int
    token: str
    pid: int

    @property
    def url(self) -> str:
        """The URL of the page, including the token."""
        return f"http://127.0.0.1:{self.port}/?token={self.token}"


def write_address(path: Path, address: Address) -> None:
    """Write the file atomically; raises OSError."""
    write_atomic(path, msgspec.json.encode(address), mode=0o600)


def read_address(path: Path) -> Address | None:
    """Read the address from a file; None if it is missing or invalid."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Address)
    except (OSError, *DECODE_ERRORS):
        return None


def token_for(path: Path | None, port: int) -> str:
    """Return the token of this panel before a restart, so that its open pages stay valid; else a new one.

    On another port it is a new one: a program that has taken the old port receives the cookies of pages that reconnect.
    """
    earlier = read_address(path) if path is not None else None
    kept = earlier is not None and earlier.port == port and len(earlier.token) >= 32
    return earlier.token if earlier is not None and kept else secrets.token_urlsafe(24)


def one_time_url(address: Address, timeout: float = 5.0) -> str:
    """Request a URL that admits one browser once, without the token. Raises OSError if the page does not answer."""
    from http.client import HTTPConnection, HTTPException

    link = HTTPConnection("127.0.0.1", address.port, timeout=timeout)
    try:
        link.request("POST", "/ticket", headers={"Cookie": f"elea_panel_{address.port}={address.token}"})
        with link.getresponse() as answer:
            ticket = answer.read(200).decode("ascii", "replace")
            if answer.status != 200:
                raise OSError(f"the panel rejected its own token (HTTP {answer.status})")
    except HTTPException as error:
        raise OSError(f"port {address.port} did not answer as a web server ({error!r})") from None
    finally:
        link.close()
    return f"http://127.0.0.1:{address.port}/?once={ticket}"
