"""Audits by coal and PyBullet: they pass what is safe and find what is not."""

from __future__ import annotations

import pytest

from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import ENGINES, Cell, audit_clearance, default_engine, load_cell, schedule


@pytest.fixture(scope="module")
def panda_pair() -> Cell:
    return load_cell("panda-pair")


@pytest.mark.parametrize("engine", ENGINES)
def test_a_collision_is_found(lee1991: Cell, engine: str) -> None:
    """Both arms at full speed from the start collide."""
    audit = audit_clearance(lee1991, lee1991.fastest, engine=engine)  # type: ignore[arg-type]
    assert audit.violated
    assert audit.min_clearance < lee1991.d_min - 0.001
    assert 0.0 < audit.time < lee1991.fastest[0].duration


@pytest.mark.parametrize("engine", ENGINES)
def test_a_plan_passes_and_engines_agree(lee1991: Cell, engine: str) -> None:
    plan = schedule(lee1991, "delay")
    audit = audit_clearance(lee1991, plan.trajectories, engine=engine)  # type: ignore[arg-type]
    assert not audit.violated
    assert audit.instants > plan.makespan / (lee1991.control_period / 10.0)
    assert audit.min_clearance == pytest.approx(plan.certificate.min_clearance, abs=2e-5)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_plan_that_starts_too_early_is_found(lee1991: Cell, engine: str) -> None:
    """The reserve and the chart's cells are worth milliseconds; no more than that may be forgiven."""
    plan = schedule(lee1991, "delay")
    wait = plan.trajectories[1].duration - lee1991.fastest[1].duration
    early = (plan.trajectories[0], lee1991.fastest[1].delayed(wait - 0.004))
    assert audit_clearance(lee1991, early, engine=engine).violated  # type: ignore[arg-type]


@pytest.mark.parametrize("engine", ENGINES)
def test_hulls(panda_pair: Cell, engine: str) -> None:
    period = 0.02
    together = audit_clearance(panda_pair, panda_pair.fastest, engine=engine, period=period)  # type: ignore[arg-type]
    assert together.violated
    plan = schedule(panda_pair, "delay")
    audit = audit_clearance(panda_pair, plan.trajectories, engine=engine, period=period)  # type: ignore[arg-type]
    assert not audit.violated
    assert audit.required == pytest.approx(panda_pair.d_min, abs=2.5e-3)


def test_wrong_questions(lee1991: Cell) -> None:
    assert default_engine() == "coal"  # of the extra dev, which tests need
    with pytest.raises(UnknownNameError, match="pybullet"):
        audit_clearance(lee1991, lee1991.fastest, engine="fcl")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="1 motions for 2 arms"):
        audit_clearance(lee1991, lee1991.fastest[:1])
    with pytest.raises(InputError, match="every 0"):
        audit_clearance(lee1991, lee1991.fastest, period=0.0)
