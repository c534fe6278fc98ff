"""Arms in MuJoCo move as in PyBullet, bit for bit the same from the same state, and nobody needs PyBullet for it."""

from __future__ import annotations

import copy
import pickle
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from armtempo.agents import evaluate
from armtempo.envs.bodies._bullet_scene import BulletScene
from armtempo.envs.bodies._mujoco_scene import MujocoScene
from armtempo.envs.bodies._scene import Scene
from armtempo.errors import RobotError
from armtempo.planners import CoordinationCell, load_cell

ROOT = Path(__file__).parents[3]
CELLS = ("lee1991", "mixed-priority", "planar-four", "iiwa-pair", "panda-pair")


@pytest.fixture
def panda_cell() -> CoordinationCell:
    return load_cell("panda-pair")


def _pushed(scene: Scene, steps: int, torque_share: float, seed: int) -> np.ndarray:
    """(2, A, n) after random torques, from a random state."""
    arms, random = scene.cell.arms, np.random.default_rng(seed)
    width = max(arm.dof for arm in arms)
    q, qd = random.uniform(-0.5, 0.5, (2, len(arms), width))
    most = np.array([np.pad(arm.torque_max, (0, width - arm.dof)) for arm in arms])
    scene.put_joints(q, qd)
    for _ in range(steps):
        scene.apply_torque(torque_share * most * random.uniform(-1.0, 1.0, most.shape))
    state = np.zeros((2, len(arms), width))
    scene.read_joints(*state)
    return state


@pytest.mark.parametrize("name", CELLS)
def test_a_few_steps_are_those_of_pybullet(name: str) -> None:
    """Both engines solve dry friction (of the Pandas) to rounding, each in its own way."""
    cell = load_cell(name)
    states = []
    for scene in (BulletScene(cell), MujocoScene(cell)):
        states.append(_pushed(scene, 20, 0.3, seed=3))
        scene.close()
    np.testing.assert_allclose(states[1], states[0], atol=1e-5 if name == "panda-pair" else 1e-10)


@pytest.mark.parametrize("name", CELLS)
def test_plans_arrive_when_they_arrive_in_pybullet(name: str) -> None:
    cell = load_cell(name)
    found = {}
    for physics in ("bullet", "mujoco"):
        evaluation = evaluate(cell, ["interval", "optimal"], physics=physics)
        found[physics] = evaluation.results
        assert str(evaluation.facts["engine"]).split()[0] == {"bullet": "PyBullet", "mujoco": "MuJoCo"}[physics]
    for policy, ours in found["mujoco"].items():
        theirs = found["bullet"][policy]
        assert ours.makespan_s == theirs.makespan_s
        assert ours.violations == 0
        assert ours.path_error_max_m < 2e-4
        assert ours.torque_demand_ratio_max == pytest.approx(theirs.torque_demand_ratio_max, rel=1e-6)


def test_resets_copies_and_pickles_are_bit_exact() -> None:
    cell = load_cell("panda-pair")
    scene = MujocoScene(cell, model_error=0.1, friction_error=0.2)
    first = _pushed(scene, 50, 0.5, seed=1)
    _pushed(scene, 7, 0.5, seed=2)
    assert _pushed(scene, 50, 0.5, seed=1).tobytes() == first.tobytes()
    torque = np.ones((2, 7))
    others = [copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))]
    after = []
    for one in (scene, *others):
        for _ in range(30):
            one.apply_torque(torque)
        state = np.zeros((2, 2, 7))
        one.read_joints(*state)
        after.append(state.tobytes())
    assert after[0] == after[1] == after[2]


def test_friction_holds_a_joint_that_is_pushed_by_less(panda_cell: CoordinationCell) -> None:
    """And lets go of one that is pushed by more."""
    scene = MujocoScene(panda_cell)
    assert all(arm.coulomb.all() for arm in panda_cell.arms)
    q, qd = np.zeros((2, 2, 7))
    q[:] = [path.evaluate(0.0)[0] for path in panda_cell.paths]
    for share, moves in ((0.99, False), (1.5, True)):
        scene.put_joints(q, np.zeros_like(q))
        for _ in range(100):
            now, speed = np.zeros_like(q), np.zeros_like(q)
            scene.read_joints(now, speed)
            holding = [
                one.inverse_dynamics(place, np.zeros(7), np.zeros(7), friction=False)
                for one, place in zip(panda_cell.arms, now, strict=True)
            ]
            scene.apply_torque(np.array(holding) + share * np.array([one.coulomb for one in panda_cell.arms]))
        scene.read_joints(now, qd)
        assert (np.abs(now[0] - q[0]).max() > 1e-3) == moves


def test_a_motion_that_diverges_is_an_error(
    lee1991: CoordinationCell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = MujocoScene(lee1991)
    scene.put_joints(np.zeros((2, 2)), np.full((2, 2), 1e200))
    with pytest.raises(RobotError, match="diverged"):
        scene.apply_torque(np.zeros((2, 2)))
    assert "unstable" in caplog.text
    assert not list(tmp_path.iterdir())  # MuJoCo's own way is a file


def test_steps_have_the_same_bits_in_another_process(panda_cell: CoordinationCell) -> None:
    program = (
        "from armtempo.planners import load_cell\n"
        "from armtempo.envs.bodies._mujoco_scene import MujocoScene\n"
        "from tests.envs.bodies.test_mujoco_scene import _pushed\n"
        "print(_pushed(MujocoScene(load_cell('panda-pair')), 50, 0.5, seed=4).tobytes().hex())\n"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT)
    assert run.stdout.strip() == _pushed(MujocoScene(panda_cell), 50, 0.5, seed=4).tobytes().hex()


@pytest.mark.parametrize(
    ("gone", "physics", "said"),
    [
        ("pybullet", "ideal", ""),
        ("pybullet", "mujoco", ""),
        ("pybullet", "bullet", 'PyBullet is .*take physics="mujoco"'),
        ("mujoco", "bullet", ""),
        ("mujoco", "mujoco", r'needs the package mujoco.*pip install "armtempo\[mujoco\]"'),
    ],
)
def test_no_engine_needs_the_other(gone: str, physics: str, said: str) -> None:
    """An episode where a package is not installed, or the error and what to do."""
    program = (
        f"import sys; sys.modules[{gone!r}] = None\n"
        "import numpy as np\n"
        "from armtempo.envs import CoordinationEnv\n"
        "from armtempo.errors import ArmtempoError\n"
        "try:\n"
        f"    env = CoordinationEnv('lee1991', physics={physics!r}); env.reset(seed=0)\n"
        "    while env.agents: env.step({name: np.ones(1, dtype=np.float32) for name in env.agents})\n"
        "except ArmtempoError as error: print(error)\n"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert re.search(said, run.stdout) if said else not run.stdout
