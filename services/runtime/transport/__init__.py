"""The network behind one Protocol: Zenoh, or memory for tests."""
