"""What batches of episodes are made with: threads, random generators, states."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from gymnasium.utils import seeding

from armtempo.envs.common import Chunks, Generators, sums_of, with_masks
from armtempo.errors import InputError


@pytest.mark.parametrize(("episodes", "threads"), [(1, 3), (7, 1), (7, 3), (8, 8)])
def test_chunks_cover_all_episodes_once(episodes: int, threads: int) -> None:
    chunks, seen = Chunks(episodes, threads), np.zeros(episodes, dtype=np.int64)

    def work(k: int, first: int, last: int) -> None:
        assert chunks.bounds[k] == (first, last)
        seen[first:last] += 1

    chunks.run(work)
    chunks.close()
    chunks.close()
    assert (seen == 1).all()
    assert len(chunks.bounds) == min(episodes, threads)


def test_chunks_run_at_the_same_time_and_errors_come_out() -> None:
    chunks, all_here = Chunks(3, 3), threading.Barrier(3, timeout=20.0)

    def meets(*_: int) -> None:
        all_here.wait()

    def fails(k: int, *_: int) -> None:
        if k == 2:
            raise InputError("no")

    chunks.run(meets)
    with pytest.raises(InputError, match="no"):
        chunks.run(fails)
    chunks.close()
    with pytest.raises(InputError, match="threads"):
        Chunks(3, 0)


def test_generators_are_those_of_single_environments_and_go_on_from_their_state() -> None:
    some, mask = Generators(3), np.array([True, True, False])
    some.seed([5, None, 7], mask)
    assert some.each[0].random() == seeding.np_random(5)[0].random()
    some.each[0].integers(9, dtype=np.uint32)  # leaves half a number behind
    others, state = Generators(3), some.get_state()
    others.set_state(state)
    for one, other in zip(some.each, others.each, strict=True):
        assert one.integers(2**31, size=5).tolist() == other.integers(2**31, size=5).tolist()
        assert one.bit_generator.state == other.bit_generator.state


def test_sums_have_the_bits_of_pythons() -> None:
    terms = np.random.default_rng(0).normal(size=(5, 40)) * 10.0 ** np.arange(-8, 12, 4)[:, None]
    assert sums_of(terms).tolist() == [float(sum(terms[:, e].tolist())) for e in range(40)]


def test_infos_have_a_mask_each() -> None:
    mask = np.array([True, False])
    infos = with_masks({"length_m": np.ones(2)}, mask)
    assert set(infos) == {"length_m", "_length_m"}
    np.testing.assert_array_equal(infos["_length_m"], mask)
