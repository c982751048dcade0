"""Results: pose estimates and 2D detections as columns, read, written, checked, mended."""

from sixd.results.coco_json import read_coco_json, write_coco_json
from sixd.results.fix import Change, FixReport, fix_file
from sixd.results.limits import Limits
from sixd.results.lint import CheckReport, CheckRules, check_file, check_table
from sixd.results.pose_csv import read_pose_csv, write_pose_csv
from sixd.results.reading import read_results
from sixd.results.tables import Detections, PoseEstimates, Rle
from sixd.results.writing import write_results

__all__ = [
    "Change",
    "CheckReport",
    "CheckRules",
    "Detections",
    "FixReport",
    "Limits",
    "PoseEstimates",
    "Rle",
    "check_file",
    "check_table",
    "fix_file",
    "read_coco_json",
    "read_pose_csv",
    "read_results",
    "write_coco_json",
    "write_pose_csv",
    "write_results",
]
