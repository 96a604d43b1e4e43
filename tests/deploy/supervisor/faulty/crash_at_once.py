"""Crashes before its first heartbeat."""

raise SystemExit("bad config")
