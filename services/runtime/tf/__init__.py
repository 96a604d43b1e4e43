"""Transforms between frames, from /tf and /tf_static, with tf2's semantics."""
