"""Does its work in the given time [s], then ends with status 0."""

import sys

from tests.deploy.faulty.beating import beat_for, start

start()
beat_for(float(sys.argv[2]))
