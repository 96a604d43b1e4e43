"""The report of a run: its figures, checked against bounds, as a table, as report.json and as a picture."""
