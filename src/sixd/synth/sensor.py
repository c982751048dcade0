"""What a depth camera makes of true depth: noise, steps, and pixels without a reading."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sixd.geometry.pose import Floats

DEPTH_SCALE = 0.1
"""Millimetres per stored step."""

_STEP_MM = 12.0
"""A jump in depth between neighbours beyond this (and beyond the surface's slope) is an edge."""


def sense_depth_mm(depth_mm: NDArray[np.floating], rng: np.random.Generator) -> NDArray[np.float32]:
    """Measured depth ``(H, W)``, mm, of true depth; 0 = no reading, as background stays.

    Noise grows with distance (under 1 mm at 0.6 m); readings are lost at half the pixels of depth
    edges, in a few round spots and, rarely, anywhere. Values are whole multiples of
    `DEPTH_SCALE`, bit for bit those that a reader of the stored image gets.
    """
    true_mm = np.asarray(depth_mm, dtype=np.float64)
    noise_mm = rng.standard_normal(true_mm.shape) * (0.25 + 1.2e-6 * true_mm**2)
    lost = rng.random(true_mm.shape) < 0.002
    lost |= _edges(true_mm) & (rng.random(true_mm.shape) < 0.5)
    lost |= _spots(true_mm.shape, rng)
    stored = np.rint((true_mm + noise_mm) / DEPTH_SCALE)
    stored[lost | (true_mm <= 0)] = 0
    return stored.astype(np.float32) * np.float32(DEPTH_SCALE)


def _edges(depth_mm: Floats) -> NDArray[np.bool_]:
    """Pixels beside a jump in depth."""
    edge = np.zeros(depth_mm.shape, dtype=bool)
    across = np.abs(np.diff(depth_mm, axis=1)) > _STEP_MM
    along = np.abs(np.diff(depth_mm, axis=0)) > _STEP_MM
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= along
    edge[:-1] |= along
    return edge


def _spots(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.bool_]:
    """A few round holes, as glossy spots leave them."""
    height, width = shape
    spots = np.zeros(shape, dtype=bool)
    for _ in range(6):
        y, x = rng.uniform(0, height), rng.uniform(0, width)
        radius = rng.uniform(0.004, 0.012) * width
        ys, xs = np.ogrid[:height, :width]
        spots |= ((ys + 0.5 - y) / 0.7) ** 2 + (xs + 0.5 - x) ** 2 < radius**2
    return spots
