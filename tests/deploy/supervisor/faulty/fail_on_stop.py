"""Publishes heartbeats for a minute; fails with a traceback when it is asked to stop."""

import signal

from tests.deploy.supervisor.faulty.heartbeat import send_heartbeats, start


def _fail(*_: object) -> None:
    raise RuntimeError("it fails at the end")


signal.signal(signal.SIGINT, _fail)
start()
send_heartbeats()
