"""Audits by coal and PyBullet: they pass what is safe and find what is not."""

from __future__ import annotations

import math
from itertools import combinations_with_replacement

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import CoordinationCell, audit_clearance, load_cell, schedule
from armtempo.planners.schedules import ENGINES, default_engine
from armtempo.planners.schedules._audit import COAL_ERROR, _bullet_error, _by_coal, _by_pybullet
from armtempo.robots import Shape, pack_bodies, separation, static_shape


@pytest.fixture(scope="module")
def panda_pair() -> CoordinationCell:
    return load_cell("panda-pair")


@pytest.mark.parametrize("engine", ENGINES)
def test_a_collision_is_found(lee1991: CoordinationCell, engine: str) -> None:
    """Both arms at full speed from the start collide."""
    audit = audit_clearance(lee1991, lee1991.fastest, engine=engine)  # type: ignore[arg-type]
    assert audit.violated
    assert audit.min_clearance < lee1991.d_min - 0.001
    assert 0.0 < audit.time < lee1991.fastest[0].duration


@pytest.mark.parametrize("engine", ENGINES)
def test_a_plan_passes_and_engines_agree(lee1991: CoordinationCell, engine: str) -> None:
    plan = schedule(lee1991, "delay")
    audit = audit_clearance(lee1991, plan.trajectories, engine=engine)  # type: ignore[arg-type]
    assert not audit.violated
    assert audit.instants > plan.makespan / (lee1991.control_period / 10.0)
    assert audit.min_clearance == pytest.approx(plan.certificate.min_clearance, abs=2e-5)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_plan_that_starts_too_early_is_found(lee1991: CoordinationCell, engine: str) -> None:
    """The reserve and the chart's cells are worth milliseconds; no more than that may be forgiven."""
    plan = schedule(lee1991, "delay")
    wait = plan.trajectories[1].duration - lee1991.fastest[1].duration
    early = (plan.trajectories[0], lee1991.fastest[1].delayed(wait - 0.004))
    assert audit_clearance(lee1991, early, engine=engine).violated  # type: ignore[arg-type]


@pytest.mark.parametrize("engine", ENGINES)
def test_hulls(panda_pair: CoordinationCell, engine: str) -> None:
    period = 0.02
    together = audit_clearance(panda_pair, panda_pair.fastest, engine=engine, period=period)  # type: ignore[arg-type]
    assert together.violated
    plan = schedule(panda_pair, "delay")
    audit = audit_clearance(panda_pair, plan.trajectories, engine=engine, period=period)  # type: ignore[arg-type]
    assert not audit.violated
    assert audit.required == pytest.approx(panda_pair.d_min, abs=2.5e-3)


SHAPES = [
    static_shape("box", (0.2, 0.1, 0.3)),
    static_shape("cylinder", (0.06, 0.3)),
    static_shape("capsule", (0.05, 0.3)),
    static_shape("sphere", (0.08,)),
    static_shape("convex", vertices=0.08 * np.random.default_rng(0).normal(size=(20, 3))),
]


@pytest.mark.parametrize(
    "pair", list(combinations_with_replacement(SHAPES, 2)), ids=lambda p: f"{p[0].kind}-{p[1].kind}"
)
def test_no_engine_reads_too_long_nor_shorter_than_it_forgives(pair: tuple[Shape, Shape]) -> None:
    generator = np.random.default_rng(1)
    count = 300
    places = np.tile(np.eye(4), (2, count, 1, 1, 1))
    places[..., :3, :3] = Rotation.random(2 * count, random_state=generator).as_matrix().reshape(2, count, 1, 3, 3)
    places[1, ..., :3, 3] = 0.17 * generator.normal(size=(count, 1, 3))
    one, other = (pack_bodies([shape]) for shape in pair)
    truth = np.array(
        [
            separation(one, 0, T[0], other, 0, U[0], math.inf, math.nan, np.zeros(3), np.empty((4, 3)))[0]
            for T, U in zip(*places, strict=True)
        ]
    )
    near = (truth > 0.003) & (truth < 0.09)
    assert near.sum() > 50
    shapes = [[pair[0]], [pair[1]]]
    for tell, error in ((_by_coal, COAL_ERROR), (_by_pybullet, _bullet_error(shapes))):
        told = tell(shapes, list(places))
        assert (told[near] <= truth[near] + COAL_ERROR).all()
        assert (told[near] >= truth[near] - error).all()


def test_wrong_questions(lee1991: CoordinationCell) -> None:
    assert default_engine() == "coal"  # of the extra dev, which tests need
    with pytest.raises(UnknownNameError, match="pybullet"):
        audit_clearance(lee1991, lee1991.fastest, engine="fcl")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="1 motions for 2 arms"):
        audit_clearance(lee1991, lee1991.fastest[:1])
    with pytest.raises(InputError, match="every 0"):
        audit_clearance(lee1991, lee1991.fastest, period=0.0)
