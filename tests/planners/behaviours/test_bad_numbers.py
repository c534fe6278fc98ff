"""Numbers that are none, or absurd: they are refused at once, and whatever slips in certifies nothing."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.errors import ActionError, ArmtempoError, InfeasibleError, InputError, PathError, RobotError
from armtempo.planners import (
    AbstractJointPath,
    Arc,
    BlendedPath,
    CoordinationCell,
    CoordinationChart,
    FeedbackIK,
    IKGains,
    JointPath,
    Line,
    LineSpeedLimits,
    LineSpeedProfile,
    PathDynamics,
    PhasePlane,
    PhaseTrajectory,
    PoseTarget,
    audit_clearance,
    minimum_time,
)
from armtempo.planners.charts import check_path, clearance_table
from armtempo.planners.ik import SphericalWristIK
from armtempo.planners.schedules import Audit
from armtempo.planners.schedules._certificate import certify
from armtempo.planners.topp import MotionCertificate
from armtempo.robots import Arm, Clearance, Shape, pack_bodies, shape_distance, static_shape

BAD = (np.nan, np.inf, -np.inf, 1e308, -1e308, 1e200)
WAYPOINTS = [[0.0, 0.5], [0.6, 1.0], [1.0, 0.4]]


@cache
def arm_at(x: float = 0.0) -> Arm:
    T = np.eye(4)
    T[0, 3] = x
    return Arm.from_urdf(data_path("robots/planar_two_link.urdf"), tip_link="tool", T_world_base=T)


def changed(what: Any, **values: object) -> Any:
    """A copy of something frozen whose numbers nobody looked through."""
    other = copy.copy(what)
    for name, value in values.items():
        object.__setattr__(other, name, value)
    return other


def with_nan(array: Floats) -> Floats:
    other = np.array(array)
    other.flat[other.size // 2] = np.nan
    return other


def broken_shapes(shape: Shape) -> list[Shape]:
    ends = (with_nan(shape.capsule[0]), *shape.capsule[1:])
    return [
        changed(shape, T_link_shape=with_nan(shape.T_link_shape)),
        changed(shape, points=with_nan(shape.points)),
        changed(shape, size=(np.nan, *shape.size[1:])),
        changed(shape, capsule=ends),
        changed(shape, capsule=(*shape.capsule[:2], np.nan)),
    ]


def test_no_distance_is_told_of_a_body_that_is_not_finite() -> None:
    arm, pin = arm_at(), static_shape("box", [0.1, 0.2, 0.3], name="pin")
    for shape in broken_shapes(arm.shapes[0]):
        other = changed(arm, shapes=(shape, *arm.shapes[1:]))
        for act in (
            lambda other=other: Clearance([other], [pin]),
            lambda other=other: Clearance([arm, other]),
            lambda shape=shape: pack_bodies([shape]),
            lambda shape=shape: shape_distance(pin, np.eye(4), shape, np.eye(4)),
        ):
            with pytest.raises(RobotError, match="shape of 'link_1' is not finite"):
                act()
    for shape in broken_shapes(pin):
        with pytest.raises(RobotError, match="shape of 'pin' is not finite"):
            Clearance([arm], [shape])
    hull = static_shape("convex", vertices=np.vstack([np.eye(3), np.zeros(3)]), name="hull")
    assert hull.vertices is not None
    with pytest.raises(RobotError, match="shape of 'hull' is not finite"):
        Clearance([arm], [changed(hull, vertices=with_nan(hull.vertices))])


@pytest.mark.parametrize("entry", ["placement_R", "placement_p", "axis", "base_p", "com", "mass"])
def test_no_distance_is_told_of_an_arm_that_is_not_finite(entry: str) -> None:
    arm = arm_at()
    entries: dict[str, Any] = {entry: with_nan(getattr(arm.model, entry))}
    other = changed(arm, model=arm.model._replace(**entries))
    with pytest.raises(RobotError, match="the model of arm 'planar_two_link' is not finite"):
        Clearance([other])


def test_a_distance_that_overflows_is_none() -> None:
    arm = arm_at()
    far = arm.model._replace(placement_p=np.where(arm.model.placement_p == 0.0, 0.0, 1e308))
    clearance = Clearance([changed(arm, model=far)], [static_shape("sphere", [0.1])])
    with pytest.raises(RobotError, match="distances between bodies are not finite"):
        clearance.obstacles(0, [0.3, 0.4])


class OwnPath(AbstractJointPath):
    """A straight line in joint space, one of whose answers is spoilt."""

    unit = "rad"
    dof = 2

    def __init__(self, spoil: Callable[[str, Floats, Any], Any] | None = None) -> None:
        self.length, self.breakpoints = 1.0, np.array([0.0, 0.5, 1.0])
        self.spoil = spoil or (lambda _name, _lam, value: value)

    def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        s = np.asarray(lam, dtype=np.float64)
        q = s[..., None] * np.array([0.6, -0.8]) + np.array([0.2, 1.5])
        dq = np.broadcast_to([0.6, -0.8], q.shape).copy()
        return self.spoil("q", s, q), self.spoil("dq", s, dq), self.spoil("ddq", s, np.zeros_like(q))

    def speed_bound(self, low: ArrayLike, high: ArrayLike) -> Floats:
        s = np.asarray(low, dtype=np.float64)
        bound: Floats = self.spoil("bound", s, np.broadcast_to([0.6, 0.8], (*s.shape, 2)).copy())
        return bound


def spoilt(what: str, value: float) -> Callable[[str, Floats, Any], Any]:
    """One entry of ``what``, between 0.4 and 0.41 of the way."""

    def spoil(name: str, lam: Floats, given: Any) -> Any:
        if name == what:
            given[..., 1] = np.where((lam > 0.4) & (lam < 0.41), value, given[..., 1])
        return given

    return spoil


def shaped(what: str) -> Callable[[str, Floats, Any], Any]:
    return lambda name, _lam, given: given[..., :1] if name == what else given


def certificates(path: AbstractJointPath) -> list[Callable[[], object]]:
    """All that certifies bodies on a path."""
    arm, other = arm_at(), arm_at(0.9)
    fine, clearance = OwnPath(), Clearance([arm], [static_shape("sphere", [0.01], name="pin")])
    return [
        lambda: CoordinationChart.build(arm, path, other, fine, 0.01, 0.05),
        lambda: CoordinationChart.build(other, fine, arm, path, 0.01, 0.05),
        lambda: check_path(clearance, 0, arm, path, obstacle_distance=0.0),
    ]


def test_the_path_of_these_tests_is_one() -> None:
    assert minimum_time(PathDynamics.from_path(arm_at(), OwnPath())).certificate.excess < 1e-3
    for certificate in certificates(OwnPath())[:2]:
        certificate()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("what", ["q", "dq", "ddq"])
def test_a_path_that_is_not_finite_somewhere_certifies_nothing(what: str, value: float) -> None:
    path = OwnPath(spoilt(what, value))
    message = r"of a OwnPath is not finite at station 0\.40\d* rad"
    for act in (lambda: PathDynamics.from_path(arm_at(), path), *certificates(path)):
        with pytest.raises(PathError, match=message):
            act()
    with pytest.raises(PathError, match=message):
        clearance_table(0, 1, (arm_at(), arm_at(0.9)), (OwnPath(), path), 0.05)


@pytest.mark.parametrize("what", ["q", "dq", "ddq"])
def test_a_path_of_another_shape_certifies_nothing(what: str) -> None:
    path = OwnPath(shaped(what))
    for act in (lambda: PathDynamics.from_path(arm_at(), path), *certificates(path)):
        with pytest.raises(PathError, match=r"of a OwnPath has shape .*one value per joint"):
            act()


@pytest.mark.parametrize(
    "spoil", [spoilt("bound", np.nan), spoilt("bound", np.inf), spoilt("bound", -1.0), shaped("bound")]
)
def test_speed_bounds_that_are_none_certify_nothing(spoil: Any) -> None:
    for act in certificates(OwnPath(spoil)):
        with pytest.raises(PathError, match="the speed bounds of a OwnPath are not"):
            act()


@pytest.mark.parametrize(
    "values",
    [
        {"length": np.nan},
        {"length": np.inf},
        {"length": 0.0},
        {"length": 2.0},
        {"breakpoints": np.array([0.0, np.nan, 1.0])},
        {"breakpoints": np.array([0.0, 0.7, 0.7, 1.0])},
        {"breakpoints": np.array([0.1, 1.0])},
        {"breakpoints": np.array([0.0])},
    ],
)
def test_stations_that_are_none_certify_nothing(values: dict[str, Any]) -> None:
    path = OwnPath()
    for name, value in values.items():
        setattr(path, name, value)
    for act in (lambda: PathDynamics.from_path(arm_at(), path), *certificates(path)):
        with pytest.raises(PathError, match="breakpoints of a OwnPath do not rise from 0 to its length"):
            act()


def spoil_mass(arm: Arm) -> Arm:
    return changed(arm, model=arm.model._replace(mass=with_nan(arm.model.mass)))  # type: ignore[no-any-return]


def test_a_torque_that_is_no_number_keeps_no_limit() -> None:
    arm, path = arm_at(), JointPath.through(WAYPOINTS)
    with pytest.raises(InputError, match="is not finite at row 0"):
        PathDynamics.from_path(spoil_mass(arm), path)
    dynamics = PathDynamics.from_path(arm, path)
    motion = minimum_time(dynamics)
    origin = dynamics._origin
    assert origin is not None
    broken = dynamics._with(dynamics.joints, origin._replace(arm=spoil_mass(arm)))
    motion = changed(motion, dynamics=broken)
    motion.__dict__.pop("_ratios", None)
    motion.__dict__.pop("certificate", None)
    acts: list[Callable[[], object]] = [lambda: motion.certificate, lambda: motion.stations_above(1e-3)]
    for act in acts:
        with pytest.raises(PathError, match=r"what the motion asks for at station .* is not a number"):
            act()


def test_ratios_that_are_no_numbers_are_an_excess() -> None:
    names = ("torque_ratio_max", "speed_ratio_max", "acceleration_ratio_max")
    for name in names:
        numbers = dict.fromkeys(names, 0.5) | {name: np.nan}
        certificate = MotionCertificate(**numbers, worst_station=0.0, worst_joint=0, end_error=0.0, end_speed_error=0.0)
        assert not certificate.excess <= 1e-3


def test_schedules_with_broken_arms_are_not_certified(lee1991: CoordinationCell) -> None:
    motions = [motion.delayed(0.3 * i) for i, motion in enumerate(lee1991.fastest)]
    assert certify(lee1991, motions).torque_ratio_max < 1.01
    arm = lee1991.arms[0]
    shape = changed(arm.shapes[0], T_link_shape=with_nan(arm.shapes[0].T_link_shape))
    cell = changed(lee1991, arms=(changed(arm, shapes=(shape, *arm.shapes[1:])), *lee1991.arms[1:]))
    with pytest.raises(InputError, match="no finite places"):
        audit_clearance(cell, motions)
    audit = Audit(engine="coal", instants=1, min_clearance=np.nan, time=0.0, required=0.01)
    assert audit.violated


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("place", [(0, 0), (1, 1), (2, 0)])
def test_waypoints_are_finite_and_sane(bad: float, place: tuple[int, int]) -> None:
    points = np.array(WAYPOINTS)
    points[place] = bad
    began = time.perf_counter()
    for arm in (None, arm_at()):
        with pytest.raises(InputError, match=rf"waypoint {place[0]} is (not finite|beyond 1e\+06) at joint {place[1]}"):
            JointPath.through(points, arm=arm)
    assert time.perf_counter() - began < 1.0


@pytest.mark.parametrize("points", [[[0, 10**400], [1, 1]], [[0, 1], [2]], "waypoints", [[[0.0]], [[1.0]]], [], [1, 2]])
def test_waypoints_are_a_table(points: Any) -> None:
    with pytest.raises(InputError, match="waypoints"):
        JointPath.through(points)


def test_waypoints_that_rounding_puts_together_are_the_same() -> None:
    far = [[0.0], *([1e6 * (-1.0) ** k] for k in range(2000)), [-1e6 + 2e-9], [0.0]]
    with pytest.raises(PathError, match="are the same"):
        JointPath.through(far)


ORIGIN, ACROSS, UP = np.zeros(3), np.eye(3)[0], np.eye(3)[1]
CORNER = ACROSS + UP


def test_positions_are_finite_and_sane() -> None:
    for bad in (*BAD, 1e10):
        for k in range(3):
            p: Any = [0.3, 0.4, 0.5]
            p[k] = bad
            for act in (
                lambda p=p: Line(p, ORIGIN),
                lambda p=p: Line(ORIGIN, p),
                lambda p=p: Arc(p, UP, ORIGIN),
                lambda p=p: Arc(ACROSS, UP, p),
                lambda p=p: Arc.through(ACROSS, p, UP),
            ):
                with pytest.raises(PathError, match="three finite coordinates in metres"):
                    act()
            if abs(bad) > 1e12 or not np.isfinite(bad):
                with pytest.raises(InputError, match="points must be"):
                    BlendedPath.through([ORIGIN, p, CORNER], 0.1)


R = np.broadcast_to(np.eye(3), (3, 3, 3))
P = np.outer(np.arange(3), [0.1, 0.0, 0.0])


def still(t: Floats) -> tuple[Floats, Floats, None, None]:
    return np.outer(t, [0.1, 0.0, 0.0]), np.broadcast_to(np.eye(3), (len(t), 3, 3)), None, None


@pytest.mark.parametrize("bad", BAD)
def test_targets_are_finite_and_sane(bad: float) -> None:
    p, turned = P.copy(), R.copy()
    p[1, 2] = turned[1, 2, 2] = bad
    puma = Arm.from_urdf(data_path("robots/puma560.urdf"))
    T = puma.tip_pose(np.full(6, 0.3))
    T[0, 3] = bad
    acts: list[Callable[[], object]] = [
        lambda: PoseTarget.through(p, R, 0.01),
        lambda: PoseTarget.through(P, turned, 0.01),
        lambda: PoseTarget.through(P, R, bad),
        lambda: PoseTarget.through(P, R, 0.01, acceleration=bad),
        lambda: PoseTarget.sample(still, bad, 0.01),
        lambda: PoseTarget.sample(still, 1.0, bad),
        lambda: SphericalWristIK(puma).solve(T),
        lambda: IKGains(position=bad),
        lambda: FeedbackIK(puma, posture=[bad, 0, 0, 0, 0, 0]),
        lambda: FeedbackIK(puma, posture_gain=bad),
        lambda: FeedbackIK(puma, damping=bad),
        lambda: FeedbackIK(puma).track(PoseTarget.through(P, R, 0.01), [bad, 0, 0, 0, 0, 0]),
        lambda: JointPath.along(Line(np.array([0.4, 0.3, 0.0]), np.array([0.3, 0.3, 0.0])), arm_at(), start=[bad, 0.3]),
    ]
    for act in acts:
        with pytest.raises(InputError):
            act()


def test_a_target_of_too_many_samples_is_refused_before_memory_is_full() -> None:
    for duration, step in ((1e9, 1e-3), (1.0, 1e-12), (1e12, 1.0)):
        with pytest.raises(InputError, match="duration"):
            PoseTarget.sample(still, duration, step)


ROWS: dict[str, Any] = {
    "grid": [0.0, 1.0, 2.0],
    "M": [[1.0], [1.0], [1.0]],
    "Q": [[0.0], [0.0], [0.0]],
    "R": [[0.1], [0.1], [0.1]],
    "S": [[0.2], [0.2], [0.2]],
    "torque_min": [-1.0],
    "torque_max": [1.0],
    "speed_max": [5.0, 5.0, 5.0],
}


NO_LIMIT = {"torque_min": -np.inf, "torque_max": np.inf, "speed_max": np.inf}


@pytest.mark.parametrize("name", list(ROWS))
def test_rows_are_finite_and_sane(name: str) -> None:
    minimum_time(PathDynamics(**ROWS))
    for bad in BAD:
        row = np.array(ROWS[name])
        row.flat[0] = bad
        if bad == NO_LIMIT.get(name):
            continue
        with pytest.raises(InputError):
            PathDynamics(**{**ROWS, name: row})
    for other in ([[1.0], [1.0, 2.0], [1.0]], [10**400], "rows"):
        with pytest.raises(InputError):
            PathDynamics(**{**ROWS, name: other})


def trajectory(lam: Any, mu: Any, time: Any) -> PhaseTrajectory:
    return PhaseTrajectory(lam=lam, mu=mu, time=time, dynamics=PathDynamics(**ROWS))


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e308])
def test_numbers_of_the_phase_plane_are_finite_and_sane(bad: float) -> None:
    dynamics = PathDynamics(**ROWS)
    plane = PhasePlane(dynamics)
    acts: list[Callable[[], object]] = [
        lambda: PhasePlane(dynamics, bad),
        lambda: minimum_time(dynamics, bad),
        lambda: plane.with_duration(bad),
        lambda: plane.motion([1.0, bad], [0.1, 0.1]),
        lambda: plane.motion([1.0], [0.1, 0.1]),
        lambda: trajectory([0, bad], [0, 0], [0, 1]),
        lambda: trajectory([0, 1], [0, bad], [0, 1]),
        lambda: trajectory([0, 1], [0, 0], [0, bad]),
        lambda: trajectory([0, 1], [0, 0], [0, 1, 2]),
        lambda: PathDynamics.from_path(arm_at(), OwnPath(), intervals=bad),  # type: ignore[arg-type]
        lambda: PathDynamics.from_path(arm_at(), OwnPath(), torque_reserve=bad),
        lambda: LineSpeedProfile.plan(bad, LineSpeedLimits(speed=1, acceleration=1, jerk=1)),
        lambda: LineSpeedLimits(speed=1, acceleration=bad, jerk=1),
        lambda: CoordinationChart.build(arm_at(), OwnPath(), arm_at(0.9), OwnPath(), bad, 0.05),
        lambda: CoordinationChart.build(arm_at(), OwnPath(), arm_at(0.9), OwnPath(), 0.01, bad),
    ]
    for act in acts:
        with pytest.raises((InputError, InfeasibleError, ActionError)):
            act()


@settings(max_examples=100, deadline=None)
@given(st.lists(st.lists(st.floats(width=64), min_size=2, max_size=2), min_size=2, max_size=5))
def test_any_waypoints_give_a_finite_path_or_an_error(points: list[list[float]]) -> None:
    try:
        path = JointPath.through(points)
    except ArmtempoError:
        absurd = not (np.abs(points) <= 1e6).all()
        assert absurd or np.linalg.norm(np.diff(points, axis=0), axis=1).min() < 1e-6
    else:
        path.sampled(np.linspace(0.0, path.length, 50), 2)
        path.check_stations()
