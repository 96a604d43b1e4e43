"""Stepping together: the simulation waits for its members, and a run repeats bit for bit."""
