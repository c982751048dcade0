"""Pose errors: `reference` defines them in NumPy, `fast` and `vsd` compute many, compiled."""
