"""Two network namespaces joined by a virtual cable, as two machines; needs root, as in CI."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import NamedTuple

_HIDDEN = "mount -t tmpfs none '{folder}' && exec \"$@\""
"""Hides a folder's sockets, which two machines don't share."""


class NamespacePair(NamedTuple):
    """The names of both namespaces and the addresses of their ends."""

    near: str = f"elea-near-{os.getpid()}"
    far: str = f"elea-far-{os.getpid()}"
    near_address: str = "198.18.7.1"
    far_address: str = "198.18.7.2"

    @property
    def near_command(self) -> list[str]:
        """The prefix of a command that runs at the near end."""
        return ["ip", "netns", "exec", self.near]

    def far_command(self, hide: str) -> list[str]:
        """Return the prefix of a command that runs at the far end, where the folder ``hide`` appears empty."""
        return ["ip", "netns", "exec", self.far, "unshare", "-m", "sh", "-c", _HIDDEN.format(folder=hide), "sh"]


@contextmanager
def namespace_pair() -> Iterator[NamespacePair]:
    """Create both namespaces; delete them at the end."""
    made = NamespacePair()
    with ExitStack() as stack:
        for each in (made.near, made.far):
            _ip("netns", "add", each)
            stack.callback(_ip, "netns", "del", each)
        _ip("-n", made.near, "link", "add", "end", "type", "veth", "peer", "name", "end", "netns", made.far)
        for name, address in ((made.near, made.near_address), (made.far, made.far_address)):
            _ip("-n", name, "addr", "add", f"{address}/24", "dev", "end")
            for link in ("lo", "end"):
                _ip("-n", name, "link", "set", link, "up")
        yield made


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True)
