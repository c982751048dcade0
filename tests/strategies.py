"""Hypothesis strategies all rooms share: poses, symmetry groups, points, cameras, meshes."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sixd.geometry import Fisheye624Camera, Mesh, PinholeCamera, Pose, Symmetries, SymmetryAxis

IDENTITY = Pose.identity(1)
A_METRE_AWAY = np.array([0, 0, 1000.0])
CUBE_MM = np.array([[x, y, z] for x in (-50, 50) for y in (-50, 50) for z in (-50, 50)], float)

seeds = st.integers(0, 2**32 - 1)
"""For data that need not shrink: `numpy.random.default_rng(seed)`."""


def rotation(axis: np.ndarray, angle: np.ndarray | float) -> np.ndarray:
    """Rodrigues' formula; `(..., 3)` axes of any length and `(...)` angles in radians."""
    x, y, z = np.moveaxis(np.asarray(axis) / np.linalg.norm(axis, axis=-1, keepdims=True), -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*x.shape, 3, 3)
    sin, cos = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.eye(3) + sin * cross + (1 - cos) * (cross @ cross)


def random_poses(rng: np.random.Generator, n: int, spread_mm: float = 300.0) -> Pose:
    """Uniform rotations, in front of a camera 1 m away."""
    q = rng.normal(size=(n, 4))
    angle = 2 * np.arctan2(np.linalg.norm(q[:, 1:], axis=1), q[:, 0])
    t_mm = rng.uniform(-spread_mm, spread_mm, (n, 3)) + A_METRE_AWAY
    return Pose(rotation(q[:, 1:], angle), t_mm)


def near_poses(rng: np.random.Generator, gt: Pose, degrees: float, mm: float) -> Pose:
    """Each pose turned by up to `degrees` and moved by up to `mm` along each axis."""
    n = len(gt)
    turn = rotation(rng.normal(size=(n, 3)), np.radians(rng.uniform(0, degrees, n)))
    return Pose(turn @ gt.R, gt.t_mm + rng.uniform(-mm, mm, (n, 3)))


@st.composite
def poses(draw: st.DrawFn, n: int) -> Pose:
    """Batch shape `(n,)`; rotations include the identity and half turns, the simplest first."""
    axes = draw(hnp.arrays(float, (n, 3), elements=st.floats(-1, 1, width=32)))
    axes = np.where(np.linalg.norm(axes, axis=1, keepdims=True) < 1e-3, [0, 0, 1.0], axes)
    angles = draw(hnp.arrays(float, (n,), elements=st.floats(0, 2 * np.pi)))
    t_mm = draw(hnp.arrays(float, (n, 3), elements=st.floats(-250, 250)))
    return Pose(rotation(axes, angles), t_mm + A_METRE_AWAY)


@st.composite
def symmetries(draw: st.DrawFn, max_axes: int = 2) -> Symmetries:
    """None, discrete ones (a cyclic group and others), axes with offsets, and both."""
    listed = [IDENTITY[:0]]
    if order := draw(st.sampled_from([0, 2, 3, 4])):
        turns = SymmetryAxis(np.array([0, 0, 1.0]), np.zeros(3)).rotations(order)
        listed.append(turns[1:])
    if draw(st.booleans()):
        moved = draw(poses(1))
        listed.append(Pose(moved.R, moved.t_mm - A_METRE_AWAY))
    R, t_mm = (np.concatenate([getattr(p, k) for p in listed]) for k in ("R", "t_mm"))
    points = st.tuples(*[st.floats(-20, 20)] * 3).map(np.array)
    directions = st.sampled_from([*np.eye(3), np.array([1.0, 2, 3]), np.array([0, -1.0, 1])])
    axes = st.lists(st.builds(SymmetryAxis, directions, points), max_size=max_axes)
    return Symmetries(Pose(R, t_mm), tuple(draw(axes)))


@st.composite
def symmetry_groups(draw: st.DrawFn) -> Pose:
    """A true group, batch shape `(S,)`, identity first: closed under product and inverse."""
    order = draw(st.sampled_from([1, 2, 3, 4, 6]))
    axis = draw(st.sampled_from([[0, 0, 1.0], [1.0, 0, 0], [1.0, 1.0, 1.0]]))
    offset_mm = draw(st.tuples(*[st.floats(-20, 20)] * 3))
    return SymmetryAxis(np.array(axis), np.array(offset_mm)).rotations(order)


@st.composite
def points(draw: st.DrawFn, min_size: int = 1, max_size: int = 40) -> np.ndarray:
    """`(V, 3)` mm, a decimetre in size; repeats, lines and planes occur."""
    n = draw(st.integers(min_size, max_size))
    coarse = st.integers(-5, 5).map(lambda i: 20.0 * i)
    return draw(hnp.arrays(float, (n, 3), elements=st.one_of(coarse, st.floats(-100, 100))))


@st.composite
def pinhole_cameras(draw: st.DrawFn) -> PinholeCamera:
    """Of a VGA image, now and then with skew."""
    fx, fy = draw(st.tuples(*[st.floats(300, 2000)] * 2))
    cx, cy = draw(st.tuples(*[st.floats(100, 500)] * 2))
    skew = draw(st.sampled_from([0.0, 0.0, 3.5]))
    return PinholeCamera(np.array([[fx, skew, cx], [0, fy, cy], [0, 0, 1.0]]))


@st.composite
def fisheye_cameras(draw: st.DrawFn) -> Fisheye624Camera:
    """Of the size and the distortion HOT3D's cameras have."""
    f = draw(st.floats(240, 620))
    k = draw(hnp.arrays(float, (6,), elements=st.floats(-1, 1))) * [0.4, 0.3, 0.1, 0.02, 3e-3, 1e-4]
    rest = draw(hnp.arrays(float, (6,), elements=st.floats(-1, 1))) * 1e-3
    return Fisheye624Camera(np.concatenate([[f, 700, 705], k, rest]))


@st.composite
def meshes(draw: st.DrawFn) -> Mesh:
    """Any valid mesh, with and without each attribute; not a sensible surface."""
    vertices_mm = draw(points())
    n = len(vertices_mm)
    indices = st.integers(0, n - 1)
    faces = draw(hnp.arrays(np.int32, (draw(st.integers(0, 12)), 3), elements=indices))
    numbers = st.floats(-1e6, 1e6)

    def maybe(shape: tuple[int, ...]) -> np.ndarray | None:
        return draw(st.one_of(st.none(), hnp.arrays(float, shape, elements=numbers)))

    colors = draw(st.one_of(st.none(), hnp.arrays(np.uint8, (n, 3))))
    corner_uv = maybe((len(faces), 3, 2)) if len(faces) else None
    return Mesh(vertices_mm, faces, maybe((n, 3)), colors, maybe((n, 2)), None, corner_uv)
