"""Runs one fleet many times: every combination of varied values, a table row for each, and a picture of any figure."""
