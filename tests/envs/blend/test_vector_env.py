"""Many episodes of BlendTracking-v0 at once: the bits of single ones, paths drawn beforehand, saving, refusals."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import yaml
from gymnasium.vector import AutoresetMode

from armtempo.envs import BlendTrackingEnv, BlendTrackingVectorEnv
from armtempo.envs.blend import BlendKeywords
from armtempo.envs.blend._vector_env import BlendVectorKeywords
from armtempo.envs.ik import IKKeywords
from armtempo.envs.ik._vector_env import IKVectorKeywords
from armtempo.errors import ActionError, InputError, UnknownNameError
from armtempo.planners import BlendCell, CoordinationCell, build_cell, load_cell
from armtempo.planners.cells import PATH_FAMILIES, PROFILES, FamilyName, ProfileName

SAME, NEXT = AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP
FAMILIES: tuple[FamilyName, ...] = ("polyline", "line-arc")


def compare(cell: BlendCell, autoreset: AutoresetMode, steps: int, low: float, **options: Any) -> dict[str, int]:
    """Both vectors, step by step, to the last bit; how the episodes ended."""
    count = 3
    many = gymnasium.make_vec(
        "armtempo/BlendTracking-v0", num_envs=count, vectorization_mode="vector_entry_point", cell=cell,
        autoreset_mode=autoreset, threads=2, **options,
    )  # fmt: skip
    wanted = gymnasium.vector.SyncVectorEnv(
        [partial(BlendTrackingEnv, cell, physics="ideal", **options)] * count, autoreset_mode=autoreset
    )
    assert isinstance(many, BlendTrackingVectorEnv)
    assert many.observation_space == wanted.observation_space
    assert many.action_space == wanted.action_space
    one, info = many.reset(seed=7)
    two, wanted_info = wanted.reset(seed=7)
    np.testing.assert_array_equal(one, two)
    for name in ("length_m", "duration_s", "corners"):
        np.testing.assert_array_equal(info[name], wanted_info[name])
    random, ends = np.random.default_rng(0), {"is_success": 0, "left": 0, "late": 0}
    for _ in range(steps):
        given = random.uniform(low, 1.2, (count, 1)).astype(np.float32)
        found, expected = many.step(given), wanted.step(given)
        for ours, theirs in zip(found[:4], expected[:4], strict=True):
            assert np.asarray(ours).dtype == np.asarray(theirs).dtype
            np.testing.assert_array_equal(ours, theirs)
        over = found[2] | found[3]
        if not over.any():
            continue
        mine, others = (infos["final_info"] if autoreset == SAME else infos for infos in (found[4], expected[4]))
        for name in ("is_success", "left"):
            np.testing.assert_array_equal(mine[f"_{name}"], over)
            np.testing.assert_array_equal(mine[name][over], others[name][over])
            ends[name] += int(mine[name].sum())
        ends["late"] += int(found[3].sum())
        arrived = ~np.isnan(mine["arrival_s"])
        if arrived.any():
            np.testing.assert_array_equal(mine["arrival_s"][arrived], others["arrival_s"][arrived])
        for e in np.flatnonzero(over) if autoreset == SAME else ():
            np.testing.assert_array_equal(found[4]["final_obs"][e], expected[4]["final_obs"][e])
    many.close()
    wanted.close()
    return ends


@pytest.mark.parametrize("autoreset", [NEXT, SAME])
@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("family", PATH_FAMILIES)
def test_it_has_the_bits_of_gymnasiums_own_vector(
    lee2006: BlendCell, family: FamilyName, profile: ProfileName, autoreset: AutoresetMode
) -> None:
    """Paths drawn anew for every episode, and cut off, so that there are several."""
    mapping = "paper" if autoreset == SAME else "exact"
    ends = compare(lee2006, autoreset, 26, -0.7, family=family, profile=profile, mapping=mapping, max_episode_s=0.1)
    assert ends["late"] >= 6


@pytest.mark.parametrize("autoreset", [NEXT, SAME])
def test_to_the_end_of_the_path(lee2006: BlendCell, autoreset: AutoresetMode) -> None:
    assert compare(lee2006, autoreset, 250, 0.2)["is_success"] >= 3


def test_out_of_the_tube_inside_a_period(lee2006: BlendCell) -> None:
    """A tube as narrow as rounding: without physics nothing else leaves one. Episodes end at some tick of a period."""
    tight = build_cell(lee2006.config.model_copy(update={"contour_error_max_m": 1.5e-16}))
    ends = compare(tight, SAME, 60, 0.5)
    assert ends["left"] >= 3


def test_an_arm_without_a_closed_form(tmp_path: Path) -> None:
    """Joints of all episodes on a path are found at once, by Newton's method for this one."""
    path = {
        "start_m": [0.678, 0.0527, 0.7462],
        "start_rad": [0.3, 0.8, -2.9, 0.2, 1.0, 0.1],
        "segments": [{"line": {"to_m": point}} for point in ([0.628, 0.3, 0.7], [0.628, 0.35, 0.5])],
    }
    data = {
        "kind": "blend",
        "name": "mine",
        "arm": {"name": "puma", "urdf": "puma560.urdf", "path": path},
        "blend": {"curve": "quintic", "remaining_distance_m": 0.05},
        "line_speed": {"speed_m_s": 0.25, "acceleration_m_s2": 1.0, "jerk_m_s3": 20.0},
    }
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(data))
    ends = compare(load_cell(file, BlendCell), NEXT, 40, -0.5, max_episode_s=0.15)
    assert ends["late"] >= 3


def test_paths_drawn_beforehand_are_taken_at_random_and_no_others(lee2006: BlendCell) -> None:
    options: dict[str, Any] = {"family": FAMILIES, "paths": 3, "path_seed": 5, "max_episode_s": 0.01}
    env = BlendTrackingVectorEnv(8, lee2006, autoreset_mode="SameStep", **options)
    first, info = env.reset(seed=0)
    lengths = set(info["length_m"].tolist())
    for _ in range(12):
        lengths |= set(env.step(np.zeros((8, 1)))[4]["length_m"].tolist())
    assert len(lengths) == 3
    other, _ = BlendTrackingVectorEnv(8, lee2006, **options).reset(seed=0)
    np.testing.assert_array_equal(first, other)


def test_going_on_from_a_saved_state(lee2006: BlendCell) -> None:
    def made(**changes: Any) -> BlendTrackingVectorEnv:
        options: dict[str, Any] = {"family": FAMILIES, "mapping": "paper", "paths": 3, "max_episode_s": 0.2}
        return BlendTrackingVectorEnv(5, lee2006, autoreset_mode="SameStep", **(options | changes))

    random, env, other = np.random.default_rng(1), made(), made()
    with pytest.raises(InputError, match="before a reset"):
        env.get_state()
    env.reset(seed=3)
    for _ in range(33):
        env.step(random.uniform(-1.0, 1.0, (5, 1)))
    state = env.get_state()
    later = [random.uniform(-1.0, 1.0, (5, 1)) for _ in range(60)]
    wanted = [env.step(one) for one in later]
    other.set_state(state)
    for one, expected in zip(later, wanted, strict=True):
        for ours, theirs in zip(other.step(one)[:4], expected[:4], strict=True):
            np.testing.assert_array_equal(ours, theirs)
    for another in (made(path_seed=1), made(mapping="exact")):
        with pytest.raises(InputError, match="the state's"):
            another.set_state(state)


def test_reset_of_some(lee2006: BlendCell) -> None:
    env = BlendTrackingVectorEnv(3, lee2006, family="line-arc", paths=2)
    first, _ = env.reset(seed=0)
    for _ in range(5):
        before = env.step(np.full((3, 1), 0.1))[0]
    after, infos = env.reset(seed=0, options={"reset_mask": np.array([True, False, True])})
    np.testing.assert_array_equal(after[1], before[1])
    np.testing.assert_array_equal(after[[0, 2]], first[[0, 2]])
    np.testing.assert_array_equal(infos["_duration_s"], [True, False, True])


def test_keywords_are_those_of_a_single_environment() -> None:
    for own, single in ((BlendVectorKeywords, BlendKeywords), (IKVectorKeywords, IKKeywords)):
        assert set(own.__annotations__) == set(single.__annotations__)


def test_input_errors(lee2006: BlendCell, lee1991: CoordinationCell) -> None:
    with pytest.raises(InputError, match='vectorization_mode="sync"'):
        gymnasium.make_vec("armtempo/BlendTracking-v0", num_envs=2, cell=lee2006, physics="bullet")
    with pytest.raises(InputError, match="render_mode"):
        BlendTrackingVectorEnv(2, lee2006, render_mode="rgb_array")
    for name, wrong in {"num_envs": 0, "paths": 0, "max_episode_s": True, "threads": 0, "path_seed": -1}.items():
        with pytest.raises(InputError, match=name):
            BlendTrackingVectorEnv(**{"num_envs": 2, "cell": lee2006, name: wrong})  # type: ignore[arg-type]
    for name in ("family", "profile", "mapping"):
        with pytest.raises(UnknownNameError, match=name):
            BlendTrackingVectorEnv(2, lee2006, **{name: "easy"})  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="familly"):
        BlendTrackingVectorEnv(2, lee2006, familly="polyline")  # type: ignore[call-arg]
    with pytest.raises(InputError, match="1 paths for 2 families"):
        BlendTrackingVectorEnv(2, lee2006, family=FAMILIES, paths=1)
    with pytest.raises(InputError, match="no family"):
        BlendTrackingVectorEnv(2, lee2006, family=())
    with pytest.raises(InputError, match="blend cell"):
        BlendTrackingVectorEnv(2, lee1991)  # type: ignore[arg-type]
    env = BlendTrackingVectorEnv(2, lee2006)
    with pytest.raises(ActionError, match="call reset"):
        env.step(np.zeros((2, 1)))
    env.reset(seed=0)
    with pytest.raises(ActionError, match="shape"):
        env.step(np.zeros(2))
    with pytest.raises(UnknownNameError, match="reset option"):
        env.reset(options={"curve": "quintic"})
    env.close()
    with pytest.raises(ActionError, match="closed"):
        env.step(np.zeros((2, 1)))
