"""The house keeps its shape: functions stay small, modules have tests, nothing is imported late to dodge a circle.

Circles and the order of the rooms are import-linter's business (``make check``).
"""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDERS = ("configs", "robots", "planners", "envs", "agents", "commands")
KERNELS = {"njit", "inlined", "uncounted", "unlocked"}

MOST_LINES, MOST_KERNEL_LINES = 60, 80  # without the docstring
MOST_ARGUMENTS = 8  # outside kernels
MOST_COMPLEXITY, MOST_KERNEL_COMPLEXITY = 12, 25

EXCEPTIONS: dict[str, str] = {
    "robots/_arm.py::from_urdf": "nine: what robot files leave open, by keyword",
    "commands/_plan.py::plan": "nine flags: its arguments are what the command takes",
}
"""Functions over a limit, ``file::name``, and why; ten at most."""

TESTED_ELSEWHERE: dict[str, tuple[str, ...]] = {
    "tests/configs/files/test_load.py": (
        "configs/schema/_arm.py",
        "configs/schema/_base.py",
        "configs/schema/_blend.py",
        "configs/schema/_cell.py",
        "configs/schema/_coordination.py",
        "configs/schema/_geometry.py",
        "configs/schema/_ik.py",
        "configs/schema/_obstacles.py",
    ),
    "tests/configs/training/test_train.py": (
        "configs/training/_algorithms.py",
        "configs/training/_base.py",
        "configs/training/_blend.py",
        "configs/training/_coordination.py",
        "configs/training/_ik.py",
    ),
    "tests/agents/training/test_sweep.py": (
        "configs/files/_trials.py",
        "configs/training/_sweep.py",
        "agents/training/_sweep_objective.py",
    ),
    "tests/robots/test_arm.py": (
        "robots/_kernels.py",
        "robots/_model.py",
        "robots/_sizes.py",
    ),
    "tests/planners/blends/test_blend.py": (
        "planners/blends/_least_time.py",
        "planners/blends/_passing_cost.py",
    ),
    "tests/planners/blends/test_blended_path.py": ("planners/blends/_path_kernels.py",),
    "tests/planners/line_speed/test_limit_aware.py": (
        "planners/line_speed/_path_samples.py",
        "planners/line_speed/_speed_guess.py",
        "planners/line_speed/_stations.py",
    ),
    "tests/planners/cells/test_task.py": ("configs/schema/_task.py",),
    "tests/envs/blend/test_env.py": (
        "planners/cells/_blend_families.py",
        "envs/blend/_kernels.py",
        "envs/blend/_observation.py",
        "envs/blend/_options.py",
        "envs/blend/_simulation.py",
    ),
    "tests/planners/cells/test_ik_cell.py": ("planners/cells/_pose_families.py",),
    "tests/test_cache.py": ("planners/charts/_motion_content.py",),
    "tests/planners/coordination/test_joint_program.py": ("planners/coordination/_joint_kernels.py",),
    "tests/planners/coordination/test_order_search.py": ("planners/coordination/_order_kernels.py",),
    "tests/planners/coordination/test_interval_search.py": ("planners/coordination/_interval_kernels.py",),
    "tests/planners/coordination/test_joint_bound.py": ("planners/coordination/_joint_bound_kernels.py",),
    "tests/planners/schedules/test_methods.py": ("planners/schedules/_schedule.py",),
    "tests/planners/exports/test_export.py": (
        "planners/exports/_mcap.py",
        "planners/exports/_messages.py",
        "planners/exports/_urscript.py",
    ),
    "tests/planners/ik/test_feedback.py": (
        "planners/ik/_error_bounds.py",
        "planners/ik/_law.py",
        "planners/ik/_track.py",
    ),
    "tests/planners/instances/test_generator.py": (
        "planners/instances/_benchmark_set.py",
        "planners/instances/_cell_draws.py",
        "planners/instances/_shaping.py",
    ),
    "tests/envs/coordination/graph/test_view.py": (
        "envs/coordination/graph/_entries.py",
        "envs/coordination/graph/_kernels.py",
        "envs/coordination/graph/_spaces.py",
    ),
    "tests/agents/policies/test_graph_network.py": (
        "agents/training/_graph_module.py",
        "agents/training/_graph_policy.py",
    ),
    "tests/agents/training/test_graph_training.py": (
        "agents/coordination/_teaching.py",
        "agents/coordination/_team_training.py",
        "agents/training/_imitation.py",
        "agents/training/vec_envs/_team.py",
        "agents/training/vec_envs/_whole.py",
    ),
    "tests/agents/coordination/test_order_policies.py": (
        "envs/coordination/shield/_deciding.py",
        "envs/coordination/shield/_foresight.py",
        "envs/coordination/shield/_keeper.py",
        "envs/coordination/shield/_stops_seen.py",
    ),
    "tests/planners/joint_paths/test_cartesian_joint_path.py": (
        "planners/joint_paths/_cartesian_joint_kernels.py",
        "planners/joint_paths/_pose_path.py",
    ),
    "tests/planners/joint_paths/test_two_link_path.py": ("planners/joint_paths/_planar_pair.py",),
    "tests/agents/behaviours/test_many_arms.py": ("planners/schedules/_vci_execution.py",),
    "tests/envs/blend/test_vector_env.py": (
        "envs/blend/_batch.py",
        "envs/blend/_periods.py",
    ),
    "tests/envs/behaviours/test_state.py": ("envs/common/_saved.py",),
    "tests/envs/bodies/test_scene.py": ("envs/bodies/_bullet.py", "envs/bodies/_bullet_scene.py"),
    "tests/envs/ik/test_vector_env.py": (
        "envs/common/_vector_env.py",
        "envs/ik/_batch.py",
    ),
    "tests/envs/coordination/world/test_entries.py": ("envs/coordination/world/_kernels.py",),
    "tests/envs/behaviours/test_life_cycle.py": (
        "envs/common/_single_agent.py",
        "envs/coordination/world/_options.py",
        "envs/ik/_options.py",
    ),
    "tests/envs/behaviours/test_determinism.py": ("envs/common/_random.py",),
    "tests/envs/coordination/test_vector_envs.py": (
        "envs/coordination/_batch.py",
        "envs/coordination/world/_world.py",
    ),
    "tests/envs/behaviours/test_ends.py": (
        "envs/coordination/_episode.py",
        "envs/coordination/world/_simulation.py",
    ),
    "tests/envs/behaviours/test_conformance.py": (
        "envs/coordination/_multi_agent_env.py",
        "envs/coordination/_yielding_env.py",
        "envs/coordination_v0.py",
    ),
    "tests/envs/coordination/shield/test_shield.py": (
        "envs/coordination/_shield_wrappers.py",
        "envs/coordination/shield/_admission.py",
        "envs/coordination/shield/_batch.py",
        "envs/coordination/shield/_episode_shield.py",
        "envs/coordination/shield/_kernels.py",
        "envs/coordination/shield/_trial.py",
    ),
    "tests/envs/ik/test_env.py": (
        "envs/ik/_braking.py",
        "envs/ik/_kernels.py",
        "envs/ik/_observation.py",
        "envs/ik/_periods.py",
        "envs/ik/_simulation.py",
    ),
    "tests/agents/blend/test_kind.py": (
        "agents/blend/_baselines.py",
        "agents/blend/_result.py",
    ),
    "tests/agents/coordination/test_kind.py": ("agents/coordination/_result.py",),
    "tests/agents/ik/test_kind.py": (
        "agents/ik/_baselines.py",
        "agents/ik/_result.py",
    ),
    "tests/agents/evaluation/test_toy_kind.py": (
        "agents/evaluation/_training_task.py",
        "agents/kinds.py",
        "commands/reports/_report.py",
    ),
    "tests/agents/policies/test_agent_file.py": ("agents/training/_export.py",),
    "tests/agents/training/test_train.py": (
        "agents/blend/_training.py",
        "agents/coordination/_training.py",
        "agents/ik/_training.py",
        "agents/training/_checkpoint.py",
        "agents/training/_extra.py",
        "agents/training/_logs.py",
        "agents/training/_model.py",
        "agents/training/_signals.py",
    ),
    "tests/commands/behaviours/test_commands.py": (
        "commands/_cells.py",
        "commands/_evaluate.py",
        "commands/_main.py",
        "commands/console/_flags.py",
        "commands/console/_options.py",
        "commands/console/_output.py",
        "commands/figures/_blend.py",
        "commands/figures/_coordination_plans.py",
        "commands/figures/_ik.py",
        "commands/figures/_one_arm.py",
        "commands/figures/_phase.py",
        "commands/figures/_solve.py",
        "commands/figures/_space.py",
        "commands/figures/_time.py",
        "commands/figures/_write.py",
        "commands/papers/_reproduction.py",
        "commands/papers/lee1991/_figures.py",
        "commands/papers/lee1991/_quantities.py",
        "commands/reports/_blend.py",
        "commands/reports/_coordination.py",
        "commands/reports/_ik.py",
        "commands/_reproduce.py",
    ),
    "tests/commands/test_bench.py": (
        "commands/_generate.py",
        "commands/bench/_agents.py",
        "commands/bench/_arms.py",
        "commands/bench/_coordination.py",
        "commands/bench/_errors.py",
        "commands/figures/_bench.py",
    ),
    "tests/commands/test_film.py": ("commands/figures/_film.py",),
    "tests/commands/test_train.py": ("commands/_sweep.py",),
    "tests/commands/viewer/test_page.py": (
        "commands/viewer/_blend.py",
        "commands/viewer/_ik.py",
        "commands/viewer/_kind_view.py",
        "commands/viewer/_packing.py",
        "commands/viewer/_panels.py",
        "commands/viewer/_scene.py",
    ),
    "tests/commands/papers/chung/test_quantities.py": (
        "commands/papers/chung/_figures.py",
        "commands/papers/chung/_run.py",
    ),
    "tests/commands/papers/lee2006/test_quantities.py": ("commands/papers/lee2006/_figures.py",),
    "tests/commands/test_plan.py": (
        "commands/plans/_blend.py",
        "commands/plans/_coordination.py",
        "commands/plans/_export.py",
        "commands/plans/_ik.py",
        "commands/plans/_motions.py",
        "commands/plans/_plans.py",
    ),
}
"""Modules without a test file of their own, by the one that runs them."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


def _modules() -> Iterator[Path]:
    for folder in FOLDERS:
        yield from sorted((ROOT / folder).rglob("*.py"))


def _functions() -> Iterator[tuple[str, Function, bool]]:
    """``file::name``, the function, whether it is compiled."""
    for file in _modules():
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, Function):
                compiled = any(isinstance(one, ast.Name) and one.id in KERNELS for one in node.decorator_list)
                yield f"{file.relative_to(ROOT).as_posix()}::{node.name}", node, compiled


def test_kernels_that_count_no_references_are_given_no_arrays() -> None:
    """What a counting kernel gives back counts one reference more; who counts none would never take it off again."""
    scalars = {"None", "bool", "float", "int", "np", "tuple", "uint64"}
    counting, asked = set(), {}
    for name, function, compiled in _functions():
        kinds = {one.id for one in function.decorator_list if isinstance(one, ast.Name)}
        returned = {one.id for one in ast.walk(function.returns or ast.Tuple([])) if isinstance(one, ast.Name)}
        if compiled and "inlined" not in kinds and not returned <= scalars:
            counting.add(function.name)
        if "uncounted" in kinds:
            assert returned <= scalars, name
            calls = [one.func for one in ast.walk(function) if isinstance(one, ast.Call)]
            asked[name] = {one.id for one in calls if isinstance(one, ast.Name)}
            asked[name] |= {one.attr for one in calls if isinstance(one, ast.Attribute)}
    assert {name: called & counting for name, called in asked.items() if called & counting} == {}
    assert len(asked) > 20


def _lines(function: Function) -> int:
    first = function.body[0]
    documented = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    docstring = (first.end_lineno or 0) - first.lineno + 1 if documented else 0
    return (function.end_lineno or 0) - function.lineno + 1 - docstring


def test_functions_stay_small() -> None:
    over = set()
    for name, function, compiled in _functions():
        arguments = [one.arg for one in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)]
        own = len([one for one in arguments if one not in ("self", "cls")])
        if _lines(function) > (MOST_KERNEL_LINES if compiled else MOST_LINES):
            over.add(name)
        if own > MOST_ARGUMENTS and not compiled:
            over.add(name)
    assert over - set(EXCEPTIONS) == set()
    assert set(EXCEPTIONS) - over == set(), "no exception that is not needed"
    assert len(EXCEPTIONS) <= 10


def _more_complex_than(limit: int) -> set[str]:
    """Functions of more branches than that, by ruff's count."""
    command = [sys.executable, "-m", "ruff", "check", "--isolated", "--select", "C901", "--output-format", "json"]
    run = subprocess.run(
        [*command, "--config", f"lint.mccabe.max-complexity={limit}", *FOLDERS],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    return {
        f"{Path(complaint['filename']).relative_to(ROOT).as_posix()}::{complaint['message'].split('`')[1]}"
        for complaint in json.loads(run.stdout)
    }


def test_functions_stay_simple() -> None:
    compiled = {name for name, _, kernel in _functions() if kernel}
    assert _more_complex_than(MOST_COMPLEXITY) - compiled == set()
    assert _more_complex_than(MOST_KERNEL_COMPLEXITY) == set()


def test_every_module_has_a_test_or_is_listed_by_the_one_that_runs_it() -> None:
    missing = set()
    for file in _modules():
        module = file.relative_to(ROOT)
        if file.name in ("__init__.py", "kernels.py"):
            continue  # faces
        if not (ROOT / "tests" / module.parent / f"test_{file.stem.lstrip('_')}.py").is_file():
            missing.add(module.as_posix())
    listed = {module for modules in TESTED_ELSEWHERE.values() for module in modules}
    assert missing - listed == set()
    assert listed - missing == set(), "no line that is not needed"
    assert [test for test in TESTED_ELSEWHERE if not (ROOT / test).is_file()] == []


def test_nothing_of_ours_is_imported_late_below_the_commands() -> None:
    late = set()
    for name, function, _ in _functions():
        for node in ast.walk(function):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("armtempo"):
                late.add(name)
    allowed = {name for name in late if name.startswith("commands/")}  # a command loads what it needs when it runs
    allowed |= {name for name in late if name.startswith("agents/training/")}  # torch and stable-baselines3
    assert late - allowed == set()
