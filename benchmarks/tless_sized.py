"""A dataset as large as T-LESS: 1000 images of 720x540, 6400 instances, 30 symmetric objects.

Makes it (shapes like T-LESS's: a third with a continuous symmetry, most others with discrete ones;
depth by our renderer), then times localization with VSD on one estimate per instance, and detection
on 50,000 estimates, as whole `sixd eval` commands.

    python benchmarks/tless_sized.py [FOLDER]
"""

from __future__ import annotations

import json
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from machine import print_table, run_command, write_json

from sixd.datasets.writing import write_depth
from sixd.geometry.mesh import Mesh, mesh_diameter_mm, write_ply
from sixd.geometry.pose import Pose
from sixd.render import RenderMesh, render_crop
from sixd.results.pose_csv import write_pose_csv
from sixd.results.tables import PoseEstimates
from sixd.synth.surfaces import sheet, turn, weld

SIZE_PX = (720, 540)
K = np.array([[1075.65, 0, 360.0], [0, 1073.90, 270.0], [0, 0, 1]])
N_SCENES, IMAGES_PER_SCENE, N_OBJECTS, N_INSTANCES = 20, 50, 30, 6400
DEPTH_SCALE = 0.1
N_DETECTIONS = 50_000
RUNS = 3


def make_object(obj_id: int, rng: np.random.Generator) -> tuple[Mesh, dict[str, object]]:
    """A turned or lobed body of 3,000 to 15,000 vertices, and its models_info entry."""
    kind = obj_id % 3  # 0: continuous, 1: two- or four-fold, 2: two-fold or none
    fold = {0: 0, 1: (2, 4)[obj_id % 2], 2: (2, 1)[obj_id % 2]}[kind]
    n_rings, n_sectors = int(rng.integers(40, 80)), 4 * int(rng.integers(20, 48))
    z = np.linspace(-1, 1, n_rings)
    profile = np.sqrt(np.clip(1 - z**6, 0, None)) * (1 + 0.2 * np.sin(5 * z + rng.uniform(0, 6)))
    angles = turn(n_sectors)
    lobes = 1 + (0.25 * np.cos(fold * angles) if fold else 0 * angles)
    radius_mm = rng.uniform(20, 45) * profile[:, None] * lobes
    height_mm = rng.uniform(30, 60) * np.broadcast_to(z[:, None], radius_mm.shape)
    rings = np.stack([radius_mm * np.cos(angles), radius_mm * np.sin(angles), height_mm], axis=-1)
    surface = weld(sheet(rings))
    mesh = Mesh(surface.vertices_mm, surface.faces)
    low, high = mesh.vertices_mm.min(axis=0), mesh.vertices_mm.max(axis=0)
    info: dict[str, object] = {"diameter": mesh_diameter_mm(mesh.vertices_mm)}
    info |= {f"min_{a}": v for a, v in zip("xyz", low.tolist(), strict=True)}
    info |= {f"size_{a}": v for a, v in zip("xyz", (high - low).tolist(), strict=True)}
    if not fold:
        info["symmetries_continuous"] = [{"axis": [0, 0, 1], "offset": [0, 0, 0]}]
    elif fold > 1:
        turns = np.arange(1, fold) * 2 * np.pi / fold
        info["symmetries_discrete"] = [
            [np.cos(a), -np.sin(a), 0, 0, np.sin(a), np.cos(a), 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
            for a in turns
        ]
    return mesh, info


def random_rotations(n: int, rng: np.random.Generator) -> np.ndarray:
    q, r = np.linalg.qr(rng.normal(size=(n, 3, 3)))
    q *= np.sign(np.diagonal(r, axis1=1, axis2=2))[:, None]
    q[:, :, 0] *= np.linalg.det(q)[:, None]
    return q


def make_dataset(folder: Path, rng: np.random.Generator) -> tuple[Pose, np.ndarray]:
    """Write it in BOP's layout; returns the poses and their (scene, image, object) ids."""
    infos, meshes = {}, {}
    for obj_id in range(1, N_OBJECTS + 1):
        mesh, infos[obj_id] = make_object(obj_id, rng)
        write_ply(folder / f"models_eval/obj_{obj_id:06d}.ply", mesh)
        meshes[obj_id] = RenderMesh.build(mesh)
    (folder / "models_eval/models_info.json").write_text(json.dumps(infos))
    (folder / "dataset.toml").write_text('title = "T-LESS-sized"\nvsd_delta_mm = 15.0\n')
    n_images = N_SCENES * IMAGES_PER_SCENE
    image = np.sort(rng.integers(0, n_images, N_INSTANCES))
    ids = np.stack([image // IMAGES_PER_SCENE + 1, image % IMAGES_PER_SCENE,
                    rng.integers(1, N_OBJECTS + 1, N_INSTANCES)], axis=1)  # fmt: skip
    t_mm = np.stack([rng.uniform(-180, 180, N_INSTANCES), rng.uniform(-130, 130, N_INSTANCES),
                     rng.uniform(600, 850, N_INSTANCES)], axis=1)  # fmt: skip
    poses = Pose(random_rotations(N_INSTANCES, rng), t_mm)
    with ThreadPoolExecutor() as pool:
        rows_of_image = [np.flatnonzero(image == i) for i in range(n_images)]
        jobs = [(folder, i, rows, ids, poses, meshes) for i, rows in enumerate(rows_of_image)]
        visib = np.concatenate(list(pool.map(lambda job: write_image(*job), jobs)))
    write_annotations(folder, ids, poses, visib)
    return poses, ids


def write_image(folder: Path, image: int, rows: np.ndarray, ids: np.ndarray, poses: Pose,
                meshes: dict[int, RenderMesh]) -> np.ndarray:  # fmt: skip
    """Write one depth image with a wall at 1 m; returns how visible its instances are."""
    depth_mm = np.full(SIZE_PX[::-1], 1000.0)
    owner = np.full(depth_mm.shape, -1)
    n_all = np.ones(len(rows))
    for n, row in enumerate(rows):
        crop = render_crop(meshes[int(ids[row, 2])], poses[row], K, SIZE_PX)
        h, w = crop.depth_mm.shape
        part = (slice(crop.y0, crop.y0 + h), slice(crop.x0, crop.x0 + w))
        nearer = (crop.depth_mm > 0) & (crop.depth_mm < depth_mm[part])
        depth_mm[part][nearer] = crop.depth_mm[nearer]
        owner[part][nearer] = n
        n_all[n] = max((crop.depth_mm > 0).sum(), 1)
    scene, im_id = image // IMAGES_PER_SCENE + 1, image % IMAGES_PER_SCENE
    path = folder / f"test/{scene:06d}/depth/{im_id:06d}.png"
    write_depth(path, depth_mm, DEPTH_SCALE)
    return np.array([(owner == n).sum() for n in range(len(rows))]) / n_all


def write_annotations(folder: Path, ids: np.ndarray, poses: Pose, visib: np.ndarray) -> None:
    targets: dict[tuple[int, int, int], int] = {}
    for scene in range(1, N_SCENES + 1):
        camera = {i: {"cam_K": K.ravel().tolist(), "depth_scale": DEPTH_SCALE}
                  for i in range(IMAGES_PER_SCENE)}  # fmt: skip
        gt: dict[int, list[object]] = {i: [] for i in range(IMAGES_PER_SCENE)}
        info: dict[int, list[object]] = {i: [] for i in range(IMAGES_PER_SCENE)}
        for row in np.flatnonzero(ids[:, 0] == scene):
            _, im_id, obj_id = ids[row].tolist()
            gt[im_id].append({"cam_R_m2c": poses.R[row].ravel().tolist(),
                              "cam_t_m2c": poses.t_mm[row].tolist(), "obj_id": obj_id})  # fmt: skip
            info[im_id].append({"visib_fract": float(visib[row])})
            if visib[row] >= 0.1:
                key = (scene, im_id, obj_id)
                targets[key] = targets.get(key, 0) + 1
        place = folder / f"test/{scene:06d}"
        (place / "scene_camera.json").write_text(json.dumps(camera))
        (place / "scene_gt.json").write_text(json.dumps(gt))
        (place / "scene_gt_info.json").write_text(json.dumps(info))
    rows = [dict(zip(("scene_id", "im_id", "obj_id", "inst_count"), (*k, n), strict=True))
            for k, n in targets.items()]  # fmt: skip
    (folder / "test_targets_bop19.json").write_text(json.dumps(rows))
    images = [{"scene_id": s, "im_id": i} for s, i in dict.fromkeys((k[0], k[1]) for k in targets)]
    (folder / "test_targets_bop24.json").write_text(json.dumps(images))


def write_results(
    path: Path, poses: Pose, ids: np.ndarray, n: int, rng: np.random.Generator
) -> None:
    """The truth, each instance about equally often, turned and shifted by a few degrees and mm."""
    rows = np.arange(n) % len(ids)
    angles = rng.normal(0, np.deg2rad(8), (n, 3))
    skew = np.zeros((n, 3, 3))
    skew[:, 0, 1], skew[:, 0, 2], skew[:, 1, 2] = -angles[:, 2], angles[:, 1], -angles[:, 0]
    u, _, vt = np.linalg.svd(np.eye(3) + skew - np.swapaxes(skew, 1, 2))
    estimates = PoseEstimates.from_arrays(
        scene_id=ids[rows, 0], im_id=ids[rows, 1], obj_id=ids[rows, 2],
        score=np.round(rng.uniform(size=n), 4), R=(u @ vt) @ poses.R[rows],
        t_mm=poses.t_mm[rows] + rng.normal(0, 6, (n, 3)), time_s=np.full(n, 0.5),
    )  # fmt: skip
    write_pose_csv(path, estimates)


def main(folder: Path) -> None:
    rng = np.random.default_rng(0)
    if not (folder / "detection.csv").exists():
        folder.mkdir(parents=True, exist_ok=True)
        poses, ids = make_dataset(folder, rng)
        write_results(folder / "localization.csv", poses, ids, len(ids), rng)
        write_results(folder / "detection.csv", poses, ids, N_DETECTIONS, rng)
    rows = []
    for protocol, file in (("bop19-localization", "localization.csv"),
                           ("bop24-detection", "detection.csv")):  # fmt: skip
        command = [sys.executable, "-m", "sixd", "eval", str(folder / file), "--dataset",
                   str(folder), "--protocol", protocol, "--json"]  # fmt: skip
        run_command(command)
        runs = sorted((run_command(command) for _ in range(RUNS)), key=lambda r: r["wall_s"])
        rows.append({"protocol": protocol, "estimates": file, **runs[RUNS // 2]})
    print_table(rows)
    print(f"median of {RUNS} runs; written to {write_json('tless_sized', rows)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out/tless_sized")
