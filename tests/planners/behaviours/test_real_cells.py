"""The bundled cells of real arms: they load, their fastest motions conflict, one arm after the other does not."""

from __future__ import annotations

import json
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from armtempo.configs import bundled_cells, data_path, parse_cell_config
from armtempo.errors import ConfigError, InputError, PathError
from armtempo.planners import CoordinationCell, build_cell, load_cell
from armtempo.planners.joint_paths import WaypointPath

REAL = ("panda-pair", "iiwa-pair", "planar-four")


@pytest.fixture(scope="module", params=REAL)
def cell(request: pytest.FixtureRequest) -> CoordinationCell:
    return load_cell(request.param)


def clearance(cell: CoordinationCell, i: int, j: int, shares: tuple[np.ndarray, np.ndarray]) -> float:
    """Smallest distance of two arms while both go along their paths by the given shares."""
    q_i, q_j = (
        cell.paths[k].evaluate(share * cell.paths[k].length)[0] for k, share in zip((i, j), shares, strict=True)
    )
    return min(cell.clearance.between(i, j, a, b, 0.05).distance for a, b in zip(q_i, q_j, strict=True))


def test_fastest_motions_collide_and_orders_do_not(cell: CoordinationCell) -> None:
    assert cell.name in bundled_cells()
    still, go = np.zeros(200), np.linspace(0.0, 1.0, 200)
    collide = set()
    for i, j in combinations(range(len(cell.arms)), 2):
        instants = np.linspace(0.0, min(cell.fastest[k].duration for k in (i, j)), 200)
        together = tuple(cell.fastest[k].at(instants)[0] / cell.paths[k].length for k in (i, j))
        assert len(together) == 2
        if clearance(cell, i, j, together) < cell.d_min:
            collide.add((i, j))
        for shares in ((go, still), (still, go), (go, still + 1.0), (still + 1.0, go)):  # whoever goes first passes
            assert clearance(cell, i, j, shares) > cell.planned_clearance
    assert len(collide) >= {2: 1, 4: 5}[len(cell.arms)]


def test_fastest_motions_keep_every_limit(cell: CoordinationCell) -> None:
    for arm, path, motion in zip(cell.arms, cell.paths, cell.fastest, strict=True):
        assert isinstance(path, WaypointPath)
        assert motion.certificate.excess < 1e-3
        t = np.linspace(0.0, motion.duration, 4001)[1:-1]
        lam, mu, mu_dot = (value[:, None] for value in motion.at(t))
        q, dq, ddq = path.evaluate(lam[:, 0])
        assert (q >= arm.position_min - 1e-9).all()
        assert (q <= arm.position_max + 1e-9).all()
        qd, qdd = dq * mu, ddq * mu**2 + dq * mu_dot
        assert (np.abs(qd) <= arm.speed_max * 1.001).all()
        assert (np.abs(qdd) <= arm.acceleration_max * 1.001).all()
        torque = arm.inverse_dynamics(q, qd, qdd)
        assert (np.abs(torque) <= (1.0 - cell.torque_reserve) * arm.torque_max * 1.001).all()


def panda_pair() -> dict[str, Any]:
    data: dict[str, Any] = yaml.safe_load(data_path("cells/panda-pair.yaml").read_text(encoding="utf-8"))
    return data


def test_data_sheets_reach_the_arms_and_cells_override_them(tmp_path: Path) -> None:
    data = panda_pair()
    data["arms"] = data["arms"][:1]
    data["arms"][0] |= {
        "limits": {"torque_nm": [None] * 6 + [5]},
        "friction": {"viscous_nm_s_rad": [0] * 7, "coulomb_nm": [0] * 7},
    }
    arm = build_cell(parse_cell_config(data, tmp_path / "mine.yaml")).arms[0]
    np.testing.assert_array_equal(arm.torque_max, [87, 87, 87, 87, 12, 12, 5])
    np.testing.assert_array_equal(arm.acceleration_max, [15, 7.5, 10, 12.5, 15, 20, 20])
    np.testing.assert_array_equal(arm.coulomb, np.zeros(7))
    assert arm.position_max[3] == -0.0698
    assert arm.tip_link == "panda_grasptarget"


def test_waypoints_may_stand_in_a_file(tmp_path: Path) -> None:
    data = panda_pair()
    data["arms"] = data["arms"][:1]
    data["arms"][0]["friction"] = {"viscous_nm_s_rad": [0] * 7, "coulomb_nm": [0] * 7}
    waypoints = data["arms"][0]["path"].pop("waypoints_rad")
    data["arms"][0]["path"] = {"waypoints_file": "left.json"}
    (tmp_path / "left.json").write_text(json.dumps(waypoints))
    path = build_cell(parse_cell_config(data, tmp_path / "mine.yaml")).paths[0]
    assert isinstance(path, WaypointPath)
    np.testing.assert_array_equal(path.waypoints, waypoints)

    (tmp_path / "left.json").write_text("[[0, 1]]")
    with pytest.raises(InputError, match=r"mine.yaml, arms\[0\].path: waypoints have 2 joint positions"):
        build_cell(parse_cell_config(data, tmp_path / "mine.yaml"))
    waypoints[2][3] = 0.5
    (tmp_path / "left.json").write_text(json.dumps(waypoints))
    with pytest.raises(PathError, match=r"arms\[0\].path: path of arm 'left': joint 'panda_joint4' reaches"):
        build_cell(parse_cell_config(data, tmp_path / "mine.yaml"))
    (tmp_path / "left.json").unlink()
    with pytest.raises(ConfigError, match=r"no file 'left.json'"):
        build_cell(parse_cell_config(data, tmp_path / "mine.yaml"))
