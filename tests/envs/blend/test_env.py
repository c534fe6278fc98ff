"""BlendTracking-v0: how its reference is followed, what actions and rewards mean, its ends, random paths, refusals."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from armtempo.agents import highest_rate
from armtempo.arrays import Floats32
from armtempo.envs import BLEND_ENTRIES, MAPPINGS, PHYSICS, BlendTrackingEnv, Physics
from armtempo.errors import ActionError, ConfigError, PathError, UnknownNameError
from armtempo.planners import BlendCell
from armtempo.planners.cells import PATH_FAMILIES, FamilyName, draw_path, motion_demand

FULL = np.ones(1, dtype=np.float32)
STOP = -np.ones(1, dtype=np.float32)
NAMES = [entry.name for entry in BLEND_ENTRIES]


def run(env: BlendTrackingEnv, *actions: Floats32, **reset: Any) -> tuple[dict[str, float], dict[str, Any]]:
    """To the end, the last action over and over: sums of the reward's terms, and the last info."""
    env.reset(**reset)
    sums: dict[str, float] = {}
    total, k = 0.0, 0
    while True:
        observation, reward, terminated, truncated, info = env.step(actions[min(k, len(actions) - 1)])
        assert env.observation_space.contains(observation)
        assert reward == pytest.approx(sum(info["reward_terms"].values()), abs=1e-15)
        for name, value in info["reward_terms"].items():
            assert type(value) is float
            sums[name] = sums.get(name, 0.0) + value
        total += reward
        k += 1
        if terminated or truncated:
            return {**sums, "total": total}, {**info, "terminated": terminated, "truncated": truncated}


@pytest.mark.parametrize("physics", PHYSICS)
def test_full_rate_is_the_profile_and_the_tip_is_on_the_path(lee2006: BlendCell, physics: Physics) -> None:
    env = BlendTrackingEnv(lee2006, physics=physics, record=True)
    sums, info = run(env, FULL)
    trace, duration = env.trace, lee2006.line_speed.duration
    env.close()
    assert info["is_success"]
    assert info["arrival_s"] == pytest.approx(duration, abs=1e-9 if physics == "ideal" else lee2006.physics_tick)
    assert info["arrival_s"] >= duration - 1e-12
    inside = trace.time < duration
    np.testing.assert_allclose(trace.s[inside], lee2006.line_speed.at(trace.time[inside])[0], atol=1e-12)
    assert trace.contour_error.max() < 1e-8  # the reference is exact for PyBullet's step
    wanted = np.diff(trace.s) / lee2006.physics_tick
    assert np.abs(trace.arc_speed[1:] - wanted).max() < 1e-6
    chord = trace.line_speed[1:] - wanted  # chords are shorter than arcs: (curvature dL)^2 / 24
    assert -1.2e-4 < chord.min() < -1.0e-4
    assert trace.torque_demand_ratio_max == pytest.approx(0.745, abs=0.002)
    assert sums["progress"] == pytest.approx(1.0)
    assert sums["time"] == pytest.approx(-info["arrival_s"] / duration)
    assert sums["left"] == 0.0
    assert -0.002 < sums["line_speed"] <= 0.0  # what is commanded is what is measured, up to half a tick in the ramps
    for array in (trace.s, trace.q, trace.tip, trace.torque):
        assert not array.flags.writeable


def test_the_papers_mapping_is_slow_in_blends_by_its_figure(lee2006: BlendCell) -> None:
    """-0.42 and -0.44 mm/s at 2 ms (ik_blend 1.3; Lee2006: -0.4 mm/s); what it loses comes back at the junction."""
    env = BlendTrackingEnv(lee2006, mapping="paper", record=True)
    run(env, FULL)
    trace = env.trace
    env.close()
    wanted = np.diff(trace.s, prepend=0.0) / lee2006.physics_tick
    first, second = ((trace.time > low) & (trace.time < high) for low, high in ((0.36, 0.61), (0.98, 1.23)))
    for window, figure in ((first, -0.42e-3), (second, -0.438e-3)):
        assert (trace.line_speed - wanted)[window].min() == pytest.approx(figure, abs=2e-6)
    assert np.abs(trace.s - trace.station).max() == pytest.approx(1.5e-5, rel=0.05)  # drift [m] at the blend's exit
    assert trace.s[-1] - trace.station[-1] == pytest.approx(0.0, abs=1e-9)


def test_the_override_slows_and_stops_within_the_profiles_limits(lee2006: BlendCell) -> None:
    env = BlendTrackingEnv(lee2006, physics="ideal", record=True)
    observation, _ = env.reset(seed=0)
    for action in [FULL] * 20 + [STOP] * 40:
        observation, _, terminated, truncated, info = env.step(action)
    assert not terminated
    assert not truncated
    assert info["override"] == 0.0
    stands = info["s_m"]
    assert 0.3 < stands < 1.5
    assert observation[NAMES.index("speed")] == -1.0
    sums, info = run(env, *[FULL] * 20, *[STOP] * 40, FULL)
    trace, limits = env.trace, lee2006.limits
    env.close()
    assert info["is_success"]
    assert (np.diff(trace.s) >= 0.0).all()
    assert np.abs(trace.a).max() <= limits.acceleration * (1 + 1e-6)
    assert np.abs(trace.j).max() <= limits.jerk * (1 + 1e-6)
    assert info["arrival_s"] > lee2006.line_speed.duration + 0.4
    assert sums["time"] == pytest.approx(-info["arrival_s"] / lee2006.line_speed.duration)
    assert sums["line_speed"] < -0.2  # standing is as far from the line speed as can be


def test_limit_aware_keeps_what_the_line_speed_exceeds(lee2006: BlendCell) -> None:
    peaks = {}
    for curve in ("cubic", "quintic"):
        env = BlendTrackingEnv(lee2006, profile="limit-aware", physics="ideal", record=True)
        _, info = run(env, FULL, options={"curve": curve})
        trace = env.trace
        env.close()
        assert info["is_success"]
        normal = trace.cell.blended.curvature(trace.s) * trace.v**2
        assert normal.max() <= lee2006.limits.normal * (1 + 1e-6)
        peaks[curve] = info["arrival_s"]
    assert 1.87 < peaks["quintic"] < 2.0 < peaks["cubic"]  # cubics jump in curvature at the arc: it stops there


def test_leaving_the_tube_ends_the_episode_and_never_pays(lee2006: BlendCell) -> None:
    tight = lee2006.config.model_copy(update={"contour_error_max_m": 2e-4})
    cell = BlendCell.of(tight, lee2006.arm, lee2006.segments)
    env = BlendTrackingEnv(cell, model_error=0.1, record=True)  # at 1 m/s its error is 0.22 mm in the blends
    sums, info = run(env, FULL)
    trace = env.trace
    assert info["left"]
    assert info["terminated"]
    assert not info["is_success"]
    assert "arrival_s" not in info
    assert trace.contour_error[-1] > 2e-4 >= trace.contour_error[:-1].max()  # at that tick
    duration = cell.line_speed.duration
    assert sums["left"] == pytest.approx(-(1.0 + 3.0 * (5.0 + cell.control_period / duration)))
    env.close()


@pytest.mark.parametrize("family", ["given", "line-arc"])
def test_leaving_is_worse_than_whatever_stays(lee2006: BlendCell, family: FamilyName) -> None:
    """At once, late, or having crept: below every constant rate and below standing still to the end."""
    tiny = lee2006.config.model_copy(update={"contour_error_max_m": 1.22e-4})  # standing: 0.1 mm
    cell = BlendCell.of(tiny, lee2006.arm, lee2006.segments)
    env = BlendTrackingEnv(cell, model_error=0.1, family=family)
    left: list[float] = []
    stayed: list[float] = []
    arrived = 0
    policies = ([FULL], [STOP], [-FULL] * 100 + [FULL], *[[(2.0 * rate - 1.0) * FULL] for rate in (0.05, 0.2, 0.5)])
    for policy in policies:
        sums, info = run(env, *policy, seed=2)
        (left if info["left"] else stayed).append(sums["total"])
        arrived += info["is_success"]
    env.close()
    assert left
    assert arrived
    assert max(left) < min(stayed)


def test_a_model_error_shows_as_contour_error_with_acceleration(lee2006: BlendCell) -> None:
    worst = {}
    for error in (0.0, 0.1):
        env = BlendTrackingEnv(lee2006, model_error=error, record=True)
        run(env, FULL)
        worst[error] = float(env.trace.contour_error.max())
        env.close()
    assert worst[0.0] < 1e-8
    assert 1e-4 < worst[0.1] < 5e-4


@pytest.mark.parametrize("family", PATH_FAMILIES[1:])
def test_every_seed_draws_another_path_within_reach(lee2006: BlendCell, family: FamilyName) -> None:
    env = BlendTrackingEnv(lee2006, family=family, physics="ideal")
    lengths = []
    for seed in range(8):
        _, info = env.reset(seed=seed)
        cell = env.simulation.cell
        lengths.append(info["length_m"])
        assert info["corners"] == len(cell.segments) - 1 >= 2
        assert all(np.allclose(a.end, b.start) for a, b in pairwise(cell.segments))
        assert cell.arm is lee2006.arm
        assert env.reset(seed=seed)[1] == info
    assert len(set(lengths)) == 8
    following = env.reset()[1]["length_m"]
    env.reset(seed=7)
    assert env.reset()[1]["length_m"] == following
    env.close()


@pytest.mark.parametrize("family", PATH_FAMILIES[1:])
def test_the_arm_can_follow_what_is_drawn_whatever_the_corners(lee2006: BlendCell, family: FamilyName) -> None:
    for seed in (*range(6), 60, 79, 156, 184):
        cells = [draw_path(lee2006, family, np.random.default_rng(seed), curve=curve) for curve in (None, "quintic")]
        for one, other in zip(cells[0].segments, cells[1].segments, strict=True):
            np.testing.assert_array_equal([one.start, one.end], [other.start, other.end])
        for cell in cells:
            profile = cell.line_speed
            demand = motion_demand(cell, *profile.at(np.linspace(0.0, profile.duration, 1001)))
            assert max(demand.torque_ratio_max, demand.joint_speed_ratio_max) < 1.0
            assert demand.normal_ratio_max < 16.0  # a constant rate of 1/4 keeps it, and arrives before the time limit
            radius = np.linalg.norm(cell.blended.position(np.linspace(0.0, cell.blended.length, 400))[:, :2], axis=1)
            assert 0.307 < radius.min() < radius.max() < 0.75  # as the given path


def test_random_paths_are_followed_at_full_rate_and_at_the_constant_one(lee2006: BlendCell) -> None:
    for family in PATH_FAMILIES[1:]:
        env = BlendTrackingEnv(lee2006, family=family, record=True)
        for rate in (1.0, 0.25):  # a quarter keeps all limits of the tip
            assert run(env, (2.0 * rate - 1.0) * FULL, seed=0)[1]["is_success"]
            assert env.trace.contour_error.max() < 1e-6
            assert env.trace.torque_demand_ratio_max < 1.0
        assert highest_rate(env.simulation.cell) > 0.25
        env.close()


def test_reset_options_change_the_corners_for_one_episode(lee2006: BlendCell) -> None:
    env = BlendTrackingEnv(lee2006, physics="ideal")
    given = env.reset(seed=0)[1]["length_m"]
    assert given == lee2006.blended.length
    options = {"remaining_distance_m": 0.05, "shape_factor": 2.0, "curve": "cubic"}
    assert env.reset(options=options)[1]["length_m"] > given  # smaller blends cut less off
    blend = env.simulation.cell.config.blend
    assert (blend.remaining_distance_m, blend.shape_factor) == (0.05, 2.0)
    assert env.reset(options={"family": "polyline"})[1]["length_m"] != given
    assert env.reset()[1]["length_m"] == given
    with pytest.raises(ConfigError, match=r"curve: must be 'cubic', .*got 'round'"):
        env.reset(options={"curve": "round"})
    with pytest.raises(ConfigError, match=r"remaining_distance_m: must be greater than 0, got -1"):
        env.reset(options={"remaining_distance_m": -1})
    with pytest.raises(PathError, match="segment"):
        env.reset(options={"remaining_distance_m": 0.5})
    assert env.reset(options={"curve": "quintic"})[1]["length_m"] != given
    with pytest.raises(ConfigError, match="shape_factor: belongs to curve 'cubic', not to 'quintic'"):
        env.reset(options={"curve": "quintic", "shape_factor": 2})
    with pytest.raises(PathError, match="none of 1000 paths drawn as 'zigzag'"):
        env.reset(options={"remaining_distance_m": 0.5, "family": "zigzag"})
    with pytest.raises(UnknownNameError, match=r"unknown family of paths 'polylines' \(did you mean 'polyline'"):
        env.reset(options={"family": "polylines"})
    for family in (None, 3):
        with pytest.raises(UnknownNameError, match=f"unknown family of paths {family} "):
            env.reset(options={"family": family})
    env.close()


def test_wrong_actions_are_refused(lee2006: BlendCell) -> None:
    env = BlendTrackingEnv(lee2006, physics="ideal")
    env.reset(seed=0)
    for action in (np.array([math.nan]), np.ones(2), "fast"):
        with pytest.raises(ActionError, match="action of scara must be one finite number"):
            env.step(action)  # type: ignore[arg-type]
    env.step(9.0 * FULL)  # clipped
    env.close()


def test_wrong_names_of_options_are_refused(lee2006: BlendCell) -> None:
    for options, known in (
        ({"profile": "linespeed"}, "line-speed"),
        ({"mapping": "papers"}, ", ".join(MAPPINGS)),
        ({"family": "zig"}, "zigzag"),
    ):
        with pytest.raises(UnknownNameError, match=known):
            BlendTrackingEnv(lee2006, **options)  # type: ignore[arg-type]


def test_episodes_end_in_time(lee2006: BlendCell) -> None:
    env = BlendTrackingEnv(lee2006, physics="ideal")
    _, info = run(env, STOP)
    assert info["truncated"]
    assert not info["terminated"]
    assert not info["is_success"]
    assert info["time_s"] == pytest.approx(5.0 * lee2006.line_speed.duration, abs=lee2006.control_period)
    env.close()
    env = BlendTrackingEnv(lee2006, physics="ideal", max_episode_s=0.1)
    assert run(env, FULL)[1]["time_s"] == pytest.approx(0.1)
    env.close()


def test_observations_say_what_the_table_says(lee2006: BlendCell) -> None:
    env = BlendTrackingEnv(lee2006)
    first, _ = env.reset(seed=0)
    seen = dict(zip(NAMES, first.tolist(), strict=True))
    assert seen["progress"] == seen["speed"] == seen["tip_speed"] == seen["contour_error"] == -1.0
    assert (seen["override"], seen["time_to_go"], seen["lag"]) == (1.0, 1.0, 0.0)
    assert seen["curvature_0"] == seen["curvature_1"] == -1.0  # straight ahead
    for _ in range(20):
        observation, *_, info = env.step(FULL)
    seen = dict(zip(NAMES, observation.tolist(), strict=True))
    s = info["s_m"]
    assert seen["progress"] == pytest.approx(2.0 * s / lee2006.blended.length - 1.0, abs=1e-6)
    assert seen["speed"] == pytest.approx(1.0, abs=1e-6)
    ratio = float(lee2006.blended.curvature(s)) / lee2006.limits.normal
    assert seen["curvature_0"] == pytest.approx(2.0 * ratio / (1.0 + ratio) - 1.0, abs=1e-6)
    assert seen["normal_use"] == pytest.approx(min(2.0 * ratio - 1.0, 1.0), abs=1e-5)
    env.close()


def test_pictures_show_the_path_of_the_episode(lee2006: BlendCell) -> None:
    env = BlendTrackingEnv(lee2006, family="polyline", render_mode="rgb_array", physics="ideal")
    pictures = []
    for seed in (1, 2):
        env.reset(seed=seed)
        picture = env.render()
        assert picture is not None
        assert picture.shape == (480, 640, 3)
        assert picture.dtype == np.uint8
        pictures.append(picture)
    assert (pictures[0] != pictures[1]).any()
    env.close()
    env.close()


def test_a_two_link_arm_follows_blended_paths_too(tmp_path: Any) -> None:
    import yaml

    from armtempo.planners import load_cell

    file = tmp_path / "mine.yaml"
    line_speed = {"speed_m_s": 0.3, "acceleration_m_s2": 2.0, "jerk_m_s3": 50.0}
    points = [[0.4, 0.3, 0], [0.3, 0.05, 0]]
    path = {"start_m": [0.2, 0.3, 0], "segments": [{"line": {"to_m": point}} for point in points]}
    arm = {"name": "planar", "urdf": "planar_two_link.urdf", "elbow": "negative", "tip_link": "tool", "path": path}
    data = {"kind": "blend", "name": "mine", "arm": arm, "blend": {"tolerance_m": 0.01}, "line_speed": line_speed}
    file.write_text(yaml.safe_dump(data))
    cell = load_cell(file, BlendCell)
    assert cell.blended.deviation == pytest.approx([0.01], abs=1e-9)
    env = BlendTrackingEnv(cell, record=True)
    assert run(env, FULL)[1]["is_success"]
    assert env.trace.contour_error.max() < 1e-7
    env.close()


def test_a_puma_follows_blended_paths_too(tmp_path: Any) -> None:
    """Any arm whose start posture is given; random paths are drawn for the closed forms only."""
    import yaml

    from armtempo.planners import load_cell

    file = tmp_path / "mine.yaml"
    points = [[0.628, 0.3, 0.7], [0.628, 0.35, 0.5], [0.678, 0.0, 0.45]]
    path = {
        "start_m": [0.678, 0.0527, 0.7462],
        "start_rad": [0.3, 0.8, -2.9, 0.2, 1.0, 0.1],
        "segments": [{"line": {"to_m": point}} for point in points],
    }
    data = {
        "kind": "blend",
        "name": "mine",
        "arm": {"name": "puma", "urdf": "puma560.urdf", "path": path},
        "blend": {"curve": "quintic", "remaining_distance_m": 0.05},
        "line_speed": {"speed_m_s": 0.25, "acceleration_m_s2": 1.0, "jerk_m_s3": 20.0},
    }
    file.write_text(yaml.safe_dump(data))
    cell = load_cell(file, BlendCell)
    for physics in ("ideal", "bullet"):
        for mapping in ("exact", "paper"):
            env = BlendTrackingEnv(cell, record=True, physics=physics, mapping=mapping)
            assert run(env, FULL)[1]["is_success"]
            assert env.trace.contour_error.max() < 1e-6
            env.close()
    env = BlendTrackingEnv(cell, family="polyline", physics="ideal")
    with pytest.raises(PathError, match="random paths are drawn for two-link arms and SCARAs, not for arm 'puma'"):
        env.reset(seed=0)
    env.close()


def test_contour_errors_are_distances_from_the_path(lee2006: BlendCell) -> None:
    """Against the nearest of many samples, for tips 2.5 to 5 mm off and up to 5 mm behind their reference."""
    from armtempo.envs.blend._kernels import nearest_station

    path, random = lee2006.blended, np.random.default_rng(0)
    station = np.linspace(0.0, path.length, 200_001)
    points = path.position(station)
    for s in random.uniform(0.0, path.length, 60):
        p, tangent = path.position(s), path.tangent(s)
        off = np.cross(tangent, random.normal(size=3))
        tip = p + 5e-3 * random.uniform(0.5, 1.0) * off / np.linalg.norm(off)
        found, distance = nearest_station(path.packed, s + random.uniform(-5e-3, 5e-3), tip)
        nearest = np.linalg.norm(points - tip, axis=1)
        assert distance == pytest.approx(nearest.min(), abs=1e-8)
        assert found == pytest.approx(station[nearest.argmin()], abs=1e-4)
