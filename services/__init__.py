"""The services of a fleet, each a process of its own, and the runtime on which they run."""

import messages as messages  # before msgspec, so that no Ctrl-C is lost: see there
