"""Which pixels of a rendered object the sensor saw: the visibility rule of BOP19."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sixd.geometry.pose import Floats


def distance_image_mm(
    depth_mm: NDArray[np.floating], K: Floats, origin_px: tuple[int, int] = (0, 0)
) -> Floats:
    """Distances from the camera centre, from depths along z: ``(H, W)``, mm, 0 stays 0.

    Pixel coordinates are the integer indices, not pixel centres (BOP rules).

    Args:
        depth_mm: ``(H, W)``.
        K: ``(3, 3)``, pixels.
        origin_px: x and y, in the image that ``K`` belongs to, of the first pixel of ``depth_mm``.
    """
    depth = depth_mm.astype(np.float64)
    x = (np.arange(depth.shape[1]) + origin_px[0] - K[0, 2]) / K[0, 0]
    y = (np.arange(depth.shape[0]) + origin_px[1] - K[1, 2]) / K[1, 1]
    distance: Floats = depth * np.sqrt((x**2)[None, :] + (y**2)[:, None] + 1.0)
    return distance


def visible_mask(
    model_depth_mm: NDArray[np.floating],
    measured_depth_mm: NDArray[np.floating],
    K: Floats,
    delta_mm: float = 15.0,
    origin_px: tuple[int, int] = (0, 0),
) -> NDArray[np.bool_]:
    """Pixels at which the model is not behind what was measured, or nothing was measured.

    Source: BOP rules, visibility mode "bop19": distances are compared as float32.

    Args:
        model_depth_mm: ``(H, W)`` rendering of the object alone, 0 = background.
        measured_depth_mm: ``(H, W)`` of the sensor, 0 = no reading.
        K: ``(3, 3)``, pixels.
        delta_mm: how far behind the measurement the model may be.
        origin_px: x and y of the first pixel, when both are the same crop of an image.
    """
    model = distance_image_mm(model_depth_mm, K, origin_px).astype(np.float32)
    measured = distance_image_mm(measured_depth_mm, K, origin_px).astype(np.float32)
    seen: NDArray[np.bool_] = (model - measured <= delta_mm) | (measured == 0)
    seen &= model > 0
    return seen
