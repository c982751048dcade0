"""A software rasteriser: depth of crops and images, and shaded scenes; no OpenGL, no GPU.

`render_crop` and `render_depth` are compiled on first use; their definition in NumPy is
`sixd.render.reference`.
"""

from sixd.render.clipping import NEAR_MM
from sixd.render.raster import Crop, RenderMesh, render_crop, render_depth

__all__ = ["NEAR_MM", "Crop", "RenderMesh", "render_crop", "render_depth"]
