"""The world behind one Protocol, and PyBullet behind that."""
