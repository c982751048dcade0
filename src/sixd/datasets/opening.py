"""From a folder or a known name to a `Dataset`.

Which facts come from where: a ``dataset.toml`` in the folder wins over everything; then the spec
of the known dataset the folder is named after (or that ``name`` in the ``dataset.toml`` says);
what neither tells is read from the folder's structure. What exists is always taken from the disk
(scenes, images, file extensions, a split folder without the default type's suffix), since that
cannot change a score. What defines a score (image size, VSD tolerance, objects, scored sensor,
cap) never yields silently: an image of another size than the spec says is an error.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sixd.datasets.dataset import Dataset
from sixd.datasets.spec import (
    OWN_SPEC,
    DatasetSpec,
    SplitSpec,
    build_spec,
    known_datasets,
    load_raw_spec,
    merge,
    nearest,
    read_toml,
)
from sixd.datasets.structure import names_in, read_structure, scene_folders, split_folders
from sixd.datasets.views import scored_sensors
from sixd.errors import UsageError

DEFAULT_VSD_DELTA_MM = 15.0
"""BOP's tolerance for all of its datasets but one; a ``dataset.toml`` may set another."""


def open_dataset(
    where: str | Path,
    split: str = "test",
    *,
    split_type: str | None = None,
    sensor: str | None = None,
    modality: str | None = None,
    bop_path: str | Path | None = None,
) -> Dataset:
    """Open a split of a dataset in BOP's scenewise layout; nothing but folders is read yet.

    Args:
        where: a folder, or a name that is looked up in ``bop_path``.
        split: ``test``, ``val``, ``train``.
        split_type: ``pbr``, ``primesense``, ...; by default the spec's.
        sensor: score this sensor instead of the dataset's own.
        modality: likewise for the modality.
        bop_path: folder of known datasets (``$BOP_PATH`` on the command line).

    Raises:
        UsageError: there is no such dataset, split, type, sensor or modality; names what is near.
        FormatError: the folder's ``dataset.toml`` is wrong.
    """
    path = _find(where, Path(bop_path) if bop_path is not None else None)
    own = _read_own(path)
    raw = merge(_base(path, own), own)
    file = str(path / OWN_SPEC) if own else f"{raw['name']}.toml"
    spec = build_spec(raw, file)
    split_type, folder = _split_folder(path, spec, split, split_type)
    declared = spec.splits.get(split, SplitSpec()).folder(split_type)
    if not declared.sensors:
        raw = merge(_with_structure(raw, folder, split, split_type), own)
        spec = build_spec(raw, file)
        declared = spec.splits[split].folder(split_type)
    chosen = scored_sensors(spec, declared, sensor, modality, str(folder))
    return Dataset(path, spec, split, split_type, folder, chosen, modality)


def _find(where: str | Path, bop_path: Path | None) -> Path:
    path = Path(where).expanduser()
    places = [path]
    if bop_path is not None and path.name == str(where):
        places.append(bop_path / path)
    folders = [p for p in places if p.is_dir()]
    if folders:
        # A folder here wins over one of that name in bop_path, unless it is no dataset at all.
        chosen = next((p for p in folders if len(folders) == 1 or split_folders(p)), folders[0])
        # The name tells which dataset it is, so "." and ".." need theirs; links keep their own.
        return chosen.resolve() if chosen.name in ("", "..") else chosen.absolute()
    known = known_datasets()
    if path.name in known:
        hint = (
            "\n    fix: give its folder, or set bop_path ($BOP_PATH) to the folder that holds it; "
            "download it first if it is not on this machine"
        )
    else:
        beside = names_in(bop_path) if bop_path else set()
        hint = nearest(path.name, sorted({*known, *beside}))
    looked = " and ".join(str(p.absolute()) for p in places)
    raise UsageError(f"no dataset {str(where)!r}: looked for {looked}{hint}")


def _read_own(path: Path) -> dict[str, Any]:
    file = path / OWN_SPEC
    return read_toml(file) if file.is_file() else {}


def _base(path: Path, own: dict[str, Any]) -> dict[str, Any]:
    name = own.get("name", path.name)
    if name in known_datasets():
        return load_raw_spec(name)
    base: dict[str, Any] = {"name": path.name, "vsd_delta_mm": DEFAULT_VSD_DELTA_MM}
    folders = names_in(path)
    if "models_eval" not in folders and "models" in folders:
        base["models_eval"] = "models"
    return base


def _split_folder(
    path: Path, spec: DatasetSpec, split: str, asked_type: str | None
) -> tuple[str, Path]:
    """The type and the folder of a split."""
    split_spec = spec.splits.get(split, SplitSpec())
    split_type = split_spec.default_type if asked_type is None else asked_type

    def folder_of(kind: str) -> Path:
        return path / (split_spec.folder(kind).dir or (f"{split}_{kind}" if kind else split))

    folder = folder_of(split_type)
    if scene_folders(folder):
        return split_type, folder
    if asked_type is None:
        # Many unpack the default type into a folder without its suffix: the same images.
        if scene_folders(folder_of("")):
            return split_type, folder_of("")
        found = [n for n in split_folders(path) if n.startswith(f"{split}_")]
        if split not in spec.splits and len(found) == 1:
            return found[0].removeprefix(f"{split}_"), path / found[0]
    raise UsageError(_no_split(path, spec, folder))


def _no_split(path: Path, spec: DatasetSpec, folder: Path) -> str:
    there = split_folders(path)
    message = f"{folder}: no such split with scenes in it"
    if there:
        return f"{message}; {path.name} has the splits {', '.join(there)}"
    if inside := [n for n in known_datasets() if split_folders(path / n)]:
        return f"{message}; {path} holds datasets: give one of {', '.join(inside)}"
    if scene_folders(path):
        return f"{message}; {path.name} is itself a split: give the folder that holds it"
    expected = ", ".join(spec.splits) or "test"
    return (
        f"{message}\n    expected: folders {expected} with scene folders 000001, 000002, ... that "
        "hold scene_camera.json\n    fix: download or unpack the split here"
    )


def _with_structure(
    raw: dict[str, Any], folder: Path, split: str, split_type: str
) -> dict[str, Any]:
    found = read_structure(folder)
    raw = dict(raw)
    # What the folder shows of a sensor replaces what a spec says of it in another split.
    raw["sensors"] = {**raw.get("sensors", {}), **found["sensors"]}
    described = found["split"]
    if split_type:
        described = {"types": {split_type: described}}
    return merge(raw, {"splits": {split: described}})
