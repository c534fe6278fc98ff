"""Exported motions: consistent, complete, and the same after a round trip."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.errors import InputError
from armtempo.planners import CoordinationCell, PathDynamics, minimum_time, read_trajectory, write_trajectory
from armtempo.planners.topp import JointTrajectory

FIELDS = ("time", "q", "qd", "qdd", "torque")


def same(one: JointTrajectory, other: JointTrajectory) -> None:
    assert one.joint_names == other.joint_names
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))  # to the last bit
        assert not getattr(other, name).flags.writeable


@pytest.mark.parametrize("suffix", ["csv", "json", "CSV"])
def test_round_trip_is_exact(suffix: str, lee1991: CoordinationCell, tmp_path: Path) -> None:
    motion = lee1991.fastest[0]
    write_trajectory(tmp_path / f"deep/a.{suffix}", motion, 0.0007)
    same(JointTrajectory.sample(motion, 0.0007), read_trajectory(tmp_path / f"deep/a.{suffix}"))
    assert [path.name for path in (tmp_path / "deep").iterdir()] == [f"a.{suffix}"]


@given(
    seed=st.integers(0, 10**6), rows=st.integers(1, 5), joints=st.integers(1, 4), form=st.sampled_from(["csv", "json"])
)
@settings(max_examples=30, deadline=None)
def test_any_samples_round_trip(
    seed: int, rows: int, joints: int, form: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    generator = np.random.default_rng(seed)
    tables = {name: generator.normal(size=(rows, joints)) * 10.0 ** generator.integers(-300, 8) for name in FIELDS[1:]}
    names = tuple(f'joint,{k} "x.y"' for k in range(joints))
    motion = JointTrajectory(joint_names=names, time=np.cumsum(generator.uniform(1e-9, 1, rows)), **tables)
    file = tmp_path_factory.mktemp("any") / f"a.{form}"
    write_trajectory(file, motion)
    same(motion, read_trajectory(file))


@pytest.mark.parametrize("period", [0.001, 0.0333, 10.0])
def test_samples_are_the_planned_motion(period: float, lee1991: CoordinationCell) -> None:
    arm, motion = lee1991.arms[1], lee1991.fastest[1].delayed(0.0123)
    samples = JointTrajectory.sample(motion, period)
    assert samples.time[0] == 0.0
    assert samples.time[-1] == motion.duration
    np.testing.assert_allclose(np.diff(samples.time)[:-1], period, rtol=1e-9)
    assert np.diff(samples.time)[-1] <= period * (1 + 1e-9)
    start, end = (lee1991.paths[1].evaluate(lam)[0] for lam in (0.0, lee1991.paths[1].length))
    np.testing.assert_array_equal(samples.q[0], start)
    np.testing.assert_allclose(samples.q[-1], end, atol=1e-9)
    np.testing.assert_allclose(samples.qd[[0, -1]], 0.0, atol=1e-6)
    np.testing.assert_allclose(arm.inverse_dynamics(samples.q, samples.qd, samples.qdd), samples.torque, atol=1e-12)
    assert (np.abs(samples.torque) <= arm.torque_max * 1.001).all()


def test_speeds_integrate_to_positions(lee1991: CoordinationCell) -> None:
    samples = JointTrajectory.sample(lee1991.fastest[0], 1e-5)
    step = np.diff(samples.time)[:, None]
    np.testing.assert_allclose(
        np.cumsum(0.5 * (samples.qd[1:] + samples.qd[:-1]) * step, axis=0), samples.q[1:] - samples.q[0], atol=1e-5
    )
    np.testing.assert_allclose(np.cumsum(samples.qdd[:-1] * step, axis=0), samples.qd[1:] - samples.qd[0], atol=0.02)


def test_other_programs_can_read_the_files(lee1991: CoordinationCell, tmp_path: Path) -> None:
    for name in ("a.csv", "a.json"):
        write_trajectory(tmp_path / name, lee1991.fastest[0], 0.01)
    with (tmp_path / "a.csv").open(newline="") as stream:
        head, *rows = list(csv.reader(stream))
    names = ["joint_1", "joint_2"]
    assert head == ["time_s"] + [
        f"{key}.{j}" for key in ("q_rad", "qd_rad_s", "qdd_rad_s2", "torque_nm") for j in names
    ]
    data = json.loads((tmp_path / "a.json").read_text())
    assert data["joints"] == names
    assert [float(row[0]) for row in rows] == data["time_s"]
    assert [[float(cell) for cell in row[7:9]] for row in rows] == data["torque_nm"]


def test_what_cannot_be_exported_is_named(lee1991: CoordinationCell, tmp_path: Path) -> None:
    for period in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="period must be a positive number"):
            write_trajectory(tmp_path / "a.csv", lee1991.fastest[0], period)
    with pytest.raises(InputError, match="give a longer period"):
        write_trajectory(tmp_path / "a.csv", lee1991.fastest[0], 1e-12)
    with pytest.raises(InputError, match=r"\.csv and \.json, not \.txt"):
        write_trajectory(tmp_path / "a.txt", lee1991.fastest[0])
    ones = np.ones((3, 1))
    bare = PathDynamics([0.0, 1.0, 2.0], ones, 0 * ones, 0 * ones, 0 * ones, [-1.0], [1.0])
    with pytest.raises(InputError, match="planned from bare arrays"):
        write_trajectory(tmp_path / "a.csv", minimum_time(bare))
    assert not list(tmp_path.iterdir())
    with pytest.raises(InputError, match="time does not rise in row 1"):
        JointTrajectory(joint_names=("a",), time=[0.0, 0.0], **dict.fromkeys(FIELDS[1:], ones[:2]))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"qd has shape \(3, 1\), must have \(2, 1\)"):
        JointTrajectory(joint_names=("a",), time=[0.0, 1.0], q=ones[:2], qd=ones, qdd=ones, torque=ones)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "", ["line 1", "is not the header"]),
        ("a.csv", "time_s,q_rad.a\n0,1\n", ["line 1", "is not the header"]),
        ("a.csv", "time_s,q_rad.a,qd_rad_s.a,qdd_rad_s2.a,torque_nm.a\n", ["holds no instants"]),
        ("a.csv", "time_s,q_rad.a,qd_rad_s.a,qdd_rad_s2.a,torque_nm.a\n0,1,2,3\n", ["line 2", "has 4 cells", "give 5"]),
        ("a.csv", "time_s,q_rad.a,qd_rad_s.a,qdd_rad_s2.a,torque_nm.a\n0,1,2,3,x\n", ["line 2", "'x'"]),
        (
            "a.csv",
            "time_s,q_rad.a,qd_rad_s.a,qdd_rad_s2.a,torque_nm.a\n0,1,2,3,nan\n",
            ["torque is not finite in row 0"],
        ),
        ("a.json", "{", ["line 1", "not JSON"]),
        ("a.json", "{}", ["give exactly the keys"]),
        (
            "a.json",
            '{"joints": ["a"], "time_s": [0], "q_rad": [["x"]], "qd_rad_s": [[0]], "qdd_rad_s2": [[0]], '
            '"torque_nm": [[0]]}',
            ["q is no table of numbers"],
        ),
        (
            "a.json",
            '{"joints": ["a"], "time_s": [0, [1]], "q_rad": [[0]], "qd_rad_s": [[0]], "qdd_rad_s2": [[0]], '
            '"torque_nm": [[0]]}',
            ["time is no table of numbers"],
        ),
    ],
)
def test_bad_files_are_named(name: str, text: str, words: list[str], tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError) as caught:
        read_trajectory(tmp_path / name)
    assert all(word in str(caught.value) for word in [name, *words]), str(caught.value)
