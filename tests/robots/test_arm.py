"""Kinematics and dynamics against the paper's appendix, PyBullet, Pinocchio and finite differences."""

from __future__ import annotations

import copy
import importlib
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pybullet
import pybullet_data
import pytest

from armtempo.arrays import Floats
from armtempo.errors import RobotError, UnknownNameError
from armtempo.robots import Arm, Tool, kernels

pin: Any = importlib.import_module("pinocchio")  # without types of its own
numba: Any = importlib.import_module("numba")  # with untyped functions

DATA = Path(pybullet_data.getDataPath())
PLANAR = Path(__file__).parents[2] / "configs" / "robots" / "planar_two_link.urdf"
ROBOTS: dict[str, tuple[Path, str | None]] = {
    "planar": (PLANAR, None),
    "iiwa": (DATA / "kuka_iiwa" / "model.urdf", None),
    "panda": (DATA / "franka_panda" / "panda.urdf", "panda_grasptarget"),
    "ur5e": (PLANAR.with_name("ur5e_like.urdf"), None),
}
XARM = DATA / "xarm" / "xarm6_robot.urdf"
SLIDER = """<robot name="slider">
  <link name="base"/>
  <joint name="slide" type="prismatic"><parent link="base"/><child link="cart"/><origin xyz="0.1 0 0.2" rpy="0.3 0 0"/>
    <axis xyz="0 0.6 0.8"/><limit lower="-1" upper="1" effort="10" velocity="2"/><dynamics damping="1.5"/></joint>
  <link name="cart"><inertial><origin xyz="0.02 0.01 0"/><mass value="2"/>
    <inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.02" iyz="0.002" izz="0.03"/></inertial></link>
  <joint name="turn" type="continuous"><parent link="cart"/><child link="beam"/><origin xyz="0 0 0.1" rpy="0 0.2 0.5"/>
    <axis xyz="0.6 -0.8 0"/><limit effort="5" velocity="3"/><dynamics damping="0.7"/></joint>
  <link name="beam"><inertial><origin xyz="0.1 0 0.05" rpy="0.1 0.2 0.3"/><mass value="1.5"/>
    <inertia ixx="0.02" ixy="0" ixz="0.001" iyy="0.01" iyz="0" izz="0.015"/></inertial></link>
  <joint name="reach" type="prismatic"><parent link="beam"/><child link="hand"/><origin xyz="0.3 0 0"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.3" effort="20" velocity="1"/></joint>
  <link name="hand"><inertial><origin xyz="0 0.03 0.01"/><mass value="0.8"/>
    <inertia ixx="0.003" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.004"/></inertial></link>
</robot>
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, str | None]]:
    slider = tmp_path_factory.mktemp("urdf") / "slider.urdf"
    slider.write_text(SLIDER)
    # The xArm6's inertias of two links are none: here zeros stand in the file, where PyBullet and we put them.
    xarm = tmp_path_factory.mktemp("xarm") / "xarm6_robot.urdf"
    text = XARM.read_text()
    for start in ('<inertia ixx="0.0248674"', '<inertia ixx="0.0053694"'):
        before, rest = text.split(start)
        zeros = " ".join(f'{key}="0"' for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
        text = f"{before}<inertia {zeros}/>{rest.split('/>', 1)[1]}"
    xarm.write_text(text.replace("package://xarm_description", str(XARM.parent / "xarm_description")))
    return ROBOTS | {"slider": (slider, None), "xarm": (xarm, None)}


@pytest.fixture(params=["planar", "iiwa", "panda", "slider", "ur5e", "xarm"])
def robot(request: pytest.FixtureRequest, files: dict[str, tuple[Path, str | None]]) -> tuple[Path, str | None]:
    return files[request.param]


@pytest.fixture
def client() -> Iterator[int]:
    number = pybullet.connect(pybullet.DIRECT)
    yield number
    pybullet.disconnect(number)


def rotation(x: float, y: float, z: float) -> Floats:
    return np.array(pin.rpy.rpyToMatrix(x, y, z))


def pose(xyz: tuple[float, float, float], rpy: tuple[float, float, float]) -> Floats:
    T = np.eye(4)
    T[:3, :3] = rotation(*rpy)
    T[:3, 3] = xyz
    return T


def states(arm: Arm, count: int = 20) -> tuple[Floats, Floats, Floats]:
    generator = np.random.default_rng(1)
    q = generator.uniform(np.maximum(arm.position_min, -3), np.minimum(arm.position_max, 3), (count, arm.dof))
    return q, generator.normal(size=q.shape), generator.normal(size=q.shape)


def pinocchio_model(arm: Arm) -> tuple[Any, Any]:
    text = arm.urdf.read_text().replace("<capsule ", "<cylinder ")  # its parser refuses PyBullet's capsules
    model = pin.buildModelFromXML(text.replace('type="continuous"', 'type="revolute"'))
    held = [model.getJointId(name) for name in model.names[1:] if name not in arm.joint_names]
    if held:
        model = pin.buildReducedModel(model, held, np.zeros(model.nq))
    model.gravity.linear = arm.T_world_base[:3, :3].T @ arm.gravity
    return model, model.createData()


def test_mass_matrix_is_the_papers_appendix() -> None:
    q = np.random.default_rng(0).uniform(-3, 3, (100, 2))
    c = np.cos(q[:, 1])
    paper = np.empty((100, 2, 2))
    paper[:, 0, 0] = 0.8608 + 0.3404 * c
    paper[:, 0, 1] = paper[:, 1, 0] = 0.07905 + 0.1702 * c
    paper[:, 1, 1] = 0.07905
    np.testing.assert_allclose(Arm.from_urdf(PLANAR).mass_matrix(q), paper, atol=1e-9, rtol=0)


def test_torques_are_the_papers_appendix() -> None:
    arm = Arm.from_urdf(PLANAR)
    q, qd, qdd = states(arm)
    s, c = np.sin(q[:, 1]), np.cos(q[:, 1])
    v1, v2 = qd.T
    first = (0.8608 + 0.3404 * c) * qdd[:, 0] + (0.07905 + 0.1702 * c) * qdd[:, 1]
    first -= 0.3404 * s * v1 * v2 + 0.1702 * s * v2**2
    second = (0.07905 + 0.1702 * c) * qdd[:, 0] + 0.07905 * qdd[:, 1] + 0.1702 * s * v1**2
    np.testing.assert_allclose(arm.inverse_dynamics(q, qd, qdd), np.column_stack([first, second]), atol=1e-9, rtol=0)


def test_planar_arm_data() -> None:
    arm = Arm.from_urdf(PLANAR)
    assert (arm.dof, arm.name, arm.tip_link) == (2, "planar_two_link", "tool")
    assert arm.link_names == ("link_1", "link_2")
    np.testing.assert_array_equal(arm.torque_max, [25, 7])
    np.testing.assert_array_equal(arm.damping, [0, 0])
    np.testing.assert_allclose(arm.tip_pose([0, 0])[:3, 3], [0.6, 0, 0], atol=1e-15)
    assert [shape.kind for shape in arm.shapes] == ["capsule", "capsule"]
    np.testing.assert_allclose(arm.capsules.p0, 0, atol=1e-15)
    np.testing.assert_allclose(arm.capsules.p1, [[0.37, 0, 0], [0.23, 0, 0]], atol=1e-15)
    assert not arm.model.mass.flags.writeable


def test_dynamics_and_kinematics_match_pybullet(robot: tuple[Path, str | None], client: int) -> None:
    urdf, tip = robot
    base = pose((0.3, -0.2, 0.1), (0.4, 0.2, -0.7))
    arm = Arm.from_urdf(urdf, tip_link=tip, T_world_base=base, gravity=(0.5, -1.0, -9.0))
    # PyBullet's inverse dynamics takes gravity to be given in the base's axes; its simulation, in the world's.
    pybullet.setGravity(*(base[:3, :3].T @ arm.gravity), physicsClientId=client)
    quaternion = pin.Quaternion(base[:3, :3]).coeffs()
    body = pybullet.loadURDF(
        str(urdf),
        base[:3, 3],
        quaternion,
        useFixedBase=True,
        flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
        physicsClientId=client,
    )
    # Without a base inertial PyBullet still places the base link by its centre of mass.
    offset = pybullet.getDynamicsInfo(body, -1, physicsClientId=client)[3:5]
    com, turn = pybullet.multiplyTransforms(base[:3, 3], quaternion, *offset)
    pybullet.resetBasePositionAndOrientation(body, com, turn, physicsClientId=client)
    infos = [pybullet.getJointInfo(body, i, physicsClientId=client) for i in range(pybullet.getNumJoints(body, client))]
    movable = [info[0] for info in infos if info[2] != pybullet.JOINT_FIXED]
    link_of = {info[12].decode(): info[0] for info in infos}
    held = [0.0] * (len(movable) - arm.dof)
    q, qd, qdd = states(arm)
    torque = arm.inverse_dynamics(q, qd, qdd, friction=False)
    mass, poses, tips = arm.mass_matrix(q), arm.link_poses(q), arm.tip_pose(q)
    for k in range(len(q)):
        theirs = pybullet.calculateInverseDynamics(
            body, [*q[k], *held], [*qd[k], *held], [*qdd[k], *held], physicsClientId=client
        )
        np.testing.assert_allclose(torque[k], theirs[: arm.dof], atol=1e-9, rtol=0)
        if not held:
            inertia = pybullet.calculateMassMatrix(body, list(q[k]), physicsClientId=client)
            np.testing.assert_allclose(mass[k], inertia, atol=1e-9, rtol=0)
        for joint, value in zip(movable, [*q[k], *held], strict=True):
            pybullet.resetJointState(body, joint, value, physicsClientId=client)
        for name, T in [*zip(arm.link_names, poses[k], strict=True), (arm.tip_link, tips[k])]:
            state = pybullet.getLinkState(body, link_of[name], computeForwardKinematics=True, physicsClientId=client)
            np.testing.assert_allclose(T[:3, 3], state[4], atol=2e-7)  # PyBullet reports link frames through floats
            R = np.array(pybullet.getMatrixFromQuaternion(state[5])).reshape(3, 3)
            np.testing.assert_allclose(T[:3, :3], R, atol=2e-6)


@pytest.mark.parametrize("robot", ["planar", "iiwa", "slider", "ur5e"], indirect=True)  # the Panda's fingers would move
def test_torques_drive_pybullets_simulation(robot: tuple[Path, str | None], client: int) -> None:
    urdf, _ = robot
    base = pose((0.3, -0.2, 0.1), (0.4, 0.2, -0.7))
    arm = Arm.from_urdf(urdf, T_world_base=base)
    pybullet.setGravity(*arm.gravity, physicsClientId=client)
    pybullet.setTimeStep(1e-3, physicsClientId=client)
    body = pybullet.loadURDF(
        str(urdf), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client
    )
    quaternion = pin.Quaternion(base[:3, :3]).coeffs()
    pybullet.resetBasePositionAndOrientation(body, base[:3, 3], quaternion, physicsClientId=client)
    links = range(-1, pybullet.getNumJoints(body, client))
    for link in links:
        pybullet.changeDynamics(body, link, linearDamping=0, angularDamping=0, jointDamping=0, physicsClientId=client)
        for other in links:
            pybullet.setCollisionFilterPair(body, body, link, other, 0, physicsClientId=client)
    joints = list(range(arm.dof))
    pybullet.setJointMotorControlArray(
        body, joints, pybullet.VELOCITY_CONTROL, forces=[0.0] * arm.dof, physicsClientId=client
    )
    q, _, qdd = states(arm, 5)
    q = np.clip(q, np.maximum(arm.position_min, -2) * 0.9 + 0.01, np.minimum(arm.position_max, 2) * 0.9)
    for k in range(len(q)):
        for joint in joints:
            pybullet.resetJointState(body, joint, q[k, joint], 0.0, physicsClientId=client)
        torque = arm.inverse_dynamics(q[k], np.zeros(arm.dof), qdd[k])
        pybullet.setJointMotorControlArray(
            body, joints, pybullet.TORQUE_CONTROL, forces=list(torque), physicsClientId=client
        )
        pybullet.stepSimulation(physicsClientId=client)
        speed = [state[1] for state in pybullet.getJointStates(body, joints, physicsClientId=client)]
        np.testing.assert_allclose(speed, 1e-3 * qdd[k], atol=1e-9)


def test_dynamics_and_kinematics_match_pinocchio(robot: tuple[Path, str | None]) -> None:
    urdf, tip = robot
    arm = Arm.from_urdf(urdf, tip_link=tip, T_world_base=pose((0.3, -0.2, 0.1), (0.4, 0.2, -0.7)))
    model, data = pinocchio_model(arm)
    frame = model.getFrameId(arm.tip_link)
    R = arm.T_world_base[:3, :3]
    q, qd, qdd = states(arm)
    torque, mass, tips, jacobian = (
        arm.inverse_dynamics(q, qd, qdd),
        arm.mass_matrix(q),
        arm.tip_pose(q),
        arm.jacobian(q),
    )
    for k in range(len(q)):
        rnea = pin.rnea(model, data, q[k], qd[k], qdd[k]) + arm.damping * qd[k] + arm.coulomb * np.sign(qd[k])
        np.testing.assert_allclose(torque[k], rnea, atol=1e-9, rtol=0)
        np.testing.assert_allclose(mass[k], pin.crba(model, data, q[k]), atol=1e-9, rtol=0)
        J = pin.computeFrameJacobian(model, data, q[k], frame, pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(jacobian[k], np.vstack([R @ J[:3], R @ J[3:]]), atol=1e-9, rtol=0)
        pin.framesForwardKinematics(model, data, q[k])
        np.testing.assert_allclose(tips[k], arm.T_world_base @ data.oMf[frame].homogeneous, atol=1e-9, rtol=0)


def test_jacobian_matches_finite_differences(robot: tuple[Path, str | None]) -> None:
    arm = Arm.from_urdf(robot[0], tip_link=robot[1], T_world_base=pose((0.1, 0.2, 0.3), (0.2, 0.1, 0.5)))
    q, _, _ = states(arm, 5)
    jacobian = arm.jacobian(q)
    h = 1e-6
    for j in range(arm.dof):
        step = h * np.eye(arm.dof)[j]
        plus, minus = arm.tip_pose(q + step), arm.tip_pose(q - step)
        np.testing.assert_allclose(jacobian[:, :3, j], (plus - minus)[:, :3, 3] / (2 * h), atol=1e-6)
        spin = (plus - minus)[:, :3, :3] @ np.swapaxes(arm.tip_pose(q)[:, :3, :3], 1, 2) / (2 * h)
        np.testing.assert_allclose(jacobian[:, 3:, j], spin[:, [2, 0, 1], [1, 2, 0]], atol=1e-6)


def test_path_coefficients_are_the_torques_along_a_path(robot: tuple[Path, str | None]) -> None:
    arm = Arm.from_urdf(robot[0], tip_link=robot[1])
    q, dq, ddq = states(arm)
    M, Q, R, S = (np.empty_like(q) for _ in range(4))
    kernels.path_coefficients(arm.model, q, dq, ddq, M, Q, R, S)
    for mu, mu_dot in [(0.0, 0.0), (1.3, -0.4), (0.2, 5.0)]:
        torque = arm.inverse_dynamics(q, dq * mu, ddq * mu**2 + dq * mu_dot) - arm.coulomb * np.sign(dq * mu)
        np.testing.assert_allclose(M * mu_dot + Q * mu**2 + R * mu + S, torque, atol=1e-9)
    np.testing.assert_array_equal(R, arm.damping * dq)


def test_links_with_impossible_inertia_are_point_masses_on_demand(files: dict[str, tuple[Path, str | None]]) -> None:
    with pytest.raises(RobotError, match=r"link 'link2' has principal moments .* unphysical_inertia"):
        Arm.from_urdf(XARM)
    arm, zeros = Arm.from_urdf(XARM, unphysical_inertia="point-mass"), Arm.from_urdf(files["xarm"][0])
    np.testing.assert_array_equal(arm.model.inertia, zeros.model.inertia)
    np.testing.assert_allclose(arm.model.inertia[1:3], 0.0, atol=1e-30)
    np.testing.assert_array_equal(arm.coulomb, 1.0)


def test_ur5e_like_arm_has_the_published_kinematics() -> None:
    """Denavit-Hartenberg rows of Universal Robots: T = Rz(theta) Tz(d) Tx(a) Rx(alpha)."""
    arm = Arm.from_urdf(ROBOTS["ur5e"][0])
    right = np.pi / 2
    rows = [
        (0.1625, 0.0, right),
        (0.0, -0.425, 0.0),
        (0.0, -0.3922, 0.0),
        (0.1333, 0.0, right),
        (0.0997, 0.0, -right),
        (0.0996, 0.0, 0.0),
    ]
    for q in states(arm)[0]:
        T = np.eye(4)
        for theta, (d, a, alpha) in zip(q, rows, strict=True):
            T = T @ pose((0, 0, d), (0, 0, theta)) @ pose((a, 0, 0), (alpha, 0, 0))
        np.testing.assert_allclose(arm.tip_pose(q), T, atol=1e-12)
    assert arm.model.mass.sum() == pytest.approx(3.761 + 8.058 + 2.846 + 1.37 + 1.3 + 0.365)
    np.testing.assert_array_equal(arm.torque_max, [150, 150, 150, 28, 28, 28])


def test_scalar_kernels_match_the_batched_methods() -> None:
    arm = Arm.from_urdf(*ROBOTS["iiwa"][:1])
    q, qd, qdd = (values[0] for values in states(arm, 1))
    tau = np.empty(7)
    kernels.inverse_dynamics(arm.model, q, qd, qdd, tau)
    np.testing.assert_array_equal(tau, arm.inverse_dynamics(q, qd, qdd, friction=False))
    R, p = np.empty((7, 3, 3)), np.empty((7, 3))
    kernels.link_frames(arm.model, q, R, p)
    np.testing.assert_array_equal(p, arm.link_poses(q)[:, :3, 3])
    np.testing.assert_array_equal(R, arm.link_poses(q)[:, :3, :3])


@pytest.mark.parametrize("way", [copy.deepcopy, lambda arm: pickle.loads(pickle.dumps(arm))])
@pytest.mark.parametrize("name", ["planar", "iiwa", "panda"])
def test_an_arm_arrives_as_the_type_that_kernels_are_compiled_for(name: str, way: Callable[[Arm], Arm]) -> None:
    file, tip = ROBOTS[name]
    arm = Arm.from_urdf(file, tip_link=tip)
    sent = way(arm)
    for field in ("model", "capsules", "speed_max", "damping", "T_world_base"):
        assert numba.typeof(getattr(sent, field)) == numba.typeof(getattr(arm, field)), field
    for shape, old in zip(sent.shapes, arm.shapes, strict=True):
        assert not shape.points.flags.writeable
        assert not shape.T_link_shape.flags.writeable
        np.testing.assert_array_equal(shape.points, old.points)
    q = states(arm, 3)[0]
    np.testing.assert_array_equal(sent.tip_pose(q), arm.tip_pose(q))
    assert (sent.name, sent.joint_names, sent.ignored_pairs) == (arm.name, arm.joint_names, arm.ignored_pairs)


def test_viscous_friction_is_read_and_added() -> None:
    arm = Arm.from_urdf(ROBOTS["iiwa"][0])
    np.testing.assert_array_equal(arm.damping, np.full(7, 0.5))
    q, qd, qdd = states(arm)
    difference = arm.inverse_dynamics(q, qd, qdd) - arm.inverse_dynamics(q, qd, qdd, friction=False)
    np.testing.assert_allclose(difference, 0.5 * qd, atol=1e-12)


def test_coulomb_friction_is_read_replaced_and_added(tmp_path: Path) -> None:
    file = tmp_path / "rough.urdf"
    file.write_text(SLIDER.replace('damping="1.5"', 'damping="1.5" friction="2.5"'))
    arm = Arm.from_urdf(file)
    np.testing.assert_array_equal(arm.coulomb, [2.5, 0, 0])
    np.testing.assert_array_equal(arm.acceleration_max, np.full(3, np.inf))
    arm = Arm.from_urdf(file, coulomb=[None, 0.3, 0.2], damping=[0, None, 4], acceleration_max=[None, 5, 6])
    np.testing.assert_array_equal(arm.coulomb, [2.5, 0.3, 0.2])
    np.testing.assert_array_equal(arm.damping, [0, 0.7, 4])
    np.testing.assert_array_equal(arm.model.damping, arm.damping)
    np.testing.assert_array_equal(arm.acceleration_max, [np.inf, 5, 6])
    q, qd, qdd = states(arm)
    qd[0] = 0.0
    difference = arm.inverse_dynamics(q, qd, qdd) - arm.inverse_dynamics(q, qd, qdd, friction=False)
    np.testing.assert_allclose(difference, arm.damping * qd + arm.coulomb * np.sign(qd), atol=1e-12)
    np.testing.assert_array_equal(difference[0], 0.0)


def test_methods_keep_leading_axes() -> None:
    arm = Arm.from_urdf(PLANAR)
    q = np.zeros((4, 5, 2))
    assert arm.tip_pose(q).shape == (4, 5, 4, 4)
    assert arm.link_poses(q).shape == (4, 5, 2, 4, 4)
    assert arm.jacobian(q).shape == (4, 5, 6, 2)
    assert arm.mass_matrix(q).shape == (4, 5, 2, 2)
    assert arm.inverse_dynamics(q, [1.0, 2.0], np.zeros((5, 2))).shape == (4, 5, 2)
    assert arm.tip_pose(np.zeros(2)).shape == (4, 4)
    assert arm.tip_pose(np.zeros((0, 2))).shape == (0, 4, 4)


def test_tool_merges_into_the_last_link() -> None:
    T = pose((0.01, 0.02, 0.1), (0.3, -0.2, 0.9))
    inertia = np.array([[0.02, 0.001, 0.002], [0.001, 0.03, 0.003], [0.002, 0.003, 0.025]])
    com = np.array([0.01, 0.02, 0.05])
    tool = Tool(T_link_tool=T, mass=1.7, com=com, inertia=inertia, hull=np.array([*np.eye(3), np.zeros(3)]) * 0.1)
    arm = Arm.from_urdf(ROBOTS["iiwa"][0], tool=tool)
    model, data = pinocchio_model(arm)
    model.appendBodyToJoint(7, pin.Inertia(1.7, com, inertia), pin.SE3(T))
    data = model.createData()
    q, qd, qdd = states(arm)
    for k in range(len(q)):
        theirs = pin.rnea(model, data, q[k], qd[k], qdd[k]) + arm.damping * qd[k]
        np.testing.assert_allclose(arm.inverse_dynamics(q[k], qd[k], qdd[k]), theirs, atol=1e-9, rtol=0)
        pin.forwardKinematics(model, data, q[k])
        np.testing.assert_allclose(arm.tip_pose(q[k]), data.oMi[7].homogeneous @ T, atol=1e-12)
    assert (arm.shapes[-1].kind, arm.shapes[-1].link, arm.shapes[-1].link_name) == ("convex", 6, "tool")
    np.testing.assert_allclose(arm.shapes[-1].T_link_shape, T)


def test_axes_are_normalised(tmp_path: Path, files: dict[str, tuple[Path, str | None]]) -> None:
    long = tmp_path / "long.urdf"
    long.write_text(SLIDER.replace("0 0.6 0.8", "0 3 4").replace("0.6 -0.8 0", "3 -4 0"))
    np.testing.assert_allclose(Arm.from_urdf(long).model.axis, Arm.from_urdf(files["slider"][0]).model.axis, atol=1e-15)


def test_limits_can_be_replaced() -> None:
    arm = Arm.from_urdf(PLANAR, torque_max=[None, 3.0], speed_max=[2, 4], position_limits=[None, (-1, 2)])
    np.testing.assert_array_equal(arm.torque_max, [25, 3])
    np.testing.assert_array_equal(arm.speed_max, [2, 4])
    np.testing.assert_allclose(arm.position_min, [-2 * np.pi, -1])
    np.testing.assert_allclose(arm.position_max, [2 * np.pi, 2])


def test_a_misspelt_keyword_is_told_with_the_nearest_one() -> None:
    with pytest.raises(UnknownNameError, match=r"unknown keyword 'torque_mx' \(did you mean 'torque_max'\?"):
        Arm.from_urdf(PLANAR, torque_mx=[1.0, 2.0])  # type: ignore[call-arg]
    with pytest.raises(UnknownNameError, match=r"did you mean 'tip_link'\?"):
        Arm.from_urdf(PLANAR, tip_lnk="tool")  # type: ignore[call-arg]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"torque_max": [1.0]}, ["torque_max has 1 entries", "give 2"]),
        ({"torque_max": [1.0, -1.0]}, ["torque_max[1]", "joint_2", "> 0"]),
        ({"speed_max": [1.0, float("nan")]}, ["speed_max[1]", "> 0"]),
        ({"acceleration_max": [1.0, 0.0]}, ["acceleration_max[1] = 0.0", "joint_2", "> 0"]),
        ({"jerk_max": [0.0, 1.0]}, ["jerk_max[0] = 0.0", "joint_1", "> 0"]),
        ({"jerk_max": [1.0, float("nan")]}, ["jerk_max[1]"]),
        ({"jerk_max": [1.0]}, ["jerk_max has 1 entries", "give 2"]),
        ({"damping": [1.0, -1.0]}, ["damping[1]", "joint_2", ">= 0"]),
        ({"coulomb": [float("inf"), 0.0]}, ["coulomb[0]", "joint_1", "finite"]),
        ({"coulomb": [0.0]}, ["coulomb has 1 entries", "give 2"]),
        ({"ignored_pairs": [("link_1", "tol")]}, ["ignored_pairs", "no link 'tol'", "link_1, link_2"]),
        ({"position_limits": [(0, 1)]}, ["position_limits has 1"]),
        ({"position_limits": [(0, 1), (2, 1)]}, ["joint_2", "lower < upper"]),
        ({"position_limits": [(0, 1), (2,)]}, ["position_limits[1]", "pair"]),
        ({"tip_link": "tol"}, ["planar_two_link.urdf", "tip_link 'tol'", "did you mean 'tool'", "link_1"]),
        ({"tip_link": "base_link"}, ["no movable joint", "link_1"]),
        ({"T_world_base": np.zeros((4, 4))}, ["base", "not a rigid transform"]),
        ({"gravity": [1, 2]}, ["gravity", "(x, y, z)"]),
        ({"gravity": [0, 0, float("nan")]}, ["gravity", "finite"]),
        ({"gravity": [0, 0, -1e308]}, ["gravity", "up to"]),
        ({"gravity": "down"}, ["gravity", "(x, y, z)"]),
        ({"torque_max": [1.0, 1e308]}, ["torque_max[1]", "joint_2", "up to"]),
        ({"torque_max": [float("inf"), 1.0]}, ["torque_max[0]", "joint_1"]),
        ({"torque_max": [1.0, "x"]}, ["torque_max[1] = 'x'", "joint_2"]),
        ({"torque_max": 3.0}, ["torque_max", "give 2, one per joint"]),
        ({"torque_max": np.array(3.0)}, ["torque_max", "give 2, one per joint"]),
        ({"speed_max": "12"}, ["speed_max", "give 2, one per joint"]),
        ({"speed_max": [1.0, [2.0]]}, ["speed_max[1]"]),
        ({"acceleration_max": [1.0, float("nan")]}, ["acceleration_max[1]"]),
        ({"acceleration_max": [1e300, 1.0]}, ["acceleration_max[0]"]),
        ({"damping": [1e300, 1.0]}, ["damping[0]", "joint_1"]),
        ({"coulomb": [0.0, float("nan")]}, ["coulomb[1]"]),
        ({"position_limits": [(0, 1), (0, float("nan"))]}, ["position_limits[1]", "pair"]),
        ({"position_limits": [(0, 1), (0, 1e308)]}, ["position_limits[1]", "pair"]),
        ({"position_limits": [(0, 1), 1]}, ["position_limits[1]", "pair"]),
        ({"T_world_base": np.full((4, 4), np.nan)}, ["base", "not a rigid transform"]),
        ({"T_world_base": np.eye(4) + 1e308 * np.eye(4, k=3)}, ["base", "not a rigid transform"]),
    ],
)
def test_bad_arguments_are_named(arguments: dict[str, object], words: list[str]) -> None:
    with pytest.raises(RobotError) as caught:
        Arm.from_urdf(PLANAR, **arguments)  # type: ignore[arg-type]
    message = str(caught.value)
    assert all(word in message for word in words), message
    assert "\n" not in message


def test_bad_joint_positions_are_refused() -> None:
    arm = Arm.from_urdf(PLANAR)
    for q in (1.0, [1.0], [1.0, 2.0, 3.0], np.zeros((2, 3))):
        with pytest.raises(RobotError, match="one value per joint"):
            arm.tip_pose(q)
    for bad in ([np.nan, 0.0], [np.inf, 0.0], [[0.0, 0.0], [0.0, -np.inf]]):
        with pytest.raises(RobotError, match="not finite"):
            arm.jacobian(bad)
    with pytest.raises(RobotError, match="make them agree"):
        arm.inverse_dynamics(np.zeros((3, 2)), np.zeros((4, 2)), np.zeros(2))


@pytest.mark.parametrize(
    ("tool", "words"),
    [
        ({"mass": -1.0}, "negative"),
        ({"mass": float("nan")}, "mass"),
        ({"mass": 1e308}, "mass"),
        ({"mass": "heavy"}, "mass"),
        ({"com": np.zeros(2)}, "com"),
        ({"com": [0.0, np.nan, 0.0]}, "com"),
        ({"com": [0.0, 1e308, 0.0]}, "com"),
        ({"inertia": 1e308 * np.eye(3)}, "inertia"),
        ({"inertia": np.zeros(3)}, "inertia"),
        ({"hull": np.full((5, 3), np.nan)}, "hull"),
        ({"hull": np.zeros((5, 2))}, "hull"),
        ({"T_link_tool": np.zeros((4, 4))}, "rigid"),
        ({"T_link_tool": np.eye(3)}, "rigid"),
    ],
)
def test_bad_tools_are_refused(tool: dict[str, object], words: str) -> None:
    with pytest.raises(RobotError, match=words):
        Tool(**tool)  # type: ignore[arg-type]


@pytest.mark.parametrize("which", ["panda", "planar", "ur5e"])
def test_no_point_gets_farther_than_its_levers_say(which: str) -> None:
    file, tip = ROBOTS[which]
    arm = Arm.from_urdf(file, tip_link=tip)
    points = [np.stack(shape.capsule[:2]) for shape in arm.shapes]
    levers = arm.levers(np.array([np.linalg.norm(own, axis=1).max() for own in points]), np.full(arm.dof, np.pi))
    generator, step, most = np.random.default_rng(0), 1e-6, np.zeros((arm.dof, len(points)))
    for q in generator.uniform(-np.pi, np.pi, (200, arm.dof)):
        T = arm.link_poses(q)
        for j in range(arm.dof):
            U = arm.link_poses(q + step * np.eye(arm.dof)[j])
            for k, (shape, own) in enumerate(zip(arm.shapes, points, strict=True)):
                if shape.link >= 0:
                    moved = own @ (U - T)[shape.link, :3, :3].T + (U - T)[shape.link, :3, 3]
                    most[j, k] = max(most[j, k], np.linalg.norm(moved, axis=1).max() / step)
    assert (most <= levers + 1e-6).all()
    assert ((most > 1e-6) <= (levers > 0.0)).all()
    assert most.max() > 0.7 * levers.max()
