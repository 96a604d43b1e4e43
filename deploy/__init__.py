"""Starts, supervises and grades fleets, and inspects them from the command line."""

VERSION = "0.1.0"
"""The version of this project; pyproject.toml states it for installers."""

INTERRUPTED = 130
"""Exit status of a run or command that was interrupted before its end, as in shells."""
