"""The file that says where the page is, for ``./elea panel``: readable by its owner alone, since it holds the token."""

from __future__ import annotations

import secrets
from pathlib import Path

import msgspec

from messages.base import DECODE_ERRORS
from services.runtime.atomic_file import write_atomic

ADDRESS_FILE = "panel.json"
"""Its name in the folder of a run."""


class Address(msgspec.Struct, frozen=True, kw_only=True):
    """Where the page is, and what opens it."""

    port: int
    token: str
    pid: int

    @property
    def url(self) -> str:
        """The address to open, token and all."""
        return f"http://127.0.0.1:{self.port}/?token={self.token}"


def write_address(path: Path, address: Address) -> None:
    """Put the file there, whole or not at all; raises OSError."""
    write_atomic(path, msgspec.json.encode(address), mode=0o600)


def read_address(path: Path) -> Address | None:
    """The address in a file, None when there is none."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Address)
    except (OSError, *DECODE_ERRORS):
        return None


def token_for(path: Path | None, port: int) -> str:
    """The token of an earlier life of this panel, so that its pages still count after a restart; else a new one.

    On another port it is a new one: who has taken the old port is shown the cookies of the pages that return there.
    """
    earlier = read_address(path) if path is not None else None
    kept = earlier is not None and earlier.port == port and len(earlier.token) >= 32
    return earlier.token if earlier is not None and kept else secrets.token_urlsafe(24)


def one_time_url(address: Address, within: float = 5.0) -> str:
    """An address that lets one browser in, once: it holds no token. Raises OSError when the page does not answer."""
    from http.client import HTTPConnection, HTTPException

    link = HTTPConnection("127.0.0.1", address.port, timeout=within)
    try:
        link.request("POST", "/ticket", headers={"Cookie": f"elea_panel_{address.port}={address.token}"})
        with link.getresponse() as answer:
            ticket = answer.read(200).decode("ascii", "replace")
            if answer.status != 200:
                raise OSError(f"the page refuses its own token ({answer.status})")
    except HTTPException as error:
        raise OSError(f"no answer of a web server ({error!r})") from None
    finally:
        link.close()
    return f"http://127.0.0.1:{address.port}/?once={ticket}"
