"""Whether an arm on its path keeps clear of itself and of what stands around: certified, between samples too."""

from __future__ import annotations

from armtempo.errors import CollisionError
from armtempo.planners.charts._arm_sweep import swept_displacements
from armtempo.planners.joint_paths import AbstractJointPath
from armtempo.robots import Arm, Clearance

FINEST_STATION = 2**-10  # share of a path's length to which obstacles and self-collision are certified


def check_path(
    clearance: Clearance, i: int, arm: Arm, path: AbstractJointPath, *, obstacle_distance: float | None = None
) -> None:
    """Certify the path of arm i of ``clearance`` against the arm's own links, and against obstacles.

    Args:
        clearance: FCL distances of the cell.
        i: Place of the arm in it.
        arm: That arm.
        path: Its path.
        obstacle_distance: What is required of obstacles [m]; None: there are none.

    Raises:
        CollisionError: It comes too close; the message names the station and the bodies.
    """
    # of two own links both move
    checks = []
    if clearance.self_pairs(i):
        checks.append((clearance.self_collision, 0.0, 2.0, "itself"))
    if obstacle_distance is not None:
        checks.append((clearance.obstacles, obstacle_distance, 1.0, "an obstacle"))
    if not checks:
        return
    smallest = round(1.0 / FINEST_STATION)
    sweeps = swept_displacements(arm, path, smallest)
    stack = [(1, 0)]
    while stack:
        cells, k = stack.pop()
        station = path.length * (k + 0.5) / cells
        q = path.evaluate(station)[0]
        sweep = sweeps[cells][k]
        for ask, required, movers, what in checks:
            nearest = ask(i, q)
            if nearest.distance - movers * sweep >= required:
                continue
            if nearest.distance < required or cells >= smallest:
                raise CollisionError(
                    f"path of arm {arm.name!r} comes too close to {what} at station {station:.4g} {path.unit}: "
                    f"{nearest.body_a} and {nearest.body_b} are {nearest.distance:.4g} m apart, "
                    f"{required:.4g} m are required",
                    remedy="move the path or the obstacle, or lower d_min_m",
                    arm=arm.name,
                    station=station,
                    bodies=(nearest.body_a, nearest.body_b),
                    clearance_m=nearest.distance,
                    required_m=required,
                )
            stack += [(2 * cells, 2 * k), (2 * cells, 2 * k + 1)]
            break
