"""Markers for messages and world bodies, and the bodies' footprints; for viewer, panel, report and grader."""
