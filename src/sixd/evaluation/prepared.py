"""Models as the metrics want them, prepared once per object."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sixd.datasets.dataset import Dataset

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
            self._meshes[obj_id] = RenderMesh.build(self.dataset.model(obj_id).mesh)
        return self._meshes[obj_id]
