"""Which pixels of a rendered object the sensor saw: the visibility rule of VSD and of gt info."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sixd.geometry.pose import Floats


def distance_image_mm(
    depth_mm: NDArray[np.floating], K: Floats, origin_px: tuple[int, int] = (0, 0)
) -> Floats:
    """Depth along the optical axis -> distance from the camera centre, both ``(H, W)``, mm.

    Pixel i is taken to lie at i here, although renderings sample i + 0.5: the benchmark's numbers
    were made so (BOP rules 6).

    Args:
        depth_mm: 0 stays 0.
        K: ``(3, 3)``, px.
        origin_px: x and y, in the image that ``K`` belongs to, of the first pixel.
    """
    z = depth_mm.astype(np.float64)
    x = np.arange(z.shape[1]) + origin_px[0]
    y = np.arange(z.shape[0])[:, None] + origin_px[1]
    distances: Floats = np.sqrt(
        ((x - K[0, 2]) * z / K[0, 0]) ** 2 + ((y - K[1, 2]) * z / K[1, 1]) ** 2 + z**2
    )
    return distances


def visible(
    model_mm: Floats, measured_mm: Floats, delta_mm: float, *, missing_hides: bool = False
) -> NDArray[np.bool_]:
    """Where the model is rendered and not behind the measurement.

    Args:
        model_mm: ``(H, W)`` distance image of the object alone, 0 = background.
        measured_mm: likewise of the sensor, 0 = no reading; compared as float32 (BOP rules 6).
        delta_mm: how far behind the measurement the model may be.
        missing_hides: no reading hides the model, as in 2018; since 2019 it hides nothing.
    """
    behind = model_mm.astype(np.float32) - measured_mm.astype(np.float32)
    near = behind <= np.float32(delta_mm)
    is_missing = measured_mm == 0
    seen: NDArray[np.bool_] = near & ~is_missing if missing_hides else near | is_missing
    return seen & (model_mm > 0)


def visible_mask(
    model_depth_mm: NDArray[np.floating],
    measured_depth_mm: NDArray[np.floating],
    K: Floats,
    delta_mm: float = 15.0,
    origin_px: tuple[int, int] = (0, 0),
) -> NDArray[np.bool_]:
    """`visible` from depth images ``(H, W)`` instead of distance images; other args as there."""
    model_mm = distance_image_mm(model_depth_mm, K, origin_px)
    return visible(model_mm, distance_image_mm(measured_depth_mm, K, origin_px), delta_mm)
