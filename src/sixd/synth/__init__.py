"""Synthetic data: built-in objects, tabletop scenes, and the demo benchmark made of them."""
