"""A dataset is data: the form of `specs/*.toml` and of a user's own ``dataset.toml``.

A spec says what a folder cannot say of itself (which objects, which sensor is scored, the VSD
tolerance) and how its files are named. One reader serves all of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Literal

import msgspec

from sixd.datasets.ids import Ids
from sixd.errors import FormatError, Problem, UsageError

Size = tuple[int, int]
Truth = Literal["public", "private"]
Group = Literal["classic-core", "classic-extra", "h3", "industrial", "own"]

SPECS_DIR = Path(__file__).parent / "specs"
OWN_SPEC = "dataset.toml"
"""The one file a user may add to a dataset folder; its values win over all others."""


class SensorSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A camera: which images it takes and how its files are named.

    In ``suffix`` and ``image_dir``, ``{sensor}`` and ``{modality}`` stand for the names.
    """

    images: dict[str, str] = {}
    """Modality -> file extension: ``{rgb = ".png", depth = ".png"}``."""
    image_size_px: Size | dict[str, Size] | None = None
    """Width and height; by modality where they differ; read from the images if not given."""
    eval_modality: str = ""
    """Whose camera and truth are scored; by default the first modality that is not depth."""
    suffix: str = ""
    """Ends the names ``scene_gt<suffix>.json``, ``scene_camera<suffix>.json``, ``mask<suffix>``."""
    image_dir: str = "{modality}"
    """Folder of a modality's images inside a scene."""
    scenes: Ids | None = None
    """Scenes this sensor took; all by default."""

    @property
    def scored_modality(self) -> str:
        """The modality that is scored: the named one, or the first that is not depth."""
        colours = [m for m in self.images if m != "depth"]
        return self.eval_modality or next(iter(colours or self.images), "rgb")

    def size_px(self, modality: str) -> Size | None:
        """``(width, height)`` of a modality's images, if the spec knows it."""
        if isinstance(self.image_size_px, dict):
            return self.image_size_px.get(modality)
        return self.image_size_px


class FolderSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One folder of scenes: a split, or a split of some type."""

    dir: str = ""
    """Name of the folder; by default ``<split>`` or ``<split>_<type>``."""
    scenes: Ids | None = None
    sensors: list[str] = []
    """Names of ``[sensors]``; a folder that names none is read by its own structure."""
    eval_sensors: list[str] = []
    """Scored sensor; the first of these that took the scene. Needed where ``sensors`` has many."""


class SplitSpec(FolderSpec, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A split; its types inherit what they do not say themselves."""

    truth: Truth = "public"
    default_type: str = ""
    types: dict[str, FolderSpec] = {}

    def folder(self, split_type: str) -> FolderSpec:
        """The folder of a split type, with what it inherits; ``""`` is the split itself.

        A type that the spec does not list inherits nothing: its structure will tell.
        """
        if split_type and split_type not in self.types:
            return FolderSpec()
        own = self.types[split_type] if split_type else FolderSpec(dir=self.dir)
        return FolderSpec(
            dir=own.dir,
            scenes=self.scenes if own.scenes is None else own.scenes,
            sensors=own.sensors or self.sensors,
            eval_sensors=own.eval_sensors or ([] if own.sensors else self.eval_sensors),
        )


class DatasetSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """All that the code knows of a dataset. Every field may be left out of a ``dataset.toml``."""

    name: str = ""
    title: str = ""
    group: Group = "own"
    cite: str = ""
    objects: Ids | None = None
    """Object ids; by default those of the models folder."""
    symmetric_objects: Ids | None = None
    """Objects that the error ``ad`` compares by ADI; by default those with symmetries."""
    vsd_delta_mm: float | None = None
    """Tolerance of the visibility test in VSD; none where VSD is not defined."""
    max_estimates_per_image: int = 100
    """Cap of BOP's detection tasks: only the best-scored so many estimates of an image count."""
    models: str = "models"
    """Folder of the full models, which gt info and masks are made of."""
    models_eval: str = "models_eval"
    """Folder of the models that errors are measured on."""
    sensors: dict[str, SensorSpec] = {}
    splits: dict[str, SplitSpec] = {}


def known_datasets() -> list[str]:
    """Names of the datasets that have a spec, sorted."""
    return sorted(p.stem for p in SPECS_DIR.glob("*.toml"))


@cache
def load_spec(name: str) -> DatasetSpec:
    """The spec of a known dataset.

    Raises:
        UsageError: there is none of this name; says which come near.
        FormatError: the file is not a valid spec.
    """
    return build_spec(load_raw_spec(name), f"{name}.toml")


def load_raw_spec(name: str) -> dict[str, Any]:
    """The table of a known dataset as its TOML has it, for laying other tables over it."""
    path = SPECS_DIR / f"{name}.toml"
    if name not in known_datasets():
        raise UsageError(f"no dataset is called {name!r}{nearest(name, known_datasets())}")
    return read_toml(path)


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file as a table, already known to fit `DatasetSpec`.

    Raises:
        FormatError: it is not TOML or not of the form; names line or field.
    """
    import tomllib

    try:
        raw = tomllib.loads(path.read_text("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        line = re.search(r"line (\d+)", str(error))
        problem = Problem(
            "bad-toml", str(error), file=str(path), line=int(line[1]) if line else None
        )
        raise FormatError([problem]) from error
    _convert(raw, str(path))
    return raw


def build_spec(raw: Mapping[str, Any], file: str) -> DatasetSpec:
    """A spec from a table; ``file`` is named in errors.

    Raises:
        FormatError: a field is unknown or of a wrong type, or fields contradict each other; the
            latter are all named at once.
    """
    spec = _convert(raw, file)
    problems = list(_contradictions(spec, file))
    if problems:
        raise FormatError(problems)
    return spec


def merge(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Lay one table over another: sub-tables are merged, everything else is replaced."""
    merged = dict(below)
    for key, value in above.items():
        old = merged.get(key)
        both_tables = isinstance(old, Mapping) and isinstance(value, Mapping)
        merged[key] = merge(old, value) if both_tables else value  # type: ignore[arg-type]
    return merged


def nearest(name: str, names: list[str]) -> str:
    """The end of a message: which of ``names`` may have been meant."""
    import difflib

    close = difflib.get_close_matches(name.lower(), names, n=3, cutoff=0.5)
    if close:
        return f"; did you mean {' or '.join(close)}?"
    return f"; known: {', '.join(names)}" if names else ""


def _convert(raw: Mapping[str, Any], file: str) -> DatasetSpec:
    def decode_ids(kind: type, value: object) -> object:
        if kind is Ids:
            return Ids.parse(value)
        raise NotImplementedError(kind)

    try:
        return msgspec.convert(raw, DatasetSpec, dec_hook=decode_ids)
    except msgspec.ValidationError as error:
        raise FormatError([_misfit(raw, str(error), file)]) from error


def _misfit(raw: Mapping[str, Any], message: str, file: str) -> Problem:
    what, _, where = message.partition(" - at ")
    field = where.strip("`").removeprefix("$").lstrip(".")
    expected, got, fix = "", "", ""
    if match := re.match(r"Expected (.+?)(?:, got (.+))?$", what):
        expected, got = match[1].replace("`", ""), (match[2] or "").replace("`", "")
        what = "has a wrong value"
    elif match := re.match(r"Object contains unknown field `(.+)`", what):
        depth = field.count(".") + bool(field)
        forms = (SensorSpec, SplitSpec) if depth else (DatasetSpec,)
        fields = sorted({f.name for form in forms for f in msgspec.structs.fields(form)})
        field, what = (f"{field}." if field else "") + match[1], "is not a field of a dataset"
        fix = nearest(match[1], fields).lstrip("; ")
    return Problem("bad-spec", what, file=file, field=field, expected=expected, got=got, fix=fix)


def _contradictions(spec: DatasetSpec, file: str) -> Iterator[Problem]:
    def problem(field: str, what: str, expected: str = "", got: str = "") -> Problem:
        return Problem("bad-spec", what, file=file, field=field, expected=expected, got=got)

    stray = set(spec.symmetric_objects or ()) - set(spec.objects or spec.symmetric_objects or ())
    if stray:
        yield problem("symmetric_objects", "names ids that objects lacks", got=str(sorted(stray)))
    if spec.vsd_delta_mm is not None and not 0 < spec.vsd_delta_mm < float("inf"):
        yield problem("vsd_delta_mm", "must be positive", "millimetres", str(spec.vsd_delta_mm))
    if spec.max_estimates_per_image < 1:
        cap = str(spec.max_estimates_per_image)
        yield problem("max_estimates_per_image", "must be positive", "1 or more", cap)
    for name, sensor in spec.sensors.items():
        yield from _sensor_contradictions(f"sensors.{name}", name, sensor, problem)
    for split, split_spec in spec.splits.items():
        if split_spec.default_type and split_spec.default_type not in split_spec.types:
            types = ", ".join(split_spec.types)
            yield problem(f"splits.{split}.default_type", "is none of the types", types)
        for split_type in ("", *split_spec.types):
            field = f"splits.{split}" + (f".types.{split_type}" if split_type else "")
            yield from _folder_contradictions(field, split_spec.folder(split_type), spec, problem)


def _sensor_contradictions(
    field: str, name: str, sensor: SensorSpec, problem: Any
) -> Iterator[Problem]:
    for modality, extension in sensor.images.items():
        if not re.fullmatch(r"\.[a-z0-9]+", extension):
            where = f"{field}.images.{modality}"
            yield problem(where, "is not a file extension", ".png", extension)
    if sensor.eval_modality and sensor.images and sensor.eval_modality not in sensor.images:
        known = ", ".join(sensor.images)
        yield problem(f"{field}.eval_modality", "is not among the images", known)
    sizes = sensor.image_size_px
    for size in sizes.values() if isinstance(sizes, dict) else [sizes] if sizes else []:
        if min(size) < 1:
            yield problem(f"{field}.image_size_px", "must be positive", "[width, height]")
    for key in ("suffix", "image_dir"):
        pattern = getattr(sensor, key)
        left = pattern.replace("{sensor}", name).replace("{modality}", "rgb")
        if not re.fullmatch(r"[\w.-]*", left):
            expected = "letters, digits, _ . - {sensor} {modality}"
            yield problem(f"{field}.{key}", "is not part of a file name", expected, pattern)


def _folder_contradictions(
    field: str, folder: FolderSpec, spec: DatasetSpec, problem: Any
) -> Iterator[Problem]:
    if not folder.sensors:
        return  # the folder's structure will tell which there are
    for key, known in (("sensors", list(spec.sensors)), ("eval_sensors", folder.sensors)):
        unknown = [name for name in getattr(folder, key) if name not in known]
        if unknown:
            expected = ", ".join(known) or "a table [sensors.NAME]"
            yield problem(
                f"{field}.{key}", "names a sensor that is not there", expected, unknown[0]
            )
