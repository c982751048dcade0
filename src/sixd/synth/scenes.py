"""Tabletop scenes: which objects lie where, and the cameras that look at them.

The world is in millimetres, z up, the table's top at z = 0 about the origin. Everything follows
from the seed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sixd.errors import UsageError
from sixd.geometry.pose import Floats, Pose, camera_pose
from sixd.synth.objects import BuiltinObject, turn_matrix

CLUSTER_RADIUS_MM = 150.0
"""Objects are put this near to the middle of the table: near enough to hide one another."""

CAMERA_CLEARANCE_MM = 100.0
"""No point of an object may be nearer to the camera's plane than this."""

_GAP_MM = 2.0
_TRIES = 400
_DIRECTIONS = 48


TRIES = 20
"""A crowded table is laid anew at most so often."""


@dataclass(frozen=True, eq=False)
class Placement:
    """One object on the table."""

    obj_id: int
    pose_w_m: Pose
    """Batch shape ``()``."""


@dataclass(frozen=True, eq=False)
class View:
    """One camera."""

    K: Floats
    """``(3, 3)`` pixels."""
    size_px: tuple[int, int]
    pose_c_w: Pose
    """Batch shape ``()``; x right, y down, z forward."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Objects and the views of them."""

    placements: tuple[Placement, ...]
    views: tuple[View, ...]


def make_scene(
    objects: Mapping[int, BuiltinObject],
    rng: np.random.Generator,
    *,
    n_instances: int,
    n_views: int,
    size_px: tuple[int, int],
    absent: int | None = None,
) -> Scene:
    """Put objects on the table and cameras around it.

    Args:
        objects: by object id; each is used once before any is used twice.
        rng: source of all that varies.
        n_instances: how many things lie there.
        n_views: how many images are taken.
        size_px: ``(w, h)`` of an image.
        absent: an object id to leave out, so that naming it in this scene is a mistake.

    Raises:
        UsageError: the table has no room, or a camera would stand among the objects.
    """
    known = [obj_id for obj_id in objects if obj_id != absent]
    again = rng.permutation(known).tolist() * -(-n_instances // len(known))
    placements = _placed_in_some_try(objects, [*known, *again][:n_instances], rng)
    first_deg = rng.uniform(0.0, 360.0)
    views = []
    for k in range(n_views):
        azimuth_deg = first_deg + 360.0 * k / n_views + rng.uniform(-25.0, 25.0)
        # Every second view is a low one, in which objects hide one another.
        elevation_deg = rng.uniform(14.0, 28.0) if k % 2 else rng.uniform(35.0, 60.0)
        target_mm = np.append(rng.uniform(-25.0, 25.0, 2), rng.uniform(10.0, 40.0))
        distance_mm = rng.uniform(400.0, 560.0)
        pose_c_w = look_at(target_mm, distance_mm, azimuth_deg, elevation_deg)
        views.append(View(kinect_like_camera(size_px), size_px, pose_c_w))
    scene = Scene(tuple(placements), tuple(views))
    check_in_front(objects, scene)
    return scene


def _placed_in_some_try(
    objects: Mapping[int, BuiltinObject], obj_ids: Sequence[int], rng: np.random.Generator
) -> list[Placement]:
    """`place`, begun anew where large objects that came first left no room."""
    for _ in range(TRIES - 1):
        try:
            return place(objects, obj_ids, rng)
        except UsageError:
            continue
    return place(objects, obj_ids, rng)


def place(
    objects: Mapping[int, BuiltinObject], obj_ids: Sequence[int], rng: np.random.Generator
) -> list[Placement]:
    """Rest each object on the table, none touching another.

    Raises:
        UsageError: there is no room for one of them.
    """
    taken: list[Floats] = []
    placements: list[Placement] = []
    for obj_id in obj_ids:
        rests = objects[obj_id].rests
        # Upright is as frequent as all other ways together.
        rest = 0 if rng.random() < 0.5 else int(rng.integers(len(rests)))
        R = turn_matrix("z", rng.uniform(0.0, 360.0)) @ rests[rest]
        vertices_mm = objects[obj_id].mesh.vertices_mm @ R.T
        reach_mm = footprint_reach_mm(vertices_mm)
        place_mm = _free_place(reach_mm, taken, rng)
        if place_mm is None:
            raise UsageError(
                f"no room on the table for {objects[obj_id].name} (object {obj_id}) beside "
                f"{len(placements)} others: place fewer or smaller objects"
            )
        taken.append(reach_mm + _directions() @ place_mm)
        t_mm = np.append(place_mm, -vertices_mm[:, 2].min())
        placements.append(Placement(obj_id, Pose(R, t_mm)))
    return placements


def footprint_reach_mm(vertices_mm: Floats) -> Floats:
    """How far points ``(V, 3)`` reach along each of 48 horizontal directions, ``(48,)`` mm."""
    reach: Floats = (vertices_mm[:, :2] @ _directions().T).max(axis=0)
    return reach


def apart(reach_a_mm: Floats, reach_b_mm: Floats, gap_mm: float = 0.0) -> bool:
    """Whether some upright plane separates two things by a gap, from their reaches."""
    return bool((reach_a_mm + np.roll(reach_b_mm, _DIRECTIONS // 2) < -gap_mm).any())


def look_at(
    target_mm: Floats, distance_mm: float, azimuth_deg: float, elevation_deg: float
) -> Pose:
    """Camera from world of an upright camera that looks at a point from a side and a height."""
    azimuth, elevation = np.deg2rad([azimuth_deg, elevation_deg])
    away = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    return camera_pose(target_mm + distance_mm * away, -away, right)


def kinect_like_camera(size_px: tuple[int, int]) -> Floats:
    """Intrinsics ``(3, 3)`` of a consumer depth camera, scaled to the image width."""
    width, height = size_px
    focal_px = 572.4 * width / 640
    return np.array([[focal_px, 0, width / 2], [0, focal_px, height / 2], [0, 0, 1.0]])


def check_in_front(objects: Mapping[int, BuiltinObject], scene: Scene) -> None:
    """Refuse a scene in which an object is behind a camera, or reaches into it.

    Raises:
        UsageError: names the first such object and view.
    """
    for k, view in enumerate(scene.views):
        for placement in scene.placements:
            pose_c_m = view.pose_c_w @ placement.pose_w_m
            z_mm = pose_c_m.apply(objects[placement.obj_id].mesh.vertices_mm)[:, 2].min()
            if z_mm < CAMERA_CLEARANCE_MM:
                raise UsageError(
                    f"object {placement.obj_id} reaches to z = {z_mm:.0f} mm before the camera of "
                    f"view {k}, must be at least {CAMERA_CLEARANCE_MM:.0f}: move the camera away"
                )


def _directions() -> Floats:
    angles = np.arange(_DIRECTIONS) * (2 * np.pi / _DIRECTIONS)
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def _free_place(
    reach_mm: Floats, taken: Sequence[Floats], rng: np.random.Generator
) -> Floats | None:
    """A free place within the cluster, rather near the middle."""
    angle = rng.uniform(0.0, 2 * np.pi, _TRIES)
    radius_mm = CLUSTER_RADIUS_MM * np.sqrt(rng.random(_TRIES))
    places = np.stack([radius_mm * np.cos(angle), radius_mm * np.sin(angle)], axis=-1)
    # Best of eight, again and again: a heap in the middle, but not always the same one.
    for some in places.reshape(-1, 8, 2):
        free = []
        for place_mm in some:
            here = reach_mm + _directions() @ place_mm
            if all(apart(here, other, _GAP_MM) for other in taken):
                free.append(place_mm)
        if free:
            return np.array(min(free, key=lambda p: float(np.hypot(*p))))
    return None
