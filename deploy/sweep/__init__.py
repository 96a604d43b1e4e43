"""Many runs of one fleet: every combination of what is varied, a row for each, and a picture of any figure."""
