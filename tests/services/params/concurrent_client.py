"""A client of the parameter service in a process of its own, which sets values as fast as it can."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from services.runtime.process import exit_now
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.waiting import wait_until
from tests.services.params.parameter_client import ParameterTestClient, value_dict

PARAMETER_OF_CLIENT = "ss_Kp", "tr_Kp", "ref_angle", "offset"
"""The parameter of each client; all of them also set ``window``."""


def set_repeatedly(endpoint: str, client: int, count: int) -> list[float]:
    """Set a value ``count`` times, once all clients are there; return the acknowledged values."""
    own, acknowledged = PARAMETER_OF_CLIENT[client], []
    with ZenohTransport(configuration("star", (endpoint,), domain="crowd")) as transport:
        me = ParameterTestClient(transport)
        Path(f"{client}.ready").touch()
        wait_until(lambda: len([*Path().glob("*.ready")]) == len(PARAMETER_OF_CLIENT), 60.0, "the other clients")
        for index in range(count):
            value = client + index / 1000
            answer = value_dict(me.set_with_retry(f"{client}-{index}", window=index + 1, **{own: value}))
            assert answer[own] == value
            assert answer["window"] == index + 1
            acknowledged.append(value)
    return acknowledged


if __name__ == "__main__":
    print(json.dumps(set_repeatedly(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))), flush=True)
    exit_now(0)
