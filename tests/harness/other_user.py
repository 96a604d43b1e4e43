"""A program run as another user of the machine, which tries to subscribe to a robot and drive it with plain Zenoh."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

NOBODY = 65534

# Imports come before the change of user: the other user may not be allowed to read this user's Python.
PROGRAM = """
import json, logging, os, queue, socket, sys, threading, time
import msgpack, zenoh
connect, listen, user, within_ms = sys.argv[1:]
os.setgroups([])
os.setgid(int(user))
os.setuid(int(user))
for path in json.loads(listen):
    try:
        with socket.socket(socket.AF_UNIX) as probe:
            probe.connect(path)
        print("in by", path, flush=True)
    except OSError as error:
        print(type(error).__name__, flush=True)
config = {"mode": "client", "connect": {"endpoints": [connect], "timeout_ms": int(within_ms), "exit_on_failure": True}}
config["scouting"] = {"multicast": {"enabled": False}}
try:
    session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
except zenoh.ZError as error:
    sys.exit(f"out: {error}")
odometry = session.declare_subscriber("tb3_0/odom")
print("heard", msgpack.unpackb(odometry.recv().payload.to_bytes())["child_frame_id"], flush=True)
while True:
    session.put("tb3_0/cmd_vel", msgpack.packb({"linear": {"x": 0.1}}))
    time.sleep(0.05)
"""


@contextmanager
def run_as_other_user(connect: str, paths: Sequence[str] = (), within: float = 3.0) -> Iterator[subprocess.Popen[str]]:
    """Run the program; it first tries to connect to the sockets at ``paths``, then for ``within`` [s] to ``connect``.

    Needs root, as in CI.
    """
    command = [sys.executable, "-I", "-c", PROGRAM, connect, json.dumps(list(paths)), str(NOBODY)]
    command.append(str(round(within * 1000)))
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
        try:
            yield program
        finally:
            program.kill()
