"""Beats once, then never comes back from a calculation."""

from tests.deploy.faulty.beating import beat, start

start()
beat()
while True:
    pass
