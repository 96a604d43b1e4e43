"""Writes a lot to its output, then beats."""

import sys

from tests.deploy.faulty.beating import beat_for, start

start()
for number in range(int(sys.argv[2])):
    print(f"{number:07} {'x' * 91}")
beat_for(60)
