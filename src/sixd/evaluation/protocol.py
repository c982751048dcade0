"""Evaluation protocols: frozen, named, versioned values. A number is only comparable within one."""

from __future__ import annotations

import difflib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from sixd.errors import UsageError

if TYPE_CHECKING:
    from sixd.results.lint import CheckRules

ErrorName = Literal["vsd", "mssd", "mspd", "add", "adi", "ad"]
Unit = Literal["diameter", "mm", "px@640", "fraction"]
Kind = Literal["pose", "bbox", "segm"]
Task = Literal["localization", "detection", "single-instance"]
AverageOver = Literal["instances", "objects"]
Statistic = Literal["recall", "average-precision", "auc", "coco"]


def steps(first: float, last: float, step: float) -> tuple[float, ...]:
    """``first, first + step, ..., last`` as the very doubles BOP uses (0.15000000000000002).

    An error that lies exactly on a threshold is not below it, so the last bit counts.
    """
    return tuple(float(v) for v in np.arange(first, last + step / 2, step))


@dataclass(frozen=True)
class ErrorSpec:
    """One pose error, how it is normalised, and the thresholds it is held against."""

    name: ErrorName
    unit: Unit
    thresholds: tuple[float, ...]
    taus: tuple[float, ...] = ()
    """VSD only: misalignment tolerances, in diameters or in mm as ``tau_unit`` says."""
    tau_unit: Literal["diameter", "mm"] = "diameter"
    missing_depth_hides: bool = False
    """VSD only: a pixel without a reading hides the model (2018), or hides nothing (since 2019)."""
    suffix: str = ""
    """Distinguishes two uses of one error in one protocol (``mssd`` and ``mssd_mm``)."""

    @property
    def key(self) -> str:
        """Name in score keys: ``mssd``, ``mssd_mm``."""
        return self.name + self.suffix


@dataclass(frozen=True)
class EvalProtocol:
    """What is estimated, which estimates and instances count, which errors, which statistic."""

    name: str
    version: int
    """Raised whenever any number could change."""
    title: str
    kind: Kind
    task: Task
    statistic: Statistic
    targets_list: str
    """End of the name of its list of targets, which begins with the split: ``test_...``."""
    errors: tuple[ErrorSpec, ...] = ()
    score: str = ""
    """Key of the headline score: the mean of the scores of ``headline``."""
    headline: tuple[str, ...] = ()
    average_over: AverageOver = "instances"
    """Recall and AUC: pool all instances, or average the scores of objects. AP: always objects."""
    visib_min: float | None = None
    """Instances less visible are not targets; None: the targets file counts them."""
    cap_estimates: bool = False
    """Only the best N estimates of an image are scored; N comes from the dataset (100)."""
    absent_objects_count: bool = False
    """Estimates of objects that are not in the image are false positives."""
    reach_check: bool = True
    """Errors in mm are infinite, VSD is 1, where the two centres are a diameter apart (BOP)."""

    @property
    def id(self) -> str:
        """``name@version``."""
        return f"{self.name}@{self.version}"

    def targets_file_of(self, split: str) -> str:
        """Name of the list of targets in a dataset's folder: ``test_targets_bop19.json``."""
        return f"{split}_{self.targets_list}"

    def check_rules(self, split: str = "test") -> CheckRules:
        """What `sixd.check_file` is to hold a results file against."""
        from sixd.results.lint import CheckRules

        return CheckRules(
            targets_file=self.targets_file_of(split),
            kind=self.kind,
            cap=self.cap_estimates,
            every_target_object=self.task != "detection",
        )

    @property
    def needs_depth(self) -> bool:
        """Whether test depth images are read."""
        return any(e.name == "vsd" for e in self.errors)

    def with_errors(self, keys: tuple[str, ...]) -> EvalProtocol:
        """The same protocol restricted to some of its errors, by their keys.

        Raises:
            UsageError: a key is not among the protocol's errors, or none is given.
        """
        known = [e.key for e in self.errors]
        if not keys or set(keys) - set(known):
            raise UsageError(
                f"{self.name} measures {', '.join(known) or 'no pose errors'}; "
                f"got --errors {','.join(keys) or '(nothing)'}"
            )
        return replace(self, errors=tuple(e for e in self.errors if e.key in keys))


_FRACTIONS = steps(0.05, 0.50, 0.05)
_MSSD = ErrorSpec("mssd", "diameter", _FRACTIONS)
_MSSD_MM = ErrorSpec("mssd", "mm", steps(2, 20, 2), suffix="_mm")
_MSPD = ErrorSpec("mspd", "px@640", steps(5, 50, 5))
_VSD = ErrorSpec("vsd", "fraction", _FRACTIONS, taus=_FRACTIONS)

_BOP24_DETECTION = EvalProtocol(
    name="bop24-detection",
    version=1,
    title="6D detection, BOP Challenge 2024: AP of MSSD and MSPD, as the toolkit computes it",
    kind="pose",
    task="detection",
    statistic="average-precision",
    targets_list="targets_bop24.json",
    errors=(_MSSD, _MSPD, _MSSD_MM),
    score="AP",
    headline=("mssd", "mspd"),
    visib_min=0.1,
    cap_estimates=True,
)
_BOP22_DETECTION = EvalProtocol(
    name="bop22-detection2d",
    version=1,
    title="2D detection, BOP Challenge 2022-2024: COCO AP of amodal boxes, ignore flag honoured",
    kind="bbox",
    task="detection",
    statistic="coco",
    targets_list="targets_bop19.json",
    score="AP",
)

PROTOCOLS: dict[str, EvalProtocol] = {
    p.name: p
    for p in (
        EvalProtocol(
            name="bop19-localization",
            version=1,
            title="6D localization, BOP Challenge 2019-2024: AR of VSD, MSSD, MSPD",
            kind="pose",
            task="localization",
            statistic="recall",
            targets_list="targets_bop19.json",
            errors=(_VSD, _MSSD, _MSPD),
            score="AR",
            headline=("vsd", "mssd", "mspd"),
        ),
        _BOP24_DETECTION,
        replace(
            _BOP24_DETECTION,
            name="bop24-detection-strict",
            title="6D detection as the task is stated: objects absent from an image cost precision",
            absent_objects_count=True,
        ),
        replace(
            _BOP24_DETECTION,
            name="bop25-detection",
            title="6D detection, BOP Challenge 2025: AP of MSSD, in diameters and in mm",
            errors=(_MSSD, _MSSD_MM),
            headline=("mssd",),
        ),
        _BOP22_DETECTION,
        replace(
            _BOP22_DETECTION,
            name="bop22-segmentation2d",
            title="2D segmentation, BOP Challenge 2022-2024: COCO AP of visible masks",
            kind="segm",
        ),
        EvalProtocol(
            name="bop18-siso",
            version=1,
            title="6D localization of a single instance of a single object, BOP 2018 (ECCV)",
            kind="pose",
            task="single-instance",
            statistic="recall",
            targets_list="targets_bop18.json",
            errors=(
                ErrorSpec(
                    "vsd", "fraction", (0.3,), taus=(20.0,), tau_unit="mm", missing_depth_hides=True
                ),
            ),
            score="AR",
            headline=("vsd",),
            visib_min=0.1,
        ),
        EvalProtocol(
            name="linemod-add",
            version=1,
            title="LINEMOD's ADD(-S) below 0.1 diameters, mean over objects",
            kind="pose",
            task="localization",
            statistic="recall",
            targets_list="targets_bop19.json",
            errors=(ErrorSpec("ad", "diameter", (0.1,)),),
            score="AR",
            headline=("ad",),
            average_over="objects",
        ),
        EvalProtocol(
            name="ycbv-auc",
            version=1,
            title="YCB-Video's area under the accuracy curve of ADD and ADD-S up to 100 mm",
            kind="pose",
            task="localization",
            statistic="auc",
            targets_list="targets_bop19.json",
            errors=(
                ErrorSpec("add", "mm", (100.0,)),
                ErrorSpec("adi", "mm", (100.0,)),
                ErrorSpec("ad", "mm", (100.0,)),
            ),
            score="AUC",
            headline=("ad",),
            reach_check=False,
        ),
    )
}


def get_protocol(name: str | EvalProtocol) -> EvalProtocol:
    """The protocol of that name (``bop19-localization`` or ``bop19-localization@1``).

    Raises:
        UsageError: no such protocol; the message lists the nearest names.
    """
    if isinstance(name, EvalProtocol):
        return name
    base, _, version = name.partition("@")
    protocol = PROTOCOLS.get(base)
    if protocol is None:
        near = difflib.get_close_matches(base, PROTOCOLS, n=3, cutoff=0.3) or sorted(PROTOCOLS)
        raise UsageError(f"no protocol {name!r}; did you mean {', '.join(near)}?")
    if version and version != str(protocol.version):
        raise UsageError(f"this sixd has {protocol.id}, not {name}")
    return protocol


def default_protocol(results: str | Path) -> str:
    """Name of the protocol for results whose user names none, by what the file holds.

    Raises:
        FormatError: the file is neither a pose CSV nor COCO JSON.
        MissingDataError: there is no such file.
    """
    from sixd.results.reading import kind_of_results

    kinds = {"pose": "bop19-localization", "bbox": "bop22-detection2d",
             "segm": "bop22-segmentation2d"}  # fmt: skip
    return kinds[kind_of_results(results)]
