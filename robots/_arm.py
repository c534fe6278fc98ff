"""An arm: a serial chain read from a URDF, with its dynamics, limits and collision shapes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypedDict, Unpack, cast

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Bools, Floats, read_only
from armtempo.errors import RobotError, check_keywords
from armtempo.robots import _kernels as kernels
from armtempo.robots._joint_limits import read_joint_limits
from armtempo.robots._model import ArmModel, Capsules
from armtempo.robots._shapes import Shape, check_pose, make_shape, pack
from armtempo.robots._sizes import (
    FORCE_MAX,
    GRAVITY_MAX,
    INERTIA_MAX,
    LENGTH_MAX,
    LIMIT_MAX,
    MASS_MAX,
    UNLIMITED,
    read_array,
    read_number,
)
from armtempo.robots._srdf import Srdf, read_srdf
from armtempo.robots._urdf import Chain, ChainJoint, Unphysical, UrdfReader, merge_inertia

__all__ = ["Arm", "Tool"]


def _frozen(values: ArrayLike) -> Floats:
    array = np.array(values, dtype=np.float64, order="C")
    array.setflags(write=False)
    return array


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Tool:
    """What an arm carries: its frame replaces the tip, its mass joins the last link, its hull can collide.

    com, inertia and hull are given in the tool's frame.
    """

    T_link_tool: Floats | None = None
    """(4, 4) tool frame in the URDF's tip link; None: the same frame."""
    mass: float = 0.0
    """[kg]."""
    com: Floats | None = None
    """(3,) centre of mass [m]; None: the frame's origin."""
    inertia: Floats | None = None
    """(3, 3) about the centre of mass [kg m^2]; None: a point mass."""
    hull: Floats | None = None
    """(v, 3) points whose convex hull is the collision body [m]; None: no body."""

    def __post_init__(self) -> None:
        frame = check_pose(np.eye(4) if self.T_link_tool is None else self.T_link_tool, "tool frame")
        com = read_array(np.zeros(3) if self.com is None else self.com, (3,), LENGTH_MAX, "tool com", "m")
        inertia = np.zeros((3, 3)) if self.inertia is None else self.inertia
        inertia = read_array(inertia, (3, 3), INERTIA_MAX, "tool inertia", "kg m^2")
        bad = not 0.0 <= read_number(self.mass) <= MASS_MAX or not np.allclose(inertia, inertia.T)
        if bad or float(np.linalg.eigvalsh(inertia)[0]) < -1e-12:
            raise RobotError("tool has a negative mass or inertia", remedy="give physical values", element="tool")
        for name, value in (("T_link_tool", frame), ("com", com), ("inertia", inertia)):
            object.__setattr__(self, name, _frozen(value))
        if self.hull is not None:
            object.__setattr__(self, "hull", _frozen(read_array(self.hull, (None, 3), LENGTH_MAX, "tool hull", "m")))


class JointKeywords(TypedDict, total=False):
    """What ``Arm.from_urdf`` takes beside and in place of the URDF's."""

    locked: Mapping[str, float] | None
    joint_limits: str | Path | None
    srdf: str | Path | None
    group: str | None

    torque_max: Sequence[float | None] | Floats | None
    speed_max: Sequence[float | None] | Floats | None
    position_limits: Sequence[Sequence[float] | None] | Floats | None
    acceleration_max: Sequence[float | None] | Floats | None
    jerk_max: Sequence[float | None] | Floats | None
    damping: Sequence[float | None] | Floats | None
    coulomb: Sequence[float | None] | Floats | None


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Arm:
    """A serial arm with a fixed base. Make one with ``Arm.from_urdf``.

    Methods take joint positions q as (..., n) and keep the leading axes; rad or m, SI. They raise RobotError for a
    wrong last axis or NaN.
    """

    name: str
    urdf: Path
    T_world_base: Floats
    """(4, 4)."""
    gravity: Floats
    """(3,) world [m/s^2]."""
    joint_names: tuple[str, ...]
    link_names: tuple[str, ...]
    """Name of the first URDF link of each moving link."""
    tip_link: str
    dof: int
    kinematic: bool
    """Its file has no inertia: torques are not looked at."""
    position_min: Floats
    """(n,); -inf for continuous joints."""
    position_max: Floats
    speed_max: Floats
    """(n,) [rad/s or m/s]."""
    torque_max: Floats
    """(n,) [N m or N], for both signs; ``UNLIMITED`` where none is known: no inertia, or an effort limit of 0."""
    acceleration_max: Floats
    """(n,) [rad/s^2 or m/s^2], for both signs; inf: no limit. Only URDF 1.2 has some."""
    jerk_max: Floats
    """(n,) [rad/s^3 or m/s^3], likewise; kept by motions that are asked to (``minimum_time(..., jerk=True)``)."""
    damping: Floats
    """(n,) viscous friction [N m s/rad or N s/m]."""
    coulomb: Floats
    """(n,) Coulomb friction, against the motion whatever its speed [N m or N]."""
    shapes: tuple[Shape, ...]
    ignored_pairs: tuple[tuple[str, str], ...]
    """Names of links whose collision with each other is not looked at."""
    locked: tuple[tuple[str, float], ...]
    """Joints of its file that are held, and where [rad or m]."""
    shared_base: tuple[tuple[str, str], ...] = ()
    """Static bodies that it shares with other arms of its file, and the names of their links; see ``share_bases``."""
    named_places: tuple[tuple[str, Floats], ...]
    """Names and postures (n,) of an SRDF's group [rad or m]; see ``places``."""
    model: ArmModel
    capsules: Capsules
    T_link_tip: Floats
    """(4, 4) tip (the tool's frame, if there is one) in the last moving link."""

    @classmethod
    def from_urdf(
        cls,
        urdf: str | Path,
        *,
        name: str = "",
        T_world_base: ArrayLike | None = None,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        tip_link: str | None = None,
        tool: Tool | None = None,
        unphysical_inertia: Unphysical = "refuse",
        substitute_mass: float | None = None,
        ignored_pairs: Sequence[tuple[str, str]] = (),
        **given: Unpack[JointKeywords],
    ) -> Arm:
        """Read the serial chain from the URDF's root to ``tip_link``.

        Args:
            urdf: File; meshes are found relative to it, by package:// too, and replaced by their convex hulls.
            name: In messages and body names; the robot's name by default.
            T_world_base: (4, 4) pose of the root link, the identity by default.
            gravity: (3,) in the world [m/s^2].
            tip_link: By default the end of the longest chain of joints, in front of a gripper, by a name such as tool0
                or tcp; needed where that leaves a choice. Movable joints off the chain are held at zero.
            tool: Carried by the tip link.
            unphysical_inertia: Links whose moments of inertia no body can have (some published URDFs hold them) are
                refused, or taken for a ``point-mass`` at their centre, which is what PyBullet simulates; logged.
            substitute_mass: Where no link has an inertia: the mass of all moving links together [kg], spread over them
                by volume. Without it such an arm has no mass, and PyBullet cannot move it. Either way
                it is ``kinematic``: planned by its speed and acceleration limits alone.
            ignored_pairs: Pairs of URDF links that are not looked at for self-collision (an SRDF's disabled pairs).
            **given: ``locked``, joints that are held, by name [rad or m]: such as those of a torso; joints that mimic
                them follow. ``srdf``, a file whose disabled pairs are ignored, too; of its ``group`` the tip is that
                of the arm unless ``tip_link`` says otherwise, and its states are the arm's ``places``.
                ``joint_limits``, MoveIt's YAML file, in place of the URDF's where what follows is None.
                What the URDF has otherwise, one entry per joint; None entries keep the URDF's.
                ``torque_max`` (n,) in place of its effort limits [N m or N];
                ``speed_max`` (n,) of its velocity limits [rad/s or m/s];
                ``position_limits`` (n, 2) of its lower and upper ones [rad or m];
                ``acceleration_max`` (n,) of its acceleration limits, which only URDF 1.2 has [rad/s^2 or m/s^2]: the
                smaller of ``acceleration`` and ``deceleration``, for there is one limit for both directions;
                ``jerk_max`` (n,) of its jerk limits, likewise [rad/s^3 or m/s^3];
                ``damping`` (n,) viscous friction, of its <dynamics damping> [N m s/rad or N s/m];
                ``coulomb`` (n,) Coulomb friction, of its <dynamics friction> [N m or N].

        Raises:
            RobotError: names file, element and remedy.
            UnknownNameError: There is no such keyword; the message names the nearest one.
        """
        check_keywords(cls.from_urdf, given, JointKeywords.__annotations__)
        file = Path(urdf)
        _check_mass(substitute_mass)
        locked, (srdf, group) = dict(given.get("locked") or {}), _group(given)
        reader = UrdfReader(file, unphysical_inertia, substitute_mass, locked)
        if srdf is not None and group is not None:
            group_end = reader.group_tip(srdf, group)
            tip_link = tip_link or group_end
        chain = reader.chain(tip_link)
        joints = chain.joints
        if given.get("joint_limits") is not None:
            given = _with_limits(given, [joint.name for joint in joints])
        T_base = check_pose(np.eye(4) if T_world_base is None else T_world_base, f"base of {name or chain.name!r}")
        torques = _unlimited if chain.kinematic else _limits
        torque = torques(file, joints, "effort", "torque_max", given.get("torque_max"))
        speed = _limits(file, joints, "velocity", "speed_max", given.get("speed_max"))
        position = _position_limits(file, joints, given.get("position_limits"))
        own = [math.inf if joint.acceleration is None else joint.acceleration for joint in joints]
        acceleration = _filled(own, joints, "acceleration_max", given.get("acceleration_max"), zero=False)
        own = [math.inf if joint.jerk is None else joint.jerk for joint in joints]
        jerk = _filled(own, joints, "jerk_max", given.get("jerk_max"), zero=False)
        viscous = _filled([joint.damping for joint in joints], joints, "damping", given.get("damping"))
        dry = _filled([joint.coulomb for joint in joints], joints, "coulomb", given.get("coulomb"))

        if tool is not None:
            chain = _with_tool(chain, tool)
        _check_pairs(file, ignored_pairs, chain.shapes)
        if srdf is not None:
            ignored_pairs = _all_pairs(ignored_pairs, srdf, chain.shapes)
        model = _model(chain, viscous, read_array(gravity, (3,), GRAVITY_MAX, "gravity (x, y, z)", "m/s^2"), T_base)
        return cls(
            name=name or chain.name,
            urdf=file,
            T_world_base=_frozen(T_base),
            gravity=model.gravity,
            joint_names=tuple(joint.name for joint in joints),
            link_names=tuple(joint.link_name for joint in joints),
            tip_link=chain.tip_link,
            dof=len(joints),
            kinematic=chain.kinematic,
            position_min=_frozen(position[:, 0]),
            position_max=_frozen(position[:, 1]),
            speed_max=speed,
            torque_max=torque,
            acceleration_max=acceleration,
            jerk_max=jerk,
            damping=viscous,
            coulomb=dry,
            shapes=chain.shapes,
            ignored_pairs=tuple((a, b) for a, b in ignored_pairs),
            locked=tuple(locked.items()),
            named_places=() if srdf is None or group is None else _places(srdf, group, chain),
            model=model,
            capsules=pack(chain.shapes),
            T_link_tip=_frozen(chain.T_last_tip),
        )

    @property
    def unlimited(self) -> Bools:
        """(n,) joints that neither a torque nor an acceleration limit keeps from speeding up at once."""
        return np.asarray((self.torque_max >= UNLIMITED) & np.isinf(self.acceleration_max))

    @property
    def places(self) -> dict[str, Floats]:
        """Postures (n,) by the names that an SRDF gives them [rad or m]."""
        return dict(self.named_places)

    def __reduce__(self) -> tuple[object, tuple[dict[str, Any]]]:
        return _arrived, ({field.name: getattr(self, field.name) for field in fields(self)},)

    def _rows(self, values: ArrayLike, what: str) -> tuple[Floats, tuple[int, ...]]:
        """A contiguous, writable copy (N, n), so that every kernel is compiled once only; and the leading axes."""
        try:
            array = np.array(values, dtype=np.float64, order="C")
        except (TypeError, ValueError, OverflowError):
            array = np.array(math.nan)
        if array.ndim == 0 or array.shape[-1] != self.dof:
            raise RobotError(
                f"arm {self.name!r}: {what} has shape {array.shape}",
                remedy=f"give (..., {self.dof}): one value per joint",
                element=what,
            )
        if not math.isfinite(float(array.sum())) and not np.isfinite(array).all():
            raise RobotError(f"arm {self.name!r}: {what} is not finite", remedy="give finite numbers", element=what)
        return array.reshape(-1, self.dof), array.shape[:-1]

    def _frames(self, q: ArrayLike) -> Floats:
        rows, lead = self._rows(q, "q")
        T = np.empty((len(rows), self.dof + 1, 4, 4))
        kernels.batch_link_frames(self.model, rows, T)
        return T.reshape(*lead, self.dof + 1, 4, 4)

    def tip_pose(self, q: ArrayLike) -> Floats:
        """T_world_tip (..., 4, 4)."""
        return self._frames(q)[..., self.dof, :, :]

    def link_poses(self, q: ArrayLike) -> Floats:
        """T_world_link (..., n, 4, 4) of the moving links."""
        return self._frames(q)[..., : self.dof, :, :]

    def jacobian(self, q: ArrayLike) -> Floats:
        """Geometric Jacobian (..., 6, n) of the tip in world axes: linear rows, then angular."""
        rows, lead = self._rows(q, "q")
        J = np.empty((len(rows), 6, self.dof))
        kernels.batch_jacobian(self.model, rows, J)
        return J.reshape(*lead, 6, self.dof)

    def levers(self, reach: Floats, q_max: Floats) -> Floats:
        """(n, shapes) how far a point of each shape gets, at most, per radian or metre of each joint.

        Args:
            reach: (shapes,) how far the points are from the origin of their link [m].
            q_max: (n,) how far the joints are from zero; what counts is how far slides stand out [m].
        """
        model = self.model
        step = np.linalg.norm(model.placement_p, axis=1) + np.where(model.prismatic, q_max, 0.0)  # from link to link
        lever = np.zeros((self.dof, len(reach)))
        for k, link in enumerate(self.capsules.link):
            for j in range(link + 1):
                lever[j, k] = 1.0 if model.prismatic[j] else reach[k] + step[j + 1 : link + 1].sum()
        return lever

    def mass_matrix(self, q: ArrayLike) -> Floats:
        """Joint-space inertia J(q) (..., n, n) of Lee1991 eq. 1 [kg m^2, kg m or kg]."""
        rows, lead = self._rows(q, "q")
        J = np.empty((len(rows), self.dof, self.dof))
        kernels.batch_mass_matrix(self.model, rows, J)
        return J.reshape(*lead, self.dof, self.dof)

    def inverse_dynamics(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, friction: bool = True) -> Floats:
        """Torques (..., n) of Lee1991 eq. 1: J q'' + C[q', q'] + G, and friction unless ``friction=False``.

        Friction is ``damping * qd + coulomb * sign(qd)``: a joint at rest has none.
        """
        try:
            given = [np.asarray(values, dtype=np.float64) for values in (q, qd, qdd)]
        except (TypeError, ValueError, OverflowError) as error:
            raise RobotError(f"arm {self.name!r}: q, qd, qdd are not numbers", remedy="give (..., n)") from error
        try:
            given = [np.broadcast_to(array, np.broadcast_shapes(*(a.shape for a in given))) for array in given]
        except ValueError as error:
            shapes = ", ".join(str(a.shape) for a in given)
            raise RobotError(f"arm {self.name!r}: q, qd, qdd have shapes {shapes}", remedy="make them agree") from error
        (rows, lead), (speed, _), (acceleration, _) = (
            self._rows(array, what) for array, what in zip(given, ("q", "qd", "qdd"), strict=True)
        )
        tau = np.empty_like(rows)
        kernels.batch_inverse_dynamics(self.model, rows, speed, acceleration, tau)
        if friction:
            tau += self.damping * speed + self.coulomb * np.sign(speed)
        return tau.reshape(*lead, self.dof)


def _arrived(values: dict[str, Any]) -> Arm:
    """An arm after its way to another process, on which arrays forget that they may not be written to.

    For numba that is another type: every kernel would be compiled again.
    """
    read_only(tuple(values.values()))
    return Arm(**values)


def _with_tool(chain: Chain, tool: Tool) -> Chain:
    assert tool.T_link_tool is not None
    assert tool.com is not None
    assert tool.inertia is not None
    T_tip = chain.T_last_tip @ tool.T_link_tool
    R, p = T_tip[:3, :3], T_tip[:3, 3]
    *before, last = chain.joints
    own = (last.body.mass, last.body.com, last.body.inertia)
    body = merge_inertia([own, (tool.mass, R @ tool.com + p, R @ tool.inertia @ R.T)])
    shapes = chain.shapes
    if tool.hull is not None:
        hull = make_shape("convex", (), T_tip, link=len(before), link_name="tool", vertices=tool.hull)
        shapes = (*shapes, hull)
    return replace(chain, joints=(*before, replace(last, body=body)), shapes=shapes, T_last_tip=T_tip)


def _check_pairs(file: Path, pairs: Sequence[tuple[str, str]], shapes: Sequence[Shape]) -> None:
    known = {shape.link_name for shape in shapes}
    for link in (link for pair in pairs for link in pair):
        if link not in known:
            raise RobotError(
                f"{file}: ignored_pairs: no link {link!r} with a collision shape",
                remedy=f"links: {', '.join(sorted(known))}",
                file=str(file),
                element=link,
            )


def _model(chain: Chain, damping: Floats, gravity: Floats, T_base: Floats) -> ArmModel:
    joints, bodies, T_tip = chain.joints, [joint.body for joint in chain.joints], chain.T_last_tip
    prismatic = np.array([joint.type == "prismatic" for joint in joints])
    prismatic.setflags(write=False)
    return ArmModel(
        placement_R=_frozen([joint.T_before_link[:3, :3] for joint in joints]),
        placement_p=_frozen([joint.T_before_link[:3, 3] for joint in joints]),
        axis=_frozen([joint.axis for joint in joints]),
        prismatic=prismatic,
        mass=_frozen([body.mass for body in bodies]),
        com=_frozen([body.com for body in bodies]),
        inertia=_frozen([body.inertia for body in bodies]),
        damping=damping,
        gravity=_frozen(gravity),
        base_R=_frozen(T_base[:3, :3]),
        base_p=_frozen(T_base[:3, 3]),
        tip_R=_frozen(T_tip[:3, :3]),
        tip_p=_frozen(T_tip[:3, 3]),
    )


def _entries(given: Sequence[Any] | Floats | None, n: int, key: str) -> list[Any]:
    """One entry per joint; all None where nothing is given."""
    if given is None:
        return [None] * n
    try:
        entries = [] if isinstance(given, str) else list(given)
    except TypeError:
        entries = []
    if len(entries) != n:
        raise RobotError(f"{key} has {len(entries)} entries", remedy=f"give {n}, one per joint", element=key)
    return entries


def _limits(
    file: Path, joints: tuple[ChainJoint, ...], attribute: str, key: str, given: Sequence[float | None] | Floats | None
) -> Floats:
    values = []
    for i, (joint, own) in enumerate(zip(joints, _entries(given, len(joints), key), strict=True)):
        value = getattr(joint, attribute) if own is None else read_number(own)
        if attribute == "effort" and own is None and value == 0.0:
            value = UNLIMITED  # so the files of many industrial robots say that they do not tell
        element = f"joint {joint.name!r}"
        if own is not None and not 0.0 < value <= LIMIT_MAX:
            remedy = f"give a limit > 0 and up to {LIMIT_MAX:g}"
            raise RobotError(f"{key}[{i}] = {own!r:.60} for {element} is not > 0", remedy=remedy, element=element)
        if value is None or not value > 0.0:
            raise RobotError(
                f"{file}: {element} has no {attribute} limit"
                if value is None
                else f"{file}: {element} has {attribute}={value}",
                remedy=f"add <limit {attribute}=...> > 0 or give {key}",
                file=str(file),
                element=element,
            )
        values.append(value)
    return _frozen(values)


def _group(given: JointKeywords) -> tuple[Srdf | None, str | None]:
    """The SRDF, and the group that is asked for."""
    file, group = given.get("srdf"), given.get("group")
    if file is None and group is not None:
        raise RobotError(f"group {group!r} is of an SRDF, and none is given", remedy="give srdf, or leave it out")
    return None if file is None else read_srdf(file), group


def _with_limits(given: JointKeywords, names: Sequence[str]) -> JointKeywords:
    """Limits of MoveIt's file, where those given are None."""
    file = given["joint_limits"]
    assert file is not None
    merged: dict[str, Any] = dict(given)
    for key, values in read_joint_limits(file, names).items():
        own = _entries(merged.get(key), len(names), key)
        merged[key] = [theirs if mine is None else mine for mine, theirs in zip(own, values, strict=True)]
    return cast("JointKeywords", merged)


def _all_pairs(pairs: Sequence[tuple[str, str]], srdf: Srdf, shapes: Sequence[Shape]) -> tuple[tuple[str, str], ...]:
    """Pairs that are ignored, and those of the SRDF whose links have shapes."""
    solid = {shape.link_name for shape in shapes}
    known = {frozenset(pair) for pair in pairs}
    more = [pair for pair in srdf.disabled_pairs if solid.issuperset(pair) and frozenset(pair) not in known]
    return (*pairs, *more)


def _places(srdf: Srdf, group: str, chain: Chain) -> tuple[tuple[str, Floats], ...]:
    """The states of a group that name all joints of the chain."""
    names = [joint.name for joint in chain.joints]
    states = srdf.states.get(group, {})
    whole = {key: at for key, at in states.items() if at.keys() >= set(names)}
    return tuple((key, _frozen([at[name] for name in names])) for key, at in whole.items())


def _check_mass(substitute: float | None) -> None:
    if substitute is not None and not 0.0 < read_number(substitute) <= MASS_MAX:
        raise RobotError(f"substitute_mass = {substitute!r:.60} is not > 0", remedy=f"give up to {MASS_MAX:g} kg")


def _unlimited(
    file: Path, joints: tuple[ChainJoint, ...], attribute: str, key: str, given: Sequence[float | None] | Floats | None
) -> Floats:
    """Limits that none is reached of, for the ``attribute`` of an arm without inertia."""
    if any(own is not None for own in _entries(given, len(joints), key)):
        raise RobotError(
            f"{file}: {key} is given in place of {attribute} limits, but no link has an <inertial>",
            remedy="add masses and inertias, or leave it out: limits of speed and acceleration are kept",
            file=str(file),
        )
    return _frozen(np.full(len(joints), UNLIMITED))


def _filled(
    default: Sequence[float],
    joints: tuple[ChainJoint, ...],
    key: str,
    given: Sequence[float | None] | Floats | None,
    *,
    zero: bool = True,
) -> Floats:
    """One value per joint: the given one, or the default where it is None. ``zero``: friction; else a limit, or inf."""
    values = []
    for i, own in enumerate(_entries(given, len(joints), key)):
        value = default[i] if own is None else read_number(own)
        if not (0.0 <= value <= FORCE_MAX if zero else 0.0 < value <= LIMIT_MAX or value == math.inf):
            what, most = (">= 0 and finite", FORCE_MAX) if zero else ("> 0", LIMIT_MAX)
            element = f"joint {joints[i].name!r}"
            raise RobotError(
                f"{key}[{i}] = {own!r:.60} for {element} is not {what}",
                remedy=f"give a number {what}, up to {most:g}",
                element=element,
            )
        values.append(value)
    return _frozen(values)


def _position_limits(
    file: Path, joints: tuple[ChainJoint, ...], given: Sequence[Sequence[float] | None] | Floats | None
) -> Floats:
    rows = []
    for i, (joint, own) in enumerate(zip(joints, _entries(given, len(joints), "position_limits"), strict=True)):
        element = f"joint {joint.name!r}"
        pair = (joint.lower, joint.upper) if own is None else _pair(own)
        if pair is None:
            raise RobotError(
                f"position_limits[{i}] for {element} is not a pair", remedy="give [lower, upper]", element=element
            )
        lower, upper = pair
        if lower is None or upper is None or not lower < upper:
            raise RobotError(
                f"{file}: {element} has no position limits with lower < upper",
                remedy="add <limit lower=... upper=...> or give position_limits",
                file=str(file),
                element=element,
            )
        rows.append((lower, upper))
    return _frozen(rows)


def _pair(given: Any) -> tuple[float, float] | None:
    """Two numbers, infinite ones too (a joint may turn without end); None: no pair."""
    try:
        lower, upper = given
    except (TypeError, ValueError):
        return None
    low, high = read_number(lower), read_number(upper)
    sane = all(abs(value) <= LIMIT_MAX or math.isinf(value) for value in (low, high))
    return (low, high) if sane else None
