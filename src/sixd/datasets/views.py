"""Which sensor and modality of a folder is scored, and how its files are named."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from sixd.datasets.spec import DatasetSpec, FolderSpec, SensorSpec, Size, nearest
from sixd.errors import UsageError


@dataclass(frozen=True)
class View:
    """Which sensor and modality of a scene is scored, and how its files are named."""

    sensor: str
    modality: str
    suffix: str
    folders: Mapping[str, str]
    """Modality -> folder of its images."""
    extensions: Mapping[str, str]
    size_px: Size | None
    """As the spec has it; None where the images must tell."""


def scored_sensors(
    spec: DatasetSpec, folder: FolderSpec, sensor: str | None, modality: str | None, where: str
) -> tuple[str, ...]:
    """The sensors to be scored in a folder, with what the user asked for.

    Raises:
        UsageError: the folder has no such sensor or modality, or several and none is named.
    """
    if sensor is not None and sensor not in folder.sensors:
        raise UsageError(f"{where} has no sensor {sensor!r}{nearest(sensor, folder.sensors)}")
    if not folder.sensors:
        raise UsageError(f"{where}: the scene folders hold no scene_camera*.json")
    chosen = [sensor] if sensor is not None else folder.eval_sensors or folder.sensors
    if len(chosen) > 1 and not folder.eval_sensors:
        raise UsageError(
            f"{where} has several sensors: {', '.join(chosen)}\n    fix: say which is scored, "
            "by sensor=... or eval_sensors in its dataset.toml"
        )
    for name in chosen:
        if modality is not None and modality not in spec.sensors[name].images:
            has = list(spec.sensors[name].images)
            raise UsageError(
                f"{where}: sensor {name} has no {modality} images{nearest(modality, has)}"
            )
    return tuple(chosen)


def view_of(name: str, sensor: SensorSpec, modality: str | None) -> View:
    """A sensor's view, its file names spelled out; ``modality`` replaces the scored one."""
    scored = modality or sensor.scored_modality
    modalities = dict(sensor.images) or {scored: ".png"}

    def filled(pattern: str, modality: str) -> str:
        return pattern.replace("{sensor}", name).replace("{modality}", modality)

    return View(
        sensor=name,
        modality=scored,
        suffix=filled(sensor.suffix, scored),
        folders={m: filled(sensor.image_dir, m) for m in modalities},
        extensions=modalities,
        size_px=sensor.size_px(scored),
    )
