"""Starts fleets, watches and grades them, and looks into them from the command line."""

VERSION = "0.1.0"
"""The version of this project; pyproject.toml states it for installers."""

INTERRUPTED = 130
"""Exit status of what was interrupted before its own end, as shells use it."""
