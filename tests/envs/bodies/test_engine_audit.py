"""The other engine makes the same of every tick, and what is not the same is seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armtempo.agents import evaluate
from armtempo.envs import CoordinationEnv
from armtempo.envs.bodies import engine_difference
from armtempo.errors import InputError
from armtempo.planners import BlendCell, CoordinationCell, IKCell, load_cell


@pytest.mark.parametrize(("name", "most"), [("lee1991", 1e-14), ("planar-four", 1e-14), ("panda-pair", 1e-7)])
@pytest.mark.parametrize("physics", ["bullet", "mujoco"])
def test_every_tick_of_several_arms_is_the_same(name: str, most: float, physics: str) -> None:
    """Dry friction (the Pandas') is solved by iterations, to what these leave."""
    evaluation = evaluate(load_cell(name), ["optimal", "random"], physics=physics, audit=True)  # type: ignore[call-overload]
    for result in evaluation.results.values():
        assert 0.0 <= result.other_engine_rad < most


def test_every_tick_of_one_arm_is_the_same(lee2006: BlendCell, chung: IKCell) -> None:
    blend = evaluate(lee2006, ["limit-aware"], audit=True, model_error=0.05)
    assert (blend.results["limit-aware"].other_engine_rad or 1.0) < 1e-13
    ik = evaluate(chung, ["law"], audit=True)
    assert (ik.results["law"].other_engine_rad or 1.0) < 1e-13


def test_a_wrong_tick_is_seen(lee1991: CoordinationCell) -> None:
    env = CoordinationEnv(lee1991, record=True, model_error=0.1)
    env.reset(seed=0)
    for _ in range(5):
        env.step({name: np.ones(1, dtype=np.float32) for name in env.agents})
    trace = env.trace
    env.close()
    right = engine_difference(lee1991, trace, "mujoco", model_error=0.1)
    assert right < 1e-14
    assert engine_difference(lee1991, trace, "mujoco") > 1e-7  # arms of another mass
    q = [rows.copy() for rows in trace.q]
    q[1][7, 0] += 1e-9
    moved = replace(trace, q=tuple(q))
    assert engine_difference(lee1991, moved, "mujoco", model_error=0.1) > 0.9e-9


def test_ideal_motions_have_no_engine(lee1991: CoordinationCell) -> None:
    with pytest.raises(InputError, match="audit: physics is 'ideal', of no engine"):
        evaluate(lee1991, ["delay"], physics="ideal", audit=True)


def test_without_an_audit_the_figure_is_missing(lee1991: CoordinationCell) -> None:
    assert evaluate(lee1991, ["delay"]).results["delay"].other_engine_rad is None
