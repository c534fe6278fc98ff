"""Shapes, enclosing capsules and clearance, against FCL itself, coal and brute force."""

from __future__ import annotations

import importlib
import inspect
import math
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import fcl
import numpy as np
import pybullet_data
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.errors import RobotError, UnknownNameError
from armtempo.robots import Arm, Clearance, Shape, _clearance, kernels, shape_distance, static_shape

SHAPE_KINDS = ("capsule", "sphere", "box", "cylinder", "convex")

coal: Any = importlib.import_module("coal")  # without types of its own

DATA = Path(pybullet_data.getDataPath())
PLANAR = Path(__file__).parents[2] / "configs" / "robots" / "planar_two_link.urdf"
PANDA = DATA / "franka_panda" / "panda.urdf"


def random_pose(generator: np.random.Generator, reach: float = 1.0) -> Floats:
    T = np.eye(4)
    T[:3, :3] = Rotation.random(rng=generator).as_matrix()
    T[:3, 3] = generator.uniform(-reach, reach, 3)
    return T


def random_shape(generator: np.random.Generator, kind: str, reach: float = 1.0) -> Shape:
    count = {"capsule": 2, "sphere": 1, "box": 3, "cylinder": 2, "convex": 0}[kind]
    vertices = generator.normal(size=(12, 3)) * generator.uniform(0.02, 0.4, 3) if kind == "convex" else None
    size = generator.uniform(0.02, 0.6, count)
    return static_shape(kind, list(size), T_world=random_pose(generator, reach), vertices=vertices)


def surface(shape: Shape, generator: np.random.Generator) -> Floats:
    """Points of the shape, its extreme ones among them, in the link's frame."""
    if shape.vertices is not None:
        local = np.asarray(shape.vertices)
    elif shape.kind == "box":
        local = np.array(list(product((-0.5, 0.5), repeat=3))) * shape.size
    else:
        direction = generator.normal(size=(500, 3))
        if shape.kind == "cylinder":
            direction[:, 2] = 0
        local = shape.size[0] * direction / np.linalg.norm(direction, axis=1)[:, None]
        if shape.kind != "sphere":
            local[:, 2] += np.where(generator.random(500) < 0.5, -0.5, 0.5) * shape.size[1]
    return local @ shape.T_link_shape[:3, :3].T + shape.T_link_shape[:3, 3]


def axes(shapes: list[Shape]) -> tuple[Floats, Floats]:
    return np.array([shape.capsule[:2] for shape in shapes]), np.array([shape.capsule[2] for shape in shapes])


def pair(name: str = "slave", x: float = 0.85, urdf: Path = PLANAR, tip: str | None = None) -> tuple[Arm, Arm]:
    base = np.eye(4)
    base[0, 3] = x
    return (
        Arm.from_urdf(urdf, name="master", tip_link=tip),
        Arm.from_urdf(urdf, name=name, T_world_base=base, tip_link=tip),
    )


def links(arm: Arm, q: Floats) -> list[Floats]:
    """World poses by ``Shape.link``: the base comes last, at index -1."""
    return [*arm.link_poses(q), np.asarray(arm.T_world_base)]


def brute_force(a: Arm, q_a: Floats, b: Arm, q_b: Floats) -> float:
    T_a, T_b = links(a, q_a), links(b, q_b)
    return min(shape_distance(s, T_a[s.link], t, T_b[t.link]) for s in a.shapes for t in b.shapes)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), kind=st.sampled_from(["capsule", "sphere", "box", "cylinder", "convex"]))
def test_enclosing_capsule_holds_its_shape(seed: int, kind: str) -> None:
    generator = np.random.default_rng(seed)
    shape = random_shape(generator, kind)
    p0, p1, radius = shape.capsule
    for point in surface(shape, generator):
        assert kernels.segment_distance(point, point, p0, p1) <= radius + 1e-12
    assert shape.exact == (kind in ("capsule", "sphere"))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), kind=st.sampled_from(["capsule", "sphere", "box", "cylinder", "convex"]))
def test_points_bound_the_motion(seed: int, kind: str) -> None:
    generator = np.random.default_rng(seed)
    shape = random_shape(generator, kind)
    move = random_pose(generator, 0.1)

    def farthest(points: Floats) -> float:
        return float(np.linalg.norm(points @ move[:3, :3].T + move[:3, 3] - points, axis=1).max())

    # Capsules and spheres turn about their axis without moving their surface's distance field: the axis is what counts.
    points = np.array(shape.capsule[:2]) if shape.exact else surface(shape, generator)
    assert farthest(points) <= farthest(np.asarray(shape.points)) + 1e-9


def test_capsules_of_robot_links_are_tight() -> None:
    arm = Arm.from_urdf(PANDA, tip_link="panda_hand")
    for shape in arm.shapes:
        p0, p1, radius = shape.capsule
        volume = math.pi * radius**2 * (np.linalg.norm(p1 - p0) + 4 / 3 * radius)
        body = coal_hull(shape).computeVolume()
        assert body < volume < 3.2 * body, shape.link_name


def test_capsule_kernel_is_fcl_to_the_last_digits() -> None:
    generator = np.random.default_rng(0)
    worst = 0.0
    for _ in range(2000):
        a, b = (random_shape(generator, kind, 0.7) for kind in generator.choice(["capsule", "sphere"], 2))
        (axes_a, radius_a), (axes_b, radius_b) = axes([a]), axes([b])
        distance = kernels.segment_distance(*axes_a[0], *axes_b[0]) - radius_a[0] - radius_b[0]
        worst = max(worst, abs(distance - shape_distance(a, np.eye(4), b, np.eye(4))))
    assert worst < 1e-12


def test_segment_distance_special_cases() -> None:
    zero, x, y, z = np.zeros(3), *np.eye(3)
    assert kernels.segment_distance(zero, x, y, x + y) == 1  # parallel, side by side
    assert kernels.segment_distance(zero, x, 2 * x, 3 * x) == 1  # collinear
    assert kernels.segment_distance(zero, x, 0.5 * x, 3 * x) == 0  # overlapping
    assert kernels.segment_distance(-x, x, z - y, z + y) == 1  # crossing
    assert kernels.segment_distance(zero, zero, y, y) == 1  # points
    assert kernels.segment_distance(zero, zero, y - x, y + x) == 1


def test_segment_distance_of_nearly_parallel_segments() -> None:
    generator = np.random.default_rng(3)
    for tilt in 10.0 ** -np.arange(1, 17):
        p0, p1 = generator.normal(size=(2, 3))
        shift = np.cross(p1 - p0, generator.normal(size=3))
        shift *= 0.1 / np.linalg.norm(shift)
        q0, q1 = p0 + shift, p1 + shift + tilt * generator.normal(size=3)
        t = np.linspace(0, 1, 401)
        grid = (p0 + t[:, None] * (p1 - p0))[:, None] - (q0 + t[:, None] * (q1 - q0))[None]
        brute = float(np.linalg.norm(grid, axis=2).min())
        assert brute - 2e-4 < kernels.segment_distance(p0, p1, q0, q1) <= brute + 1e-12


def coal_hull(shape: Shape) -> Any:
    assert shape.vertices is not None
    points = coal.StdVec_Vec3s()
    for vertex in shape.vertices:
        points.append(vertex)
    return coal.Convex.convexHull(points, True, "Qt")


def test_hull_distances_are_sound_against_coal() -> None:
    arm = Arm.from_urdf(PANDA, tip_link="panda_hand")
    hulls = {id(shape): coal_hull(shape) for shape in arm.shapes}
    generator = np.random.default_rng(0)
    apart = 0
    for _ in range(400):
        a, b = (arm.shapes[k] for k in generator.integers(len(arm.shapes), size=2))
        T_a, T_b = random_pose(generator, 0.4), random_pose(generator, 0.4)
        result = coal.DistanceResult()
        places = [T @ s.T_link_shape for T, s in ((T_a, a), (T_b, b))]
        frames = [coal.Transform3s(T[:3, :3].copy(), T[:3, 3].copy()) for T in places]
        auditor = coal.distance(hulls[id(a)], frames[0], hulls[id(b)], frames[1], coal.DistanceRequest(), result)
        ours = shape_distance(a, T_a, b, T_b)
        assert ours <= max(auditor, 0.0) + 1e-6
        assert ours >= auditor - 5.1e-4
        apart += auditor > 0
    assert apart > 100


def coal_body(shape: Shape) -> Any:
    if shape.kind == "convex":
        return coal_hull(shape)
    return getattr(coal, shape.kind.capitalize())(*shape.size)


def coal_distance(a: Shape, b: Shape) -> float:
    frames = [coal.Transform3s(s.T_link_shape[:3, :3].copy(), s.T_link_shape[:3, 3].copy()) for s in (a, b)]
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    return float(coal.distance(coal_body(a), frames[0], coal_body(b), frames[1], request, result))


# Seeds of pairs that FCL's GJK reads too long, the worst of the first 3000 for their kinds.
OVER_READ = [
    ("capsule", "box", 716),
    ("capsule", "cylinder", 2897),
    ("sphere", "box", 806),
    ("sphere", "cylinder", 2252),
]


@pytest.mark.parametrize(("one", "other", "seed"), OVER_READ)
def test_clearance_is_sound_where_fcl_reads_too_long(one: str, other: str, seed: int) -> None:
    generator = np.random.default_rng(seed)
    a, b = random_shape(generator, one, 0.6), random_shape(generator, other, 0.6)
    truth = coal_distance(a, b)
    bodies = [
        fcl.CollisionObject(_clearance._geometry(s), fcl.Transform(s.T_link_shape[:3, :3], s.T_link_shape[:3, 3]))
        for s in (a, b)
    ]
    assert fcl.distance(*bodies, fcl.DistanceRequest(), fcl.DistanceResult()) > truth + 5e-4
    assert truth - 5.1e-4 <= shape_distance(a, np.eye(4), b, np.eye(4)) <= truth + 1e-6
    planar, _ = pair()
    bases = [replace(planar, name=name, shapes=(shape,)) for name, shape in (("one", a), ("other", b))]
    for told in (
        Clearance(bases).between(0, 1, np.zeros(2), np.zeros(2)),
        Clearance(bases).arms(np.zeros((2, 2))),
        Clearance(bases[:1], [b]).obstacles(0, np.zeros(2)),
    ):
        assert told.exact
        assert truth - 5.1e-4 <= told.distance <= truth + 1e-6


@settings(max_examples=250, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), one=st.sampled_from(SHAPE_KINDS), other=st.sampled_from(SHAPE_KINDS))
def test_distances_of_all_kinds_are_sound_against_coal(seed: int, one: str, other: str) -> None:
    generator = np.random.default_rng(seed)
    a, b = random_shape(generator, one, 0.6), random_shape(generator, other, 0.6)
    truth, told = coal_distance(a, b), shape_distance(a, np.eye(4), b, np.eye(4))
    if a.exact and b.exact:
        assert told == pytest.approx(truth, abs=1e-9)
    else:
        assert 0.0 <= told <= max(truth, 0.0) + 1e-6
        assert told >= truth - 5e-4 - 5e-6  # coal's own GJK of cylinders stops at some 1e-6


@pytest.mark.parametrize("kinds", [("box", "box"), ("box", "capsule"), ("cylinder", "convex"), ("convex", "sphere")])
def test_shape_distance_is_zero_when_they_overlap(kinds: tuple[str, str]) -> None:
    generator = np.random.default_rng(0)
    a, b = (random_shape(generator, kind) for kind in kinds)
    inside = np.linalg.inv(a.T_link_shape), np.linalg.inv(b.T_link_shape)
    assert shape_distance(a, inside[0], b, inside[1]) == 0.0
    assert shape_distance(a, inside[0], a, inside[0]) == 0.0


def test_capsule_overlap_is_negative() -> None:
    a = static_shape("capsule", (0.1, 1.0))
    b = static_shape("sphere", (0.2,), T_world=np.array([[1, 0, 0, 0.25], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))
    assert shape_distance(a, np.eye(4), b, np.eye(4)) == pytest.approx(-0.05, abs=1e-15)


@pytest.mark.parametrize(("urdf", "tip", "x", "count"), [(PLANAR, None, 0.85, 100), (PANDA, "panda_hand", 0.7, 15)])
def test_clearance_is_brute_force(urdf: Path, tip: str | None, x: float, count: int) -> None:
    arms = pair(urdf=urdf, tip=tip, x=x)
    clearance = Clearance(arms)
    generator = np.random.default_rng(0)
    low, high = np.maximum(arms[0].position_min, -3), np.minimum(arms[0].position_max, 3)
    for _ in range(count):
        q = generator.uniform(low, high, (2, arms[0].dof))
        nearest = clearance.between(0, 1, q[0], q[1])
        assert nearest.exact
        truth = brute_force(arms[0], q[0], arms[1], q[1])
        # Clearance keeps the capsule bound where it is the better one: never below the pair's own answer.
        assert truth - 1e-12 <= nearest.distance <= truth + 5e-4
        swapped = clearance.between(1, 0, q[1], q[0])
        assert swapped.distance == pytest.approx(nearest.distance, abs=5e-4)
        assert clearance.arms(q) == nearest
        bound = clearance.between(0, 1, q[0], q[1], cutoff=-math.inf)
        assert not bound.exact
        assert bound.distance <= nearest.distance + 1e-12
        for cutoff in (0.02, 0.1, 0.3):
            partial = clearance.between(0, 1, q[0], q[1], cutoff)
            if nearest.distance < cutoff:
                assert partial == nearest
            else:
                assert cutoff <= partial.distance <= nearest.distance + 1e-12


def test_bodies_are_named() -> None:
    arms = pair()
    wall = static_shape(
        "box",
        (0.1, 1.0, 1.0),
        T_world=np.array([[1, 0, 0, 0.7], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]),
        name="wall",
    )
    clearance = Clearance(arms, [wall])
    near = clearance.between(0, 1, np.zeros(2), np.array([math.pi / 2, 0]))
    assert (near.body_a, near.body_b) == ("master/link_2", "slave/link_1")
    assert near.distance == pytest.approx(0.85 - 0.6 - 0.01)
    hit = clearance.obstacles(0, np.zeros(2))
    assert (hit.body_a, hit.body_b) == ("master/link_2", "wall")
    assert hit.distance == pytest.approx(0.0445, abs=1e-6)  # 45 mm less FCL's tolerance
    assert clearance.obstacles(1, np.array([math.pi / 2, 0])).body_a == "slave/link_1"
    assert Clearance(arms).obstacles(0, np.zeros(2)) == (math.inf, "", "", True)


def test_self_collision_looks_at_links_without_a_common_joint() -> None:
    planar = Clearance(pair())
    assert planar.self_collision(0, np.zeros(2)).distance == math.inf
    arm = Arm.from_urdf(PANDA, tip_link="panda_hand")
    clearance = Clearance([arm])
    q = np.array([0, -0.5, 0, -2.0, 0, 1.6, 0.8])
    T = links(arm, q)
    shapes = arm.shapes
    truth = min(
        shape_distance(a, T[a.link], b, T[b.link])
        for k, a in enumerate(shapes)
        for b in shapes[k + 1 :]
        if abs(a.link - b.link) > 1
    )
    assert truth - 1e-12 <= clearance.self_collision(0, q).distance <= truth + 5e-4
    folded = np.array([0, 1.7, 0, -3.0, 0, 0.0, 0])
    assert clearance.self_collision(0, folded).distance == 0.0


def test_queries_do_not_disturb_each_other() -> None:
    arms = pair()
    clearance = Clearance(arms)
    q = np.random.default_rng(0).uniform(-3, 3, (20, 2, 2))
    once = [clearance.arms(x).distance for x in q]
    for x in q[::-1]:
        clearance.self_collision(1, x[0])
        clearance.obstacles(0, x[1], 0.1)
    assert once == [clearance.arms(x).distance for x in q]
    assert once == [Clearance(arms).arms(x).distance for x in q]


def test_wrong_joint_positions_are_refused() -> None:
    clearance = Clearance(pair())
    good = np.zeros(2)
    for q in (1.0, [1.0], np.zeros(3), np.zeros((1, 2))):
        with pytest.raises(RobotError, match="one value per joint"):
            clearance.between(0, 1, good, q)
    with pytest.raises(RobotError, match="not finite"):
        clearance.arms([good, [0.0, math.nan]])
    with pytest.raises(RobotError, match="one per arm"):
        clearance.arms([good])
    for i, j in ((0, 0), (0, 2), (-1, 0)):
        with pytest.raises(RobotError, match="two different numbers"):
            clearance.between(i, j, good, good)
    with pytest.raises(RobotError):
        clearance.obstacles(5, good)
    assert clearance.arms([good, good]).distance < 0.85


def test_wrong_shapes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'cylinder'"):
        static_shape("cylindre", (1, 1))
    for kind, size in (("box", (1, 1)), ("sphere", (-1,)), ("capsule", (0, 1)), ("cylinder", (1, math.nan))):
        with pytest.raises(RobotError, match=kind):
            static_shape(kind, size, name="post")
    with pytest.raises(RobotError, match=r"'post'.*no volume"):
        static_shape("convex", vertices=np.eye(3), name="post")
    with pytest.raises(RobotError, match=r"post.*cannot read"):
        static_shape("mesh", file=tmp_path / "no.stl", name="post")
    with pytest.raises(RobotError, match="not a rigid transform"):
        static_shape("sphere", (1,), T_world=np.full((4, 4), np.nan))


def test_fcl_is_used_where_it_is_right() -> None:
    # A box wholly inside another reads as 75 mm of clearance in an FCL BVH model; signed distance leaves the exact
    # capsule code; a reused result keeps the smallest distance it has seen. None of these may come back.
    source = inspect.getsource(_clearance)
    for word in ("fcl.BVHModel", "continuousCollide", "fcl.DynamicAABBTree"):
        assert word not in source
    assert not _clearance._REQUEST.enable_signed_distance
    corners = np.array(list(product((-0.5, 0.5), repeat=3)))
    outer = static_shape("convex", vertices=corners)
    inner = static_shape("convex", vertices=0.2 * corners)
    assert isinstance(_clearance._geometry(outer), fcl.Convex)
    assert shape_distance(outer, np.eye(4), inner, np.eye(4)) == 0.0


def chain(gap: float) -> str:
    """Three links in a row; the outer two carry spheres about the middle joints, ``gap`` apart when straight."""

    def link(name: str, x: float) -> str:
        inertial = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
        ball = f'<collision><origin xyz="{x} 0 0"/><geometry><sphere radius="0.1"/></geometry></collision>'
        return f'<link name="{name}">{inertial}{ball}</link>'

    def joint(name: str, parent: str, child: str, x: float) -> str:
        return (
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{x} 0 0"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        )

    return (
        '<robot name="chain"><link name="base"/>'
        + joint("j1", "base", "one", 0)
        + link("one", 0.0)
        + joint("j2", "one", "two", 0.05)
        + link("two", 0.0)
        + joint("j3", "two", "three", 0.05)
        + link("three", gap)
        + "</robot>"
    )


def test_own_links_that_always_touch_are_left_out_and_listed(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = tmp_path / "chain.urdf"
    for gap, always in ((0.05, True), (0.2, False)):  # of the second, folding alone brings them together
        file.write_text(chain(gap))
        arm = Arm.from_urdf(file)
        caplog.clear()
        with caplog.at_level("INFO", logger="armtempo"):
            clearance = Clearance([arm])
        touching = (("chain/one", "chain/three"),) if always else ()
        assert clearance.ignored_pairs(0) == touching
        assert clearance.self_pairs(0) == 1 - len(touching)
        assert [record.getMessage() for record in caplog.records] == [
            f"{a} and {b} touch wherever the joints are: left out" for a, b in touching
        ]
    assert Clearance([arm]).self_collision(0, [0.0, 0.0, np.pi]).distance < 0.0
    named = Clearance([Arm.from_urdf(file, ignored_pairs=[("three", "one")])])
    assert named.ignored_pairs(0) == (("chain/one", "chain/three"),)
    assert named.self_collision(0, [0.0, 0.0, np.pi]).distance == math.inf


@pytest.mark.parametrize("urdf", ["franka_panda/panda.urdf", "kuka_iiwa/model.urdf", "xarm/xarm6_robot.urdf"])
def test_no_pair_of_a_real_arm_is_left_out(urdf: str) -> None:
    tip = "panda_grasptarget" if "panda" in urdf else None
    arm = Arm.from_urdf(DATA / urdf, tip_link=tip, unphysical_inertia="point-mass")
    clearance = Clearance([arm])
    assert clearance.ignored_pairs(0) == ()
    middle = (arm.position_min + arm.position_max) / 2
    assert clearance.self_collision(0, middle).distance > 0.01
