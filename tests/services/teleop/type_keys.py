"""Types keys at given times: ``type_keys.py DESCRIPTOR [[KEY, SECONDS], ...]``; prints when each was typed."""

from __future__ import annotations

import json
import os
import sys
import time


def main(descriptor: int, events: list[tuple[str, float]]) -> None:
    """Write each key at its time [s] from now on; print their times [s, ``time.monotonic``]."""
    start, times = time.monotonic(), list[float]()
    for key, due in events:
        time.sleep(max(0.0, start + due - time.monotonic()))
        times.append(time.monotonic())
        os.write(descriptor, key.encode())
    print(json.dumps(times))


if __name__ == "__main__":
    main(int(sys.argv[1]), json.loads(sys.argv[2]))
