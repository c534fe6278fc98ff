"""Many episodes of FeedbackIK-v0 at once: the bits of single ones, targets drawn beforehand, exact saving, refusals."""

from __future__ import annotations

import copy
import pickle
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from armtempo.envs import ACTION_MODES, ActionMode, FeedbackIKEnv, FeedbackIKVectorEnv
from armtempo.errors import ActionError, InputError, UnknownNameError
from armtempo.planners import CoordinationCell, IKCell
from armtempo.planners.cells import TargetFamilyName

FAMILIES: tuple[TargetFamilyName, ...] = ("partly-unreachable", "near-singular")


def actions(env: gymnasium.vector.VectorEnv[Any, Any, Any], mode: str, random: np.random.Generator) -> NDArray[Any]:
    """Speeds small enough to go somewhere; some are outside [-1, 1]."""
    most = 1.3 if mode == "gains" else 0.3
    return random.uniform(-most, most, env.action_space.shape or ()).astype(np.float32)


@pytest.mark.parametrize(
    ("mode", "autoreset"), [("speeds", AutoresetMode.NEXT_STEP), ("gains", AutoresetMode.SAME_STEP)]
)
def test_it_has_the_bits_of_gymnasiums_own_vector(chung: IKCell, mode: ActionMode, autoreset: AutoresetMode) -> None:
    """Targets drawn anew for every episode, and cut off, so that there are many."""
    count = 3
    options: dict[str, Any] = {"action_mode": mode, "max_episode_s": 0.4}
    many = gymnasium.make_vec(
        "armtempo/FeedbackIK-v0", num_envs=count, vectorization_mode="vector_entry_point", cell=chung, family=FAMILIES,
        autoreset_mode=autoreset, threads=3, **options,
    )  # fmt: skip
    singles = [partial(FeedbackIKEnv, chung, physics="ideal", family=FAMILIES[k % 2], **options) for k in range(count)]
    wanted = gymnasium.vector.SyncVectorEnv(singles, autoreset_mode=autoreset)
    assert isinstance(many, FeedbackIKVectorEnv)
    assert many.observation_space == wanted.observation_space
    assert many.action_space == wanted.action_space
    one, info = many.reset(seed=7)
    two, wanted_info = wanted.reset(seed=7)
    np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(info["duration_s"], wanted_info["duration_s"])
    random, ended = np.random.default_rng(0), 0
    for _ in range(90):
        given = actions(many, mode, random)
        found, expected = many.step(given), wanted.step(given)
        for ours, theirs in zip(found[:4], expected[:4], strict=True):
            assert np.asarray(ours).dtype == np.asarray(theirs).dtype
            np.testing.assert_array_equal(ours, theirs)
        over = found[2] | found[3]
        ended += int(over.sum())
        if over.any():
            same = autoreset == AutoresetMode.SAME_STEP
            mine, others = (infos["final_info"] if same else infos for infos in (found[4], expected[4]))
            for name in ("is_success", "position_error_rms_mm", "orientation_error_rms_rad"):
                np.testing.assert_array_equal(mine[f"_{name}"], over)
                np.testing.assert_array_equal(mine[name][over], others[name][over])
            np.testing.assert_array_equal(mine["position_error_rms_mm"], 1e3 * mine["position_error_rms_m"])
        if over.any() and autoreset == AutoresetMode.SAME_STEP:
            for e in np.flatnonzero(over):
                np.testing.assert_array_equal(found[4]["final_obs"][e], expected[4]["final_obs"][e])
    assert ended >= 2 * count
    many.close()
    wanted.close()


def test_to_the_targets_end(chung: IKCell) -> None:
    """Episodes of different lengths, terminated with their targets, with the return of a single one."""
    many = FeedbackIKVectorEnv(
        2, chung, action_mode="gains", family=("smooth", "partly-unreachable"), autoreset_mode="SameStep"
    )
    _, info = many.reset(seed=3)
    durations, returns, ends = info["duration_s"].copy(), np.zeros(2), np.zeros(2)
    running = np.ones(2, dtype=np.bool_)
    for k in range(1, 2000):
        _, rewards, terminated, truncated, infos = many.step(np.zeros((2, 4)))
        returns += np.where(running, rewards, 0.0)
        assert not truncated.any()
        for e in np.flatnonzero(terminated & running):
            ends[e] = 0.01 * k
            assert infos["final_info"]["is_success"][e] == (e == 0)  # 5 to 20 % of the arm's length out of reach
        running &= ~terminated
        if not running.any():
            break
    np.testing.assert_allclose(ends, durations, atol=1e-9)
    assert durations[0] != durations[1]
    single = FeedbackIKEnv(chung, action_mode="gains", family="partly-unreachable", physics="ideal")
    single.reset(seed=4)
    total, over = 0.0, False
    while not over:
        _, reward, over, _, _ = single.step(np.zeros(4, np.float32))
        total += reward
    assert returns[1] == total
    assert -1.5 < returns[1] < -0.1 < returns[0]


@pytest.mark.parametrize("mode", ACTION_MODES)
def test_a_held_action_earns_what_its_periods_do(chung: IKCell, mode: ActionMode) -> None:
    """30 periods an episode, held for 8: the fourth step ends it after 6."""
    options: dict[str, Any] = {"action_mode": mode, "family": FAMILIES, "targets": 2, "max_episode_s": 0.3}
    plain, held = (FeedbackIKVectorEnv(2, chung, hold_periods=hold, **options) for hold in (1, 8))
    np.testing.assert_array_equal(plain.reset(seed=2)[0], held.reset(seed=2)[0])
    random = np.random.default_rng(0)
    for periods in (8, 8, 8, 6):
        given = actions(plain, mode, random)
        several = [plain.step(given) for _ in range(periods)]
        seen, rewards, terminated, truncated, infos = held.step(given)
        np.testing.assert_array_equal(seen, several[-1][0])
        np.testing.assert_allclose(rewards, sum(one[1] for one in several), rtol=1e-12)
        np.testing.assert_array_equal(truncated, [periods == 6] * 2)
        assert not terminated.any()
    for name in ("position_error_rms_mm", "orientation_error_rms_rad"):
        np.testing.assert_array_equal(infos[name], several[-1][4][name])


def test_targets_drawn_beforehand_are_taken_at_random_and_no_others(chung: IKCell) -> None:
    options: dict[str, Any] = {"family": FAMILIES, "targets": 3, "target_seed": 5, "max_episode_s": 0.02}
    env = FeedbackIKVectorEnv(8, chung, autoreset_mode="SameStep", **options)
    first, info = env.reset(seed=0)
    starts = {row.tobytes() for row in first}
    for _ in range(20):
        seen = env.step(np.zeros((8, 6)))
        starts |= {row.tobytes() for row in seen[0][seen[3]]}
    assert len(starts) == 3
    assert len(set(info["duration_s"].tolist())) <= 3
    other, _ = FeedbackIKVectorEnv(8, chung, **options).reset(seed=0)
    np.testing.assert_array_equal(first, other)


@pytest.mark.parametrize("family", ["given", FAMILIES])
def test_going_on_from_a_saved_state(chung: IKCell, family: Any) -> None:
    def made() -> FeedbackIKVectorEnv:
        return FeedbackIKVectorEnv(
            5, chung, action_mode="gains", family=family, targets=4, max_episode_s=0.5, autoreset_mode="SameStep"
        )

    random, env, other = np.random.default_rng(1), made(), made()
    with pytest.raises(InputError, match="before a reset"):
        env.get_state()
    env.reset(seed=3)
    for _ in range(60):
        env.step(actions(env, "gains", random))
    state = env.get_state()
    kept = copy.deepcopy(state)
    later = [actions(env, "gains", random) for _ in range(120)]
    wanted = [env.step(one) for one in later]
    assert pickle.dumps(state) == pickle.dumps(kept)  # a copy
    other.set_state(state)  # without a reset
    for one, expected in zip(later, wanted, strict=True):
        for ours, theirs in zip(other.step(one)[:4], expected[:4], strict=True):
            np.testing.assert_array_equal(ours, theirs)
    with pytest.raises(InputError, match="does not fit"):
        other.set_state({**state, "batch.ahead": state["batch.ahead"][:2]})
    others: list[dict[str, Any]] = [{"target_seed": 1, "family": "smooth"}, {"action_mode": "speeds", "family": family}]
    for changes in others:
        asked: dict[str, Any] = {"action_mode": "gains", "targets": 4, **changes}
        another = FeedbackIKVectorEnv(5, chung, **asked)
        another.reset(seed=0)
        with pytest.raises(InputError, match="the state's"):
            another.set_state(state)
    with pytest.raises(InputError, match=r"'batch\.generators\.words' does not fit"):
        other.set_state({name: array for name, array in state.items() if name != "batch.generators.words"})


def test_reset_of_some(chung: IKCell) -> None:
    env = FeedbackIKVectorEnv(3, chung, family="smooth")
    first, _ = env.reset(seed=0)
    for _ in range(5):
        before = env.step(np.full((3, 6), 0.1))[0]
    after, infos = env.reset(seed=0, options={"reset_mask": np.array([True, False, True])})
    np.testing.assert_array_equal(after[1], before[1])
    np.testing.assert_array_equal(after[[0, 2]], first[[0, 2]])
    np.testing.assert_array_equal(infos["_duration_s"], [True, False, True])


def test_seeds_of_none_go_on_with_what_is_drawn(chung: IKCell) -> None:
    one, other = (FeedbackIKVectorEnv(2, chung, family=FAMILIES, targets=16) for _ in range(2))
    for env in (one, other):
        env.reset(seed=[5, 6])
        env.reset(seed=[None, None])
    np.testing.assert_array_equal(one.reset()[0], other.reset()[0])


def test_closed_environments_say_so(chung: IKCell) -> None:
    env = FeedbackIKVectorEnv(8, chung, threads=2)
    env.reset(seed=0)
    env.close()
    env.close()
    with pytest.raises(ActionError, match="closed"):
        env.step(np.zeros((8, 6)))
    with pytest.raises(InputError, match="closed"):
        env.reset()


@pytest.mark.parametrize("limit", [1e-10, 1e9])
def test_the_shortest_and_the_longest_time_limit(chung: IKCell, limit: float) -> None:
    """One control period at least, as in a single environment."""
    many = FeedbackIKVectorEnv(1, chung, max_episode_s=limit)
    single = FeedbackIKEnv(chung, physics="ideal", max_episode_s=limit)
    many.reset(seed=0)
    single.reset(seed=0)
    action = np.full((1, 6), 0.1, dtype=np.float32)
    found, expected = many.step(action), single.step(action[0])
    np.testing.assert_array_equal(found[0][0], expected[0])
    assert (found[1][0], found[3][0]) == (expected[1], expected[3])
    assert found[3][0] == (limit < 1.0)


def test_input_errors(chung: IKCell, lee1991: CoordinationCell) -> None:
    with pytest.raises(InputError, match='vectorization_mode="sync"'):
        gymnasium.make_vec("armtempo/FeedbackIK-v0", num_envs=2, cell=chung, physics="bullet")
    with pytest.raises(InputError, match="autoreset_mode"):
        FeedbackIKVectorEnv(2, chung, autoreset_mode="Disabled")
    wrong_numbers = {
        "num_envs": 0, "targets": 0, "hold_periods": 0, "max_episode_s": 0.0, "threads": 0, "target_seed": -1,
    }  # fmt: skip
    for name, wrong in wrong_numbers.items():
        with pytest.raises(InputError, match=name):
            FeedbackIKVectorEnv(**{"num_envs": 2, "cell": chung, name: wrong})  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="family"):
        FeedbackIKVectorEnv(2, chung, family=("smooth", "easy"))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="1 targets for 2 families"):
        FeedbackIKVectorEnv(2, chung, family=FAMILIES, targets=1)
    with pytest.raises(InputError, match="no family"):
        FeedbackIKVectorEnv(2, chung, family=())
    with pytest.raises(InputError, match="ik cell"):
        FeedbackIKVectorEnv(2, lee1991)  # type: ignore[arg-type]
    env = FeedbackIKVectorEnv(2, chung, family="smooth")
    with pytest.raises(ActionError, match="call reset"):
        env.step(np.zeros((2, 6)))
    env.reset(seed=0, options={"reset_mask": np.array([True, False])})
    assert (env.step(np.zeros((2, 6)))[1] < 0.0).all()  # the first reset is of all
    with pytest.raises(UnknownNameError, match="reset option"):
        env.reset(options={"family": "smooth"})
    for action in (np.zeros((2, 4)), np.full((2, 6), np.nan), None):
        with pytest.raises(ActionError, match="shape"):
            env.step(action)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="reset_mask"):
        env.reset(options={"reset_mask": np.zeros(2, dtype=np.bool_)})
    with pytest.raises(InputError, match="options must map"):
        env.reset(options=5)  # type: ignore[arg-type]
