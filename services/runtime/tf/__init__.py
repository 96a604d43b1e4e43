"""Where any frame lies in any other, as told on /tf and /tf_static."""
