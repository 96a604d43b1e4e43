"""Markers: what is drawn of messages, and what bodies cover on the ground; for viewer, panel, report and grader."""
