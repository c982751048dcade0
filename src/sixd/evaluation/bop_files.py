"""The score files that bop_toolkit writes, under its names, for scripts that read them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from sixd.errors import UsageError
from sixd.evaluation.evaluation import Evaluation
from sixd.evaluation.protocol import EvalProtocol
from sixd.files import write_atomically

BOP_FILES = {
    "bop19-localization": "scores_bop19.json",
    "bop24-detection": "scores_bop24.json",
    "bop22-detection2d": "scores_bop22_coco_bbox.json",
    "bop22-segmentation2d": "scores_bop22_coco_segm.json",
}


def check_bop_files(
    protocol: EvalProtocol, errors: tuple[str, ...] | None, results: Sequence[Path]
) -> None:
    """Refuse, before anything is measured, what `write_bop_files` could not write.

    Raises:
        UsageError: the toolkit has no file for this protocol, errors are left out, or two results
            would get the same folder.
    """
    names = [_folder_name(path) for path in results]
    if len(set(names)) < len(names):
        raise UsageError(
            f"score files go into folders named after the results, and {', '.join(names)} repeat; "
            "score them one by one into different --bop-out folders"
        )
    if protocol.name not in BOP_FILES:
        raise UsageError(
            f"bop_toolkit writes no score file for {protocol.name}; it does for "
            f"{', '.join(BOP_FILES)}"
        )
    if errors is not None and len(protocol.with_errors(errors).errors) < len(protocol.errors):
        raise UsageError("bop_toolkit's score files need all errors: leave out --errors")


def write_bop_files(evaluation: Evaluation, folder: str | Path) -> Path:
    """Write ``FOLDER/<results name>/scores_*.json`` with the toolkit's keys.

    Raises:
        UsageError: the toolkit has no file for this protocol, or errors were left out.
    """
    protocol = evaluation.protocol.partition("@")[0]
    if protocol not in BOP_FILES:
        raise UsageError(
            f"bop_toolkit writes no score file for {protocol}; it does for {', '.join(BOP_FILES)}"
        )
    name = _folder_name(Path(evaluation.provenance.results_file))
    path = Path(folder) / name / BOP_FILES[protocol]
    text = json.dumps(bop_scores(evaluation), indent=2, sort_keys=True)
    return write_atomically(path, text.encode())


def _folder_name(results: Path) -> str:
    return results.name.partition(".")[0] or "results"


def bop_scores(evaluation: Evaluation) -> dict[str, float]:
    """The scores under the toolkit's keys.

    Raises:
        UsageError: errors were left out, so the file would not be the toolkit's.
    """
    scores, time_s = evaluation.scores, evaluation.average_time_per_image
    protocol = evaluation.protocol.partition("@")[0]
    try:
        if protocol == "bop19-localization":
            named = {
                f"bop19_average_recall_{e}": scores[f"AR_{e}"] for e in ("vsd", "mssd", "mspd")
            }
            named |= {"bop19_average_recall": scores["AR"], "bop19_average_time_per_image": time_s}
            return named
        if protocol == "bop24-detection":
            named = {f"bop24_mAP_{e}": scores[f"AP_{e}"] for e in ("mssd", "mspd", "mssd_mm")}
            named |= {"bop24_mAP": scores["AP"], "bop24_average_time_per_image": time_s}
            named |= {"bop25_mAP": scores["AP_mssd"], "bop25_mAP_mm": scores["AP_mssd_mm"]}
            return named
    except KeyError as error:
        raise UsageError(
            f"bop_toolkit's score file needs {error.args[0]}; score without --errors"
        ) from error
    return {**scores, "average_time_per_image": time_s}
