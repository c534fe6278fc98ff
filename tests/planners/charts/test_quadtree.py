"""Charts of two Pandas, whose links are hulls: cost, and audits by FCL, coal and PyBullet, which charts do not use."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import fcl
import numpy as np
import pybullet
import pytest
from numpy.typing import NDArray

from armtempo.arrays import Floats
from armtempo.errors import InputError
from armtempo.planners import CoordinationCell, CoordinationChart, JointPath
from armtempo.planners.charts import clearance_table, tabulated_clearance
from armtempo.planners.charts._arm_sweep import ArmSweep
from armtempo.robots import Arm, Clearance, Shape

Pair = tuple[tuple[Arm, Arm], tuple[JointPath, JointPath]]
FREE, UNDECIDED, BLOCKED = 0, 1, 2
D_MIN = 0.02

coal: Any = importlib.import_module("coal")  # without types of its own


@pytest.fixture(scope="module")
def pair(panda_pair: Callable[[int], Pair]) -> Pair:
    return panda_pair(4)


@pytest.fixture(scope="module")
def chart(pair: Pair) -> CoordinationChart:
    arms, paths = pair
    return CoordinationChart.build(arms[0], paths[0], arms[1], paths[1], D_MIN, 1 / 1024)


def samples(chart: CoordinationChart, count: int, seed: int = 3) -> tuple[Floats, NDArray[np.uint8]]:
    """Positions in decided cells, half of them within three cells of the border; and the cells' states."""
    generator = np.random.default_rng(seed)
    size = np.array([chart.length_a, chart.length_b])
    lam = generator.uniform(0.0, 1.0, (count, 2)) * size
    near = np.argwhere(chart.states == UNDECIDED)
    chosen = near[generator.integers(0, len(near), count // 2)] + generator.uniform(-3.0, 4.0, (count // 2, 2))
    lam[: count // 2] = np.clip(chosen * [chart.step_a, chart.step_b], 0.0, size)
    cells = np.minimum((lam / [chart.step_a, chart.step_b]).astype(int), chart.resolution - 1)
    states = chart.states[cells[:, 0], cells[:, 1]]
    return lam[states != UNDECIDED], states[states != UNDECIDED]


def test_cost_and_what_is_left_open(pair: Pair, chart: CoordinationChart) -> None:
    arms, paths = pair
    assert chart.resolution == 1024
    assert 0 < chart.share(UNDECIDED) < 0.03
    assert chart.share(BLOCKED) > 0.03
    assert 0 < chart.shape_queries < chart.pair_queries
    capsules = CoordinationChart.build(arms[0], paths[0], arms[1], paths[1], D_MIN, 1 / 1024, shapes="capsules")
    brute = len(arms[0].shapes) * len(arms[1].shapes) * 1024**2
    assert brute / capsules.pair_queries > 500
    assert capsules.shape_queries == 0
    assert capsules.share(BLOCKED) == 0.0
    assert (chart.states[capsules.states == FREE] == FREE).all()
    assert chart.share(FREE) > capsules.share(FREE) + 0.01  # what the capsules are too fat for
    with pytest.raises(InputError, match="shapes is 'hulls'"):
        CoordinationChart.build(arms[0], paths[0], arms[1], paths[1], D_MIN, 0.1, shapes="hulls")  # type: ignore[arg-type]


def test_fcl_finds_no_contradiction(pair: Pair, chart: CoordinationChart) -> None:
    """The benchmarks ask 200 000."""
    arms, paths = pair
    clearance = Clearance(arms)
    lam, states = samples(chart, 5000)
    q = [path.evaluate(column)[0] for path, column in zip(paths, lam.T, strict=True)]
    for state, one, other in zip(states, *q, strict=True):
        distance = clearance.between(0, 1, one, other, cutoff=chart.d_min).distance
        if state == FREE:
            assert distance >= chart.d_min - 1e-6
        else:
            assert distance + 5e-4 < chart.d_min  # FCL's own answer, before its tolerance is taken off
    assert (states == FREE).sum() > 1500
    assert (states == BLOCKED).sum() > 500


def coal_shape(shape: Shape) -> Any:
    if shape.vertices is None:
        return coal.Capsule(*shape.size)
    points = coal.StdVec_Vec3s()
    for vertex in shape.vertices:
        points.append(vertex)
    return coal.Convex.convexHull(points, True, "Qt")


def coal_distance(arms: tuple[Arm, ...], shapes: list[list[Any]], qs: list[Floats]) -> float:
    """Pair by pair: coal's managers return some pair's distance (research/coordination.md 1.3)."""
    placed = []
    for arm, own, q in zip(arms, shapes, qs, strict=True):
        links = [*arm.link_poses(q), np.asarray(arm.T_world_base)]
        placed.append(
            [(body, links[shape.link] @ shape.T_link_shape) for body, shape in zip(own, arm.shapes, strict=True)]
        )
    frames = [[(body, coal.Transform3s(T[:3, :3].copy(), T[:3, 3].copy())) for body, T in side] for side in placed]
    nearest: float = min(
        coal.distance(a, T_a, b, T_b, coal.DistanceRequest(), coal.DistanceResult())
        for a, T_a in frames[0]
        for b, T_b in frames[1]
    )
    return nearest


@pytest.mark.parametrize("which", ["pandas", "lee1991"])
def test_coal_finds_no_contradiction(
    pair: Pair, chart: CoordinationChart, lee1991: CoordinationCell, which: str
) -> None:
    (arms, paths), own = (pair, chart) if which == "pandas" else ((lee1991.arms, lee1991.paths), lee1991.chart)
    hulls = [[coal_shape(shape) for shape in arm.shapes] for arm in arms]
    lam, states = samples(own, 700 if which == "pandas" else 3000)
    for state, (lam_a, lam_b) in zip(states, lam, strict=True):
        distance = coal_distance(arms, hulls, [paths[0].evaluate(lam_a)[0], paths[1].evaluate(lam_b)[0]])
        if state == FREE:
            assert distance >= own.d_min - 1e-6
        else:
            assert distance < own.d_min + 1e-6
    assert min((states == FREE).sum(), (states == BLOCKED).sum()) > 50


@pytest.mark.parametrize("which", ["pandas", "lee1991"])
def test_pybullet_finds_no_contradiction(
    pair: Pair, chart: CoordinationChart, lee1991: CoordinationCell, which: str
) -> None:
    """Its hulls have a margin of 1 mm each: distances may be 2 mm short (research/coordination.md 1.2)."""
    (arms, paths), own = (pair, chart) if which == "pandas" else ((lee1991.arms, lee1991.paths), lee1991.chart)
    margin = 2.2e-3 if which == "pandas" else 1e-6
    client = pybullet.connect(pybullet.DIRECT)
    try:
        bodies, joints = [], []
        for arm in arms:
            T = arm.T_world_base
            half = 0.5 * np.arctan2(T[1, 0], T[0, 0])
            body = pybullet.loadURDF(
                str(arm.urdf), T[:3, 3], [0, 0, np.sin(half), np.cos(half)], useFixedBase=True, physicsClientId=client
            )
            number = {
                pybullet.getJointInfo(body, k, physicsClientId=client)[1].decode(): k
                for k in range(pybullet.getNumJoints(body, physicsClientId=client))
            }
            bodies.append(body)
            joints.append([number[name] for name in arm.joint_names])
        lam, states = samples(own, 1000)
        for state, place in zip(states, lam, strict=True):
            for body, numbers, path, value in zip(bodies, joints, paths, place, strict=True):
                for joint, angle in zip(numbers, path.evaluate(value)[0], strict=True):
                    pybullet.resetJointState(body, joint, angle, physicsClientId=client)
            points = pybullet.getClosestPoints(*bodies, own.d_min + 0.01, physicsClientId=client)
            distance = min((point[8] for point in points), default=np.inf)
            if state == FREE:
                assert distance >= own.d_min - margin
            else:
                assert distance < own.d_min + 1e-6
        assert min((states == FREE).sum(), (states == BLOCKED).sum()) > 50
    finally:
        pybullet.disconnect(client)


def test_tables_are_what_clearance_answers(pair: Pair) -> None:
    arms, paths = pair
    clearance = Clearance(arms)
    table = clearance_table(0, 1, arms, paths, 0.05)
    nodes = len(table.distance)
    generator = np.random.default_rng(1)
    close = np.argwhere(table.distance < 0.05)
    chosen = np.concatenate([close[generator.integers(0, len(close), 300)], generator.integers(0, nodes, (300, 2))])
    lam = [np.linspace(0.0, path.length, nodes) for path in paths]
    for a, b in chosen:
        truth = clearance.between(0, 1, paths[0].evaluate(lam[0][a])[0], paths[1].evaluate(lam[1][b])[0]).distance
        told = table.distance[a, b]
        assert told <= truth + 1e-6  # never clearer than it is
        assert told >= min(truth - 3e-4, 0.05)  # FCL's own error
    assert (table.distance[chosen[:, 0], chosen[:, 1]] < 0.02).sum() > 50


def test_between_nodes_tables_are_as_near_as_they_say(pair: Pair) -> None:
    arms, paths = pair
    clearance = Clearance(arms)
    table = clearance_table(0, 1, arms, paths, 0.05)
    cells = len(table.distance) - 1
    # from node to node no point travels farther than twice its displacement from the middle
    travel = [
        2.0 * ArmSweep.of(arm, path, cells).shape_moves[cells].max(axis=1)
        for arm, path in zip(arms, paths, strict=True)
    ]
    generator = np.random.default_rng(2)
    close = np.argwhere(np.abs(table.distance - 0.02) < 0.02)
    near = np.minimum(close[generator.integers(0, len(close), 500)], cells - 1) + generator.uniform(0, 1, (500, 2))
    for x, y in near:
        told = tabulated_clearance(table, x / cells, y / cells)
        truth = clearance.between(0, 1, paths[0].evaluate(x / cells)[0], paths[1].evaluate(y / cells)[0]).distance
        if min(told, truth) < 0.045:
            assert abs(told - truth) <= 0.5 * (travel[0][int(x)] + travel[1][int(y)]) + 3e-4


class Slide(JointPath):
    """A sliding joint from start to end."""

    def __init__(self, start: float, end: float) -> None:
        self.length, self.dof, self.breakpoints = 1.0, 1, np.array([0.0, 1.0])
        self._start, self._step = start, end - start

    def evaluate(self, lam: Any, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        lam = np.asarray(lam, dtype=np.float64)[..., None]
        return self._start + self._step * lam, np.full_like(lam, self._step), np.zeros_like(lam)

    def speed_bound(self, low: Any, high: Any) -> Floats:
        return np.full((*np.shape(low), 1), abs(self._step))


def test_a_head_on_sweep_is_blocked_whatever_fcls_continuous_collision_says(tmp_path: Any) -> None:
    """Two balls run through each other: FCL's LINEAR conservative advancement was seen to call such a sweep free."""
    urdf = tmp_path / "slider.urdf"
    urdf.write_text(
        """<robot name="slider"><link name="base"/><link name="ball">
        <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
        <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
        <joint name="slide" type="prismatic"><parent link="base"/><child link="ball"/><axis xyz="1 0 0"/>
        <limit lower="-5" upper="5" effort="1" velocity="1"/></joint></robot>"""
    )
    arms = tuple(Arm.from_urdf(urdf, name=name) for name in ("one", "two"))
    chart = CoordinationChart.build(arms[0], Slide(0.0, 1.0), arms[1], Slide(2.0, 0.5), 0.0, 1 / 256)
    lam = (np.arange(chart.resolution) + 0.5) / chart.resolution
    gap = np.abs(lam[:, None] - (2.0 - 1.5 * lam[None, :])) - 0.2
    decided = chart.states != UNDECIDED
    np.testing.assert_array_equal(chart.states[decided] == BLOCKED, gap[decided] < 0.0)
    assert chart.share(UNDECIDED) < 0.03
    assert not chart.is_free_along([0.0, 1.0], [0.0, 1.0])
    assert chart.is_free_along([0.0, 0.0, 1.0], [0.0, 0.3, 0.3])
    touch = lam[np.diag(gap) < 0.0]
    assert touch[0] == pytest.approx(0.72, abs=0.01)
    assert touch[-1] == pytest.approx(0.88, abs=0.01)
    balls = [fcl.CollisionObject(fcl.Sphere(0.1), fcl.Transform(np.array([x, 0.0, 0.0]))) for x in (0.0, 2.0)]
    request = fcl.ContinuousCollisionRequest(
        num_max_iterations=100,
        ccd_motion_type=fcl.CCDMotionType.CCDM_LINEAR,
        ccd_solver_type=fcl.CCDSolverType.CCDC_CONSERVATIVE_ADVANCEMENT,
    )
    ends = [fcl.Transform(np.array([x, 0.0, 0.0])) for x in (1.0, 0.5)]
    told = fcl.continuousCollide(balls[0], ends[0], balls[1], ends[1], request, fcl.ContinuousCollisionResult())
    assert 0.0 <= told <= 1.0  # an instant of the sweep, whichever: the chart above is right without it


def test_coals_managers_do_not_give_the_smallest_distance_of_capsules() -> None:
    """What they return is the distance of some pair (coal 3.0.3, pull request 885): no planner may use them."""
    generator = np.random.default_rng(0)
    wrong = 0
    for _ in range(20):
        sides = [
            [
                coal.CollisionObject(coal.Capsule(0.05, 0.2), np.eye(3), np.array([x, 0, 0]) + generator.normal(size=3))
                for _ in range(6)
            ]
            for x in (0.0, 1.0)
        ]
        smallest = min(
            coal.distance(a, b, coal.DistanceRequest(), coal.DistanceResult()) for a in sides[0] for b in sides[1]
        )
        managers = []
        for side in sides:
            manager = coal.DynamicAABBTreeCollisionManager()
            for body in side:
                manager.registerObject(body)
            manager.setup()
            managers.append(manager)
        callback = coal.DistanceCallBackDefault()
        managers[0].distance(managers[1], callback)
        told = callback.data.result.min_distance
        assert told >= smallest - 1e-9  # too long, never too short: the unsafe direction
        wrong += told > smallest + 1e-6
    if coal.__version__ == "3.0.3":
        assert wrong > 0
