"""A software rasteriser: depth of crops and images, and shaded scenes; no OpenGL, no GPU.

Compiled on first use. The definition in NumPy is `sixd.render.reference`.
"""

from sixd.render.clipping import NEAR_MM
from sixd.render.raster import Crop, RenderMesh, render_crop, render_depth
from sixd.render.scene import SceneObject, SceneRaster, rasterise_scene
from sixd.render.shading import Light, RenderedScene, render_scene

__all__ = [
    "NEAR_MM",
    "Crop",
    "Light",
    "RenderMesh",
    "RenderedScene",
    "SceneObject",
    "SceneRaster",
    "rasterise_scene",
    "render_crop",
    "render_depth",
    "render_scene",
]
