"""Object models: diameter and symmetries from ``models_info.json``, the mesh when asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from sixd.datasets.ids import some
from sixd.datasets.jsonfiles import Id, read_json
from sixd.errors import FormatError, MissingDataError, Problem
from sixd.geometry import Symmetries

if TYPE_CHECKING:
    from sixd.geometry import Mesh
    from sixd.geometry.pose import Floats


@dataclass(frozen=True, eq=False)
class ObjectModel:
    """One object: what errors are measured on and normalised by."""

    obj_id: int
    path: Path
    """The mesh file; read only when `mesh` or `vertices_mm` is asked for."""
    diameter_mm: float
    symmetries: Symmetries
    info: Mapping[str, Any]
    """The object's entry of ``models_info.json``."""

    @cached_property
    def mesh(self) -> Mesh:
        """The whole mesh.

        Raises:
            MissingDataError: there is no such file.
            FormatError: it is broken.
        """
        from sixd.geometry.mesh import read_mesh

        return read_mesh(self.path)

    @cached_property
    def vertices_mm(self) -> Floats:
        """``(V, 3)``, read without the faces. Raises as `mesh` does."""
        from sixd.geometry.mesh import read_vertices

        return read_vertices(self.path)


class _Info(msgspec.Struct):
    """What must be right of an entry; `Symmetries` checks its own part."""

    diameter: float


def read_models_info(path: Path) -> dict[int, dict[str, Any]]:
    """Object id -> entry of a ``models_info.json``.

    Raises:
        MissingDataError: there is no such file.
        FormatError: entries have no positive diameter; all of them are named.
    """
    read_json(path, dict[Id, _Info])
    entries = read_json(path, dict[Id, dict[str, Any]])
    problems = [
        Problem(
            "bad-diameter",
            "is not a size",
            file=str(path),
            field=f'$["{obj_id}"].diameter',
            expected="millimetres, above 0",
            got=str(entry["diameter"]),
            fix="the largest distance between two vertices",
        )
        for obj_id, entry in entries.items()
        if not entry["diameter"] > 0
    ]
    if problems:
        raise FormatError(problems)
    return entries


def build_model(
    obj_id: int, info: Mapping[int, Mapping[str, Any]], info_path: Path, mesh_path: Path
) -> ObjectModel:
    """The model of one object.

    Raises:
        MissingDataError: ``info`` has no such object.
        FormatError: its symmetries are not rigid transforms or axes.
    """
    if obj_id not in info:
        raise MissingDataError(f"{info_path} has no object {obj_id}; it has {some(sorted(info))}")
    entry = info[obj_id]
    symmetries = Symmetries.from_models_info(entry, file=f"{info_path}, object {obj_id}")
    return ObjectModel(obj_id, mesh_path, float(entry["diameter"]), symmetries, entry)
