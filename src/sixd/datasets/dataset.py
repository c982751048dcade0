"""A split of a dataset in BOP's scenewise layout: lazy, cached, without the truth."""

from __future__ import annotations

from collections.abc import Collection
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from sixd.datasets import images
from sixd.datasets.cameras import read_cameras, size_in_cam_models
from sixd.datasets.frames import Frame, ImageCamera, Target
from sixd.datasets.ids import some
from sixd.datasets.models import ObjectModel, build_model, read_models_info
from sixd.datasets.spec import DatasetSpec, Size, nearest
from sixd.datasets.structure import IMAGE_EXTENSIONS, model_files, names_in, scene_folders
from sixd.datasets.targets import Targets, read_targets
from sixd.datasets.views import View, view_of
from sixd.errors import FormatError, MissingDataError, Problem, UsageError

Annotation = Literal["camera", "gt", "gt_info", "gt_coco", "gt_coco_modal"]


class Dataset:
    """One split; made by `open_dataset`."""

    def __init__(
        self,
        path: Path,
        spec: DatasetSpec,
        split: str,
        split_type: str,
        folder: Path,
        eval_sensors: Collection[str],
        modality: str | None = None,
    ) -> None:
        self.path = path
        self.spec = spec
        self.split = split
        self.split_type = split_type
        self.folder = folder
        """Where the scenes are."""
        self._eval_sensors = tuple(eval_sensors)
        self._modality = modality
        self._views: dict[int, View] = {}
        self._cameras: dict[int, dict[int, ImageCamera]] = {}
        self._images: dict[tuple[int, str], dict[int, str]] = {}
        self._models: dict[int, ObjectModel] = {}
        self._sizes: dict[tuple[str, str] | int, Size] = {}

    def __repr__(self) -> str:
        return f"Dataset({self.name!r}, {self.folder.name!r}, {len(self.scene_ids)} scenes)"

    # --- what it is ---

    @property
    def name(self) -> str:
        """Short name: the spec's for known datasets, else the folder's."""
        return self.spec.name

    @property
    def truth_is_public(self) -> bool:
        """Whether the truth of this split can be downloaded."""
        split = self.spec.splits.get(self.split)
        return split is None or split.truth == "public"

    @property
    def sensor(self) -> str | None:
        """The scored sensor; None where it depends on the scene."""
        sensors = {self.view(s).sensor for s in self.scene_ids}
        return sensors.pop() if len(sensors) == 1 else None

    @property
    def modality(self) -> str | None:
        """The scored modality; None where it depends on the scene."""
        modalities = {self.view(s).modality for s in self.scene_ids}
        return modalities.pop() if len(modalities) == 1 else None

    @property
    def image_size_px(self) -> Size | None:
        """``(width, height)`` of all scored images; None where it differs or cannot be told."""
        try:
            sizes = {self.image_size_of(s) for s in self.scene_ids}
        except MissingDataError:
            return None
        return sizes.pop() if len(sizes) == 1 else None

    @cached_property
    def has_depth(self) -> bool:
        """Whether any scene has depth images of the scored sensor."""
        return any(
            (self.scene_dir(s) / self.view(s).folders["depth"]).is_dir()
            for s in self.scene_ids
            if "depth" in self.view(s).folders
        )

    # --- scenes and images ---

    @cached_property
    def scene_ids(self) -> tuple[int, ...]:
        """Scenes on disk that a scored sensor took, in increasing order."""
        took = [self.spec.sensors[s].scenes for s in self._eval_sensors]
        present = scene_folders(self.folder)
        if None not in took:
            covered = {i for ids in took if ids is not None for i in ids}
            present = [s for s in present if s in covered]
        return tuple(present)

    def scene_dir(self, scene_id: int) -> Path:
        """Folder of a scene."""
        return self.folder / f"{scene_id:06d}"

    def view(self, scene_id: int) -> View:
        """What is scored in a scene.

        Raises:
            MissingDataError: no scored sensor took this scene.
        """
        if scene_id not in self._views:
            for name in self._eval_sensors:
                sensor = self.spec.sensors[name]
                if sensor.scenes is None or scene_id in sensor.scenes:
                    self._views[scene_id] = view_of(name, sensor, self._modality)
                    break
            else:
                raise MissingDataError(
                    f"{self.name} {self.split}: no scored sensor ({', '.join(self._eval_sensors)}) "
                    f"took scene {scene_id}"
                )
        return self._views[scene_id]

    def annotation_path(self, kind: Annotation, scene_id: int) -> Path:
        """``scene_<kind><suffix>.json`` of the scored sensor; it may not exist."""
        return self.scene_dir(scene_id) / f"scene_{kind}{self.view(scene_id).suffix}.json"

    def cameras(self, scene_id: int) -> dict[int, ImageCamera]:
        """Camera of each image of a scene, by image id; decoded once.

        Raises:
            MissingDataError: there is no camera file.
            FormatError: it is broken; names every wrong entry.
        """
        if scene_id not in self._cameras:
            self._cameras[scene_id] = read_cameras(self.annotation_path("camera", scene_id))
        return self._cameras[scene_id]

    def image_ids(self, scene_id: int) -> tuple[int, ...]:
        """Images of a scene, in increasing order."""
        return tuple(self.cameras(scene_id))

    def image_path(self, scene_id: int, im_id: int, modality: str | None = None) -> Path:
        """File of an image; by default of the scored modality. It may not exist.

        An image that is there with another extension than the spec's is found.
        """
        view = self.view(scene_id)
        modality = modality or view.modality
        if modality not in view.folders:
            raise MissingDataError(
                f"{self.name} scene {scene_id}: sensor {view.sensor} has no {modality} images, "
                f"only {', '.join(view.folders) or 'none'}"
            )
        expected = f"{im_id:06d}{view.extensions[modality]}"
        found = self.listed_images(scene_id, modality).get(im_id, expected)
        return self.scene_dir(scene_id) / view.folders[modality] / found

    def listed_images(self, scene_id: int, modality: str) -> dict[int, str]:
        """Image id -> file name of a modality's folder, listed once; empty if it is not there."""
        key = (scene_id, modality)
        if key not in self._images:
            view = self.view(scene_id)
            found: dict[int, str] = {}
            folder = view.folders.get(modality)
            for name in sorted(names_in(self.scene_dir(scene_id) / folder)) if folder else ():
                stem, dot, extension = name.rpartition(".")
                ours = dot + extension == view.extensions[modality]
                if (
                    stem.isascii()
                    and stem.isdigit()
                    and (
                        ours
                        or (dot + extension.lower() in IMAGE_EXTENSIONS and int(stem) not in found)
                    )
                ):
                    found[int(stem)] = name
            self._images[key] = found
        return self._images[key]

    def image_size_of(self, scene_id: int) -> Size:
        """``(width, height)`` of the scored images of a scene.

        Raises:
            MissingDataError: neither a spec nor an image tells it.
            FormatError: the spec and an image tell different sizes.
        """
        view = self.view(scene_id)
        key: tuple[str, str] | int = (view.sensor, view.modality) if view.size_px else scene_id
        if key not in self._sizes:
            self._sizes[key] = self._find_size(scene_id, view)
        return self._sizes[key]

    def _find_size(self, scene_id: int, view: View) -> Size:
        from_image: Size | None = None
        for modality in (view.modality, "depth"):
            if names := self.listed_images(scene_id, modality):
                first = self.image_path(scene_id, min(names), modality)
                from_image = images.image_size_px(first)
                break
        if view.size_px and from_image and view.size_px != from_image:
            raise FormatError([Problem(
                "wrong-image-size",
                f"is not of the size that the spec of {self.name} says, which MSPD and VSD rely on",
                file=str(first),
                expected=_times(view.size_px),
                got=_times(from_image),
                fix="rename the folder, or set sensors."
                f"{view.sensor}.image_size_px in its dataset.toml",
            )])  # fmt: skip
        size = (
            view.size_px
            or from_image
            or size_in_cam_models(self.annotation_path("camera", scene_id))
        )
        if size is None:
            raise MissingDataError(
                f"{self.scene_dir(scene_id)}: no image tells the image size\n    fix: set "
                f"sensors.{view.sensor}.image_size_px = [width, height] in "
                f"{self.path / 'dataset.toml'}"
            )
        return size

    # --- images ---

    def depth_mm(self, scene_id: int, im_id: int) -> NDArray[np.float32]:
        """Depth ``(H, W)`` in millimetres, 0 = no reading.

        Raises:
            MissingDataError: there is no such image, or no depth_scale of it.
            FormatError: the image is broken or of another size than the scored images.
        """
        scale = self._camera(scene_id, im_id).depth_scale
        if scale is None or scale <= 0:
            raise MissingDataError(
                f"{self.annotation_path('camera', scene_id)}: image {im_id} has no positive "
                "depth_scale, so its depth image has no unit"
            )
        path = self.image_path(scene_id, im_id, "depth")
        depth_mm = images.read_depth_mm(path, scale)
        size = (depth_mm.shape[1], depth_mm.shape[0])
        if size != self.image_size_of(scene_id):
            raise FormatError([Problem(
                "wrong-image-size", "is not of the size of the scored images", file=str(path),
                expected=_times(self.image_size_of(scene_id)), got=_times(size),
            )])  # fmt: skip
        return depth_mm

    def rgb(self, scene_id: int, im_id: int) -> NDArray[np.uint8]:
        """The scored image: ``(H, W, 3)`` RGB, or ``(H, W)`` where the file is grey.

        Raises:
            MissingDataError: there is no such image.
            FormatError: it is broken.
        """
        view = self.view(scene_id)
        if view.modality == "depth":
            raise MissingDataError(f"{self.name} scene {scene_id} has depth images only")
        return images.read_image(self.image_path(scene_id, im_id))

    def frame(self, scene_id: int, im_id: int, targets: Targets | None = None) -> Frame:
        """All that a method may see of an image.

        Raises:
            MissingDataError: the scene has no such image.
        """
        camera = self._camera(scene_id, im_id)
        view = self.view(scene_id)

        def listed(modality: str) -> bool:
            return im_id in self.listed_images(scene_id, modality)

        return Frame(
            scene_id,
            im_id,
            camera,
            tuple(Target(*t) for t in targets.of_image(scene_id, im_id)) if targets else (),
            (lambda: self.rgb(scene_id, im_id))
            if view.modality != "depth" and listed(view.modality)
            else None,
            (lambda: self.depth_mm(scene_id, im_id)) if listed("depth") else None,
        )

    def _camera(self, scene_id: int, im_id: int) -> ImageCamera:
        cameras = self.cameras(scene_id)
        if im_id not in cameras:
            path = self.annotation_path("camera", scene_id)
            raise MissingDataError(f"{path} has no image {im_id}; it has {some(cameras)}")
        return cameras[im_id]

    # --- objects ---

    @cached_property
    def models_dir(self) -> Path:
        """Folder of the models that errors are measured on."""
        return self.path / self.spec.models_eval

    @property
    def models_info_path(self) -> Path:
        """``models_info.json`` of the models that errors are measured on; it may not exist."""
        return self.models_dir / "models_info.json"

    @cached_property
    def models_info(self) -> dict[int, dict[str, Any]]:
        """Object id -> entry of ``models_info.json``. Raises as `model` does."""
        return read_models_info(self.models_info_path)

    @cached_property
    def model_files(self) -> dict[int, Path]:
        """Object id -> mesh file, of those that are there."""
        return model_files(self.models_dir)

    @cached_property
    def object_ids(self) -> tuple[int, ...]:
        """Objects of the dataset, in increasing order."""
        if self.spec.objects is not None:
            return tuple(self.spec.objects)
        return tuple(sorted({*self.model_files, *self.models_info}))

    def model(self, obj_id: int) -> ObjectModel:
        """An object; its mesh is not read yet.

        Raises:
            MissingDataError: there is no ``models_info.json``, or not this object in it.
            FormatError: ``models_info.json`` is broken.
        """
        if obj_id not in self._models:
            mesh = self.model_files.get(obj_id, self.models_dir / f"obj_{obj_id:06d}.ply")
            self._models[obj_id] = build_model(
                obj_id, self.models_info, self.models_info_path, mesh
            )
        return self._models[obj_id]

    def is_symmetric(self, obj_id: int) -> bool:
        """Whether the error ``ad`` compares this object by ADI instead of ADD."""
        if self.spec.symmetric_objects is not None:
            return obj_id in self.spec.symmetric_objects
        symmetries = self.model(obj_id).symmetries
        return bool(len(symmetries.discrete) or symmetries.axes)

    # --- tasks ---

    def targets(self, file: str | Path) -> Targets:
        """Read a target list: a name in the dataset's folder, or any path.

        Of a multi-view list, which names the sensor of each view, only the views of the scored
        sensor are kept: the same image id of another sensor is another image.

        Raises:
            MissingDataError: there is no such file; says which lists there are.
            FormatError: it is not a target list.
            UsageError: all its views are of other sensors.
        """
        path = self.path / file
        if not path.is_file() and Path(file).is_file():
            path = Path(file)
        if not path.is_file():
            lists = sorted(n for n in names_in(self.path) if n.startswith("test_targets"))
            raise MissingDataError(
                f"{path}: no such target list{nearest(path.name, lists)}\n    fix: name a list "
                "that is there, or download the dataset's base archive"
            )
        targets = read_targets(path)
        return targets if targets.sensor is None else self._of_scored_sensor(targets, path)

    def _of_scored_sensor(self, targets: Targets, path: Path) -> Targets:
        scored = {
            s: self.view(s).sensor for s in set(targets.scene_id.tolist()) & set(self.scene_ids)
        }
        sensors = targets.sensor or ()
        kept = [
            scored.get(scene_id) == sensor
            for scene_id, sensor in zip(targets.scene_id.tolist(), sensors, strict=True)
        ]
        if not any(kept):
            names = ", ".join(sorted(set(scored.values()) or set(self._eval_sensors)))
            raise UsageError(
                f"{path}: all views are of other sensors than the scored one\n"
                f"    expected: views of {names}\n"
                f"    got: views of {', '.join(sorted(set(sensors)))}\n"
                "    fix: open the dataset with sensor=..., or give another list"
            )
        return targets.where(np.array(kept, bool))


def _times(size: Size) -> str:
    return f"{size[0]}x{size[1]}"
