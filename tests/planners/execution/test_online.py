"""Arms late, slow, stopped at once, links that lose and delay: never a collision, and always an arrival."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.errors import InputError
from armtempo.execution import ArmState, OnlineExecution
from armtempo.planners import Schedule
from tests.planners.execution.conftest import run, too_close
from tests.planners.execution.controller import TICK_S


@given(
    name=st.sampled_from(["lee1991", "mixed-priority"]),
    seed=st.integers(0, 10**6),
    loss=st.sampled_from([0.0, 0.1, 0.4]),
    jitter_s=st.sampled_from([0.0, 0.002, 0.02]),
    hold_s=st.sampled_from([0.006, 0.03, 0.1]),
)
@settings(max_examples=12)
def test_whatever_arms_and_links_do_nothing_comes_too_close(
    plans: dict[str, Schedule], name: str, seed: int, loss: float, jitter_s: float, hold_s: float
) -> None:
    found = run(plans[name], seed, loss=loss, jitter_s=jitter_s, hold_s=hold_s)
    assert too_close(plans[name].cell, found.places) == 0
    assert (np.diff(found.places, axis=0) >= 0.0).all()
    # A link that is slower than is held stops the arms: they wait, and try again.
    assert found.arrived or jitter_s > 0.25 * hold_s


@pytest.mark.parametrize(("name", "price"), [("lee1991", 1.2), ("mixed-priority", 1.1)])
def test_a_good_link_costs_little(plans: dict[str, Schedule], name: str, price: float) -> None:
    """Behind arms that may stop at once nobody is as quick as in a plan that everybody keeps to."""
    found = run(plans[name], 0, hold_s=0.006, calm=True)
    assert found.arrived
    assert plans[name].makespan <= found.time <= price * plans[name].makespan + 2 * TICK_S
    assert all(link.emergencies <= 1 for link in found.online.links.values())


@pytest.mark.parametrize("jitter_s", [0.0, 0.003])
def test_factors_are_ramped_within_torques(plans: dict[str, Schedule], jitter_s: float) -> None:
    """tau = f^2 (M mu_dot + Q mu^2) + f R mu + S + M mu f_dot, of what controllers made of our factors."""
    plan = plans["lee1991"]
    found = run(plan, 1, jitter_s=jitter_s, loss=0.2 if jitter_s else 0.0, calm=True)
    for i, (arm, path, motion) in enumerate(zip(plan.cell.arms, plan.cell.paths, plan.cell.fastest, strict=True)):
        factor, lam = found.factors[:, i], found.places[:, i]
        moves = (lam > 1e-2 * path.length) & (lam < 0.99 * path.length)
        time = motion.time_at(lam)
        ramp = np.append(np.diff(factor), 0.0) / TICK_S
        middle = time + 0.5 * factor * TICK_S
        lam, mu, mu_dot = motion.at(np.minimum(middle, motion.duration))
        f, df = factor[:, None], ramp[:, None]
        q, dq, ddq = path.evaluate(lam)
        qd, qdd = f * dq * mu[:, None], f**2 * (ddq * mu[:, None] ** 2 + dq * mu_dot[:, None]) + df * dq * mu[:, None]
        share = np.abs(arm.inverse_dynamics(q, qd, qdd)) / arm.torque_max
        assert share[moves].max() < (1.35 if jitter_s else 1.05)  # a jump of the factor to 0 in a tick asks for 20 x


def test_an_arm_that_never_starts_holds_up_only_those_behind_it(plans: dict[str, Schedule]) -> None:
    plan = plans["lee1991"]
    first, second = plan.order
    limit = float(plan.precedence.farthest(second, first, 0.0))
    found = run(plan, 0, hold_s=0.01, still=(first,))
    assert not found.arrived
    assert (found.places[:, first] == 0.0).all()
    assert (found.places[:, second] < limit).all()
    found = run(plan, 0, hold_s=0.01, still=(second,))
    assert found.places[-1, first] == pytest.approx(plan.cell.planes[first].length)
    assert (found.places[:, second] == 0.0).all()


def test_controllers_run_the_fastest_motions(plans: dict[str, Schedule]) -> None:
    plan = plans["lee1991"]
    online = OnlineExecution(plan)
    motion = online.motion(500.0)
    for own, path, fast in zip(motion.motions, plan.cell.paths, plan.cell.fastest, strict=True):
        np.testing.assert_array_equal(own.q, path.evaluate(fast.at(motion.time)[0])[0])
    lam, rate = online.place(1, 0.1, 0.5)
    assert (lam, 2.0 * rate) == tuple(float(value) for value in plan.cell.fastest[1].at(0.1)[:2])


def test_what_is_no_link_and_no_state_is_refused(plans: dict[str, Schedule]) -> None:
    plan = plans["lee1991"]
    for times in ({"hold_s": 0.0}, {"hold_s": float("nan")}, {"stop_s": -1.0}, {"hold_s": 0.001}):
        with pytest.raises(InputError, match="hold an answer for some control periods"):
            OnlineExecution(plan, **times)
    with pytest.raises(InputError, match="a state of arm 2, and there are 2"):
        OnlineExecution(plan).report(ArmState(arm=2, sequence=0, time=0.0, lam=0.0, rate=0.0, factor=0.0))
    assert OnlineExecution(plan).scalings() == []


def test_the_page_about_it_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = Path(__file__).parents[3] / "docs" / "execution.md"
    monkeypatch.chdir(tmp_path)
    first, relay = re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    exec(compile(first, str(page), "exec"), {})
    assert (tmp_path / "fastest.yaml").is_file()
    assert capsys.readouterr().out.startswith("0 ")
    compile(relay, str(page), "exec")  # it needs ROS
