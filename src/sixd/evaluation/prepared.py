"""Models as the metrics want them, prepared once per object."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sixd.datasets.dataset import Dataset
from sixd.errors import FormatError, Problem

if TYPE_CHECKING:
    from sixd.metrics.cells import VertexCells
    from sixd.render import RenderMesh


class PreparedModels:
    """What the metrics prepare once per object; shared by all workers and all batches."""

    def __init__(self, dataset: Dataset) -> None:
        self.dataset = dataset
        self._cells: dict[int, VertexCells] = {}
        self._meshes: dict[int, RenderMesh] = {}

    def cells(self, obj_id: int) -> VertexCells:
        """Vertices ordered for MSSD and MSPD."""
        from sixd.metrics.cells import VertexCells

        if obj_id not in self._cells:
            self._cells[obj_id] = VertexCells.build(self.dataset.model(obj_id).vertices_mm)
        return self._cells[obj_id]

    def mesh(self, obj_id: int) -> RenderMesh:
        """Mesh ordered for rendering."""
        from sixd.render import RenderMesh

        if obj_id not in self._meshes:
            model = self.dataset.model(obj_id)
            if not len(model.mesh.faces):
                problem = Problem(
                    "no-faces",
                    "the mesh has no faces, so VSD cannot render it",
                    file=str(model.path),
                    fix="give a mesh with triangles, or leave VSD out: --errors mssd,mspd",
                )
                raise FormatError([problem])
            self._meshes[obj_id] = RenderMesh.build(model.mesh)
        return self._meshes[obj_id]
