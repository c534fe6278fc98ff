"""What is said and refused of arms that are not as planned when an environment is made."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from armtempo.envs import CoordinationEnv, CoordinationOptions, CoordinationSimulation, YieldingEnv
from armtempo.envs.coordination.world._keeping_up import first_rate, keeps_up
from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationCell, build_cell
from armtempo.planners.cells import needed_torque_reserve


def variant(cell: CoordinationCell, **changes: object) -> CoordinationCell:
    return build_cell(cell.config.model_copy(update=changes))


def test_the_log_has_the_reserve_that_would_do(lee1991: CoordinationCell, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "armtempo"):
        env = CoordinationEnv(lee1991, physics="bullet", model_error=0.05)
    assert not env.simulation.keeps_up
    assert env.simulation.uncertain.all()
    env.close()
    (line,) = caplog.messages
    assert "'lee1991' has a torque_reserve of 0, for model_error 0.05 it should be 0.0709" in line
    caplog.clear()
    enough = variant(lee1991, torque_reserve=0.0709)
    with caplog.at_level(logging.WARNING, "armtempo"):
        env = CoordinationEnv(enough, physics="bullet", model_error=0.05)
        CoordinationEnv(lee1991, physics="ideal").close()
        CoordinationEnv(lee1991, physics="bullet").close()
    assert env.simulation.keeps_up
    assert not env.simulation.uncertain.any()
    env.close()
    assert caplog.messages == []


@pytest.mark.parametrize("kind", [CoordinationEnv, YieldingEnv])
def test_auto_takes_what_the_errors_need(lee1991: CoordinationCell, kind: type[CoordinationEnv]) -> None:
    auto = variant(lee1991, torque_reserve="auto")
    assert auto.torque_reserve == 0.01
    for error in (0.0, 0.05, 0.1):
        env = kind(auto, physics="bullet", model_error=error)
        assert env.simulation.keeps_up
        assert env.cell.torque_reserve == pytest.approx(needed_torque_reserve(lee1991, error), rel=1e-12)
        assert env.cell.fastest[0].duration > lee1991.fastest[0].duration
        env.close()
    assert kind(auto, physics="ideal").cell is auto


def test_a_shield_over_arms_that_cannot_hold_themselves_is_refused(lee1991: CoordinationCell) -> None:
    upright = variant(lee1991, gravity_m_s2=(0.0, -9.81, 0.0))
    with pytest.raises(InfeasibleError, match=r"cell 'lee1991': model_error 5 leave.*however slowly"):
        CoordinationEnv(upright, physics="bullet", shield=True, model_error=5.0)
    CoordinationEnv(upright, physics="bullet", model_error=5.0).close()  # without a shield nothing is promised


def test_the_first_rate_is_one_where_plans_leave_torque(lee1991: CoordinationCell) -> None:
    rates = []
    for cell in (lee1991, variant(lee1991, torque_reserve=0.02)):
        simulation = CoordinationSimulation(cell, CoordinationOptions(physics="bullet"))
        rates.append(first_rate(simulation.world, cell, simulation.options, enough=True))
        assert simulation.clock == rates[-1]
        simulation.reset([0.0, 0.6])
        for _ in range(150):
            simulation.step(np.ones(2))
        assert simulation.clock == rates[-1]  # it was slow enough
        simulation.close()
    assert 0.995 < rates[0] < 1.0
    assert rates[1] == 1.0


def test_more_friction_where_there_is_none_changes_nothing(
    lee1991: CoordinationCell, caplog: pytest.LogCaptureFixture
) -> None:
    assert keeps_up(lee1991, CoordinationOptions(physics="bullet", friction_error=5.0))
    assert not caplog.records
