"""The services of a fleet, each a process of its own, and the runtime on which they run."""

import messages as messages  # before msgspec: Ctrl-C would be lost otherwise, see there
