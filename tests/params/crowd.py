"""A client of the parameter service in a process of its own: it sets one value after the other as fast as it can."""

from __future__ import annotations

import json
import sys

from services.runtime.network.zenoh_config import configuration
from services.runtime.network.zenoh_transport import ZenohTransport
from services.runtime.process import end
from tests.params.sets import Asking, plain

OWN = "ss_Kp", "tr_Kp", "ref_angle", "offset"
"""The parameter of each client; all of them set ``window``, too."""


def crowd(endpoint: str, client: int, count: int) -> list[float]:
    """What was acknowledged of ``count`` sets."""
    own, acknowledged = OWN[client], []
    with ZenohTransport(configuration("star", (endpoint,), domain="crowd")) as transport:
        me = Asking(transport, timeout=30.0)
        for index in range(count):
            value = client + index / 1000
            answer = plain(me.set(request=f"{client}-{index}", window=index + 1, **{own: value}))
            assert answer[own] == value
            assert answer["window"] == index + 1
            acknowledged.append(value)
    return acknowledged


if __name__ == "__main__":
    print(json.dumps(crowd(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))), flush=True)
    end(0)
