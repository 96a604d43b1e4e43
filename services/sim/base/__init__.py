"""The driven base of one robot: whom it obeys, within which limits, by which parameters."""
