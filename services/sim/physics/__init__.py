"""The physics engine: the Protocol ``World``, and its implementations in PyBullet and in MuJoCo."""
