"""Where a recording goes: always into its file, and to viewers on this machine where a port is free."""

from __future__ import annotations

import socket
from pathlib import Path

import rerun as rr
from rerun.blueprint import Blueprint

from services.runtime.errors import BadInput

HOST = "127.0.0.1"

PATIENCE_S = 5.0
"""Wall time given to the disk and the server to take what was sent."""


def open_sinks(
    stream: rr.RecordingStream, file: Path, footer: bool, port: int | None, memory_mib: int, layout: Blueprint
) -> tuple[str, str]:
    """Connect ``stream`` to ``file`` and, with a ``port``, to a server for viewers.

    Returns the viewer's URL and what is wrong with the live view; one of the two is empty, both without a port.
    Raises BadInput when the file cannot be written.
    """
    url, trouble = "", ""
    if port is not None and (trouble := _taken(port)) == "":
        server = rr.GrpcServerSink(HOST, port, server_memory_limit=f"{memory_mib}MiB")
        _connect(stream, layout, server, _file(file, footer))
        try:
            stream.flush(timeout_sec=PATIENCE_S)
            url = server.uri
        except RuntimeError as error:
            trouble = f"the server for viewers on {HOST}:{port} did not start: {error}"
    if not url:
        _connect(stream, layout, _file(file, footer))
    return url, trouble


def _file(file: Path, footer: bool) -> rr.FileSink:
    return rr.FileSink(file, write_footer=footer)


def _connect(stream: rr.RecordingStream, layout: Blueprint, *sinks: rr.GrpcServerSink | rr.FileSink) -> None:
    try:
        stream.set_sinks(*sinks, default_blueprint=layout)
    except RuntimeError as error:
        raise BadInput(f"the recording cannot be written: {error}") from None


def _taken(port: int) -> str:
    """Why the port cannot be had; empty when it can. Asked first, since rerun's server fails later and unseen."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            return f"no live view: port {port} of {HOST} is not free ({error.strerror}); is another logger running?"
    return ""
