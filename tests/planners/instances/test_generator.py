"""Random cells: the same whatever is drawn before, filtered, labelled; and the fixed set made of them."""

from __future__ import annotations

import dataclasses
import json
import math
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest

from armtempo.configs import data_path
from armtempo.envs import CoordinationEnv
from armtempo.errors import InfeasibleError, InputError, UnknownNameError
from armtempo.planners import METHODS, benchmark_instances, build_cell, generate_cell, schedule
from armtempo.planners.coordination import OrderSearch
from armtempo.planners.instances import PARTS, CellLabels, GeneratedCell, draw_benchmark, label_cell
from armtempo.planners.instances._shaping import full_speed_makespan

IN_ANOTHER_PROCESS = """
import json
from armtempo.planners import generate_cell
one = generate_cell("planar", 1, 1)
print(json.dumps([one.data, one.labels.record(), one.rejected]))
"""


@pytest.fixture(scope="module")
def impossible() -> GeneratedCell:
    return generate_cell("planar", 1, 0)


@pytest.fixture(scope="module")
def uniform(impossible: GeneratedCell) -> GeneratedCell:
    """Drawn after another one."""
    return generate_cell("planar", 1, 1)


def test_an_instance_is_the_same_in_another_process_without_those_before_it(uniform: GeneratedCell) -> None:
    done = subprocess.run([sys.executable, "-c", IN_ANOTHER_PROCESS], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == json.loads(json.dumps([uniform.data, uniform.labels.record(), uniform.rejected]))


def test_instances_differ(uniform: GeneratedCell, impossible: GeneratedCell) -> None:
    assert uniform.data["arms"] != impossible.data["arms"]
    assert generate_cell("planar", 2, 1).data["arms"] != uniform.data["arms"]


def test_draws_are_filtered_and_counted(uniform: GeneratedCell) -> None:
    assert sum(uniform.rejected.values()) > 0
    assert set(uniform.rejected) <= {
        "the arms do not meet",
        "the arms start or end too close",
        "an arm is too weak for its path",
        "a path leaves the arm's reach or joint limits",
        "links of one arm touch, or an obstacle",
        "the minimum time depends on the grid",
    }
    cell = uniform.cell
    cell.check_ends()
    assert not cell.timing.is_free(cell.fastest)
    nearest = min(
        cell.clearance.arms([p.evaluate(m.at(t)[0])[0] for p, m in zip(cell.paths, cell.fastest, strict=True)]).distance
        for t in [k * 0.002 for k in range(300)]
    )
    assert nearest < cell.planned_clearance


def test_labels_are_those_of_the_cell_built_again(uniform: GeneratedCell) -> None:
    labels = label_cell(build_cell(uniform.cell.config))
    assert labels == uniform.labels
    assert labels.status == "feasible"
    assert labels.priority_class == "uniform"
    assert CellLabels.from_record(json.loads(json.dumps(labels.record()))) == labels
    assert labels.differences(uniform.labels) == ()
    moved = dataclasses.replace(labels, lower_bound=labels.lower_bound * 1.001, regions=7)
    assert labels.differences(moved) == ("lower_bound", "regions")


def test_nobody_plans_what_is_certified_infeasible(impossible: GeneratedCell) -> None:
    assert impossible.labels.status == "certified infeasible"
    assert math.isinf(impossible.labels.lower_bound)
    assert impossible.labels.record()["lower_bound_s"] is None
    assert CellLabels.from_record(impossible.labels.record()) == impossible.labels
    for method in METHODS:
        for order in ((0, 1), (1, 0)):
            with pytest.raises(InfeasibleError):
                schedule(impossible.cell, method, order=order)


@pytest.mark.parametrize(("family", "arms"), [("ring", 3), ("rows", 4), ("fixture", 3), ("ur5e", 3)])
def test_cells_have_as_many_arms_as_wanted(family: str, arms: int) -> None:
    drawn = generate_cell(family, 1, 0, arms=arms)
    assert len(drawn.cell.arms) == len(drawn.labels.minimum_times) == arms
    assert drawn.data["name"] == f"{family}{arms}-1-0000"
    assert bool(drawn.data.get("obstacles")) == (family == "fixture")


def test_shaped_cells_are_those_in_which_full_speed_is_slower_than_the_optimum() -> None:
    shaped = generate_cell("shaped", 1, 0).cell
    env = CoordinationEnv(shaped, physics="ideal", shield=True)
    env.reset(seed=0)
    while env.agents:
        env.step({agent: np.ones(1, dtype=np.float32) for agent in env.agents})
    optimum = schedule(shaped, "optimal").makespan
    assert optimum < 0.97 * env.simulation.arrival.max()
    search = OrderSearch(shaped.passing_orders(), shaped.planes)
    best, _ = search.best(np.zeros(2), search.times_to_go(np.zeros(2), np.zeros(2)))
    found = min(full_speed_makespan(shaped, search.regions.precedence(orders)) for orders in best)
    assert optimum < 0.97 * found
    assert found == pytest.approx(env.simulation.arrival.max(), rel=0.02)  # one order leads on, or is the better one


def test_what_cannot_be_drawn_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="planar"):
        generate_cell("scara", 1, 0)
    with pytest.raises(InputError, match="6 arms of family 'panda'") as refused:
        generate_cell("panda", 1, 0, arms=6)
    assert refused.value.remedy == "give one of 2, 3, 4"
    with pytest.raises(InputError, match="negative"):
        generate_cell("planar", -1, 0)


def test_the_set_is_small_and_split_by_its_rule() -> None:
    assert data_path("benchmarks/coordination.json").stat().st_size < 1_000_000
    everything = benchmark_instances()
    assert len({one.name for one in everything}) == len(everything)
    assert len(benchmark_instances("test")) + len(benchmark_instances("train")) + len(
        benchmark_instances("validation")
    ) == len(everything)
    for family in ("planar", "panda", "iiwa"):
        splits = Counter(one.split for one in benchmark_instances(family=family))
        assert splits["train"] > splits["test"] >= splits["validation"] >= (0 if family == "iiwa" else 1)
        classes = {one.labels.priority_class for one in benchmark_instances("test", family=family)}
        assert classes >= {"mixed", "uniform"}
    for arms, least in ((3, 20), (4, 20), (5, 10), (6, 10), (8, 2)):
        assert sum(one.labels.status == "feasible" for one in benchmark_instances("test", arms=[arms])) >= least
    assert sum(one.labels.status == "feasible" for one in benchmark_instances("test")) >= 100
    assert Counter((one.family, one.arms) for one in everything) == {
        (part.family, part.arms): sum(part.kinds.values()) for part in PARTS
    }
    with pytest.raises(UnknownNameError, match="validation"):
        benchmark_instances("dev")
    with pytest.raises(UnknownNameError, match="planar"):
        benchmark_instances(family="scara")


def test_records_build_the_cells_that_were_labelled() -> None:
    for family in ("planar", "iiwa"):
        one = benchmark_instances("test", family=family)[0]
        cell = one.build()
        assert label_cell(cell).differences(one.labels) == ()


def test_the_generator_draws_the_set_again() -> None:
    drawn, stored = (one.record() for one in (next(draw_benchmark(PARTS[0])), benchmark_instances(family="planar")[0]))
    times = [record["labels"].pop("minimum_times_s") for record in (drawn, stored)]
    assert times[0] == pytest.approx(times[1], rel=1e-12)  # last bits are the machine's
    assert drawn == stored
    one = benchmark_instances(family="planar")[2]
    assert generate_cell(one.family, one.seed, one.index).data == one.data
