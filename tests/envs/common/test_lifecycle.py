"""The life of an environment by itself: what may follow what."""

from __future__ import annotations

from typing import Any

import pytest

from armtempo.envs.common._lifecycle import Lifecycle
from armtempo.errors import ActionError, InputError, RenderError, UnknownNameError

KNOWN = ("master_late_s", "cell")


def test_a_step_needs_a_reset_that_went_well() -> None:
    life = Lifecycle(None)
    with pytest.raises(ActionError, match=r"the episode is over .*call reset before step"):
        life.check_running()
    life.begin(None, KNOWN)
    assert not life.running  # the environment says so once it is ready
    life.running = True
    life.check_running()
    with pytest.raises(UnknownNameError):
        life.begin({"cel": 1}, KNOWN)
    with pytest.raises(ActionError, match="the episode is over"):  # the one before is over all the same
        life.check_running()


def test_options_come_back_as_given_and_ignored_ones_pass() -> None:
    life = Lifecycle(None)
    assert life.begin(None, KNOWN) == {}
    options = {"cell": 1, "options": 2}
    assert life.begin(options, KNOWN, ignored=("options",)) is options
    with pytest.raises(UnknownNameError, match="reset option 'options'"):
        life.begin(options, KNOWN)


@pytest.mark.parametrize("bad", [3, "cell", [("cell", 1)]])
def test_options_that_are_no_mapping_are_told_the_names(bad: Any) -> None:
    with pytest.raises(InputError, match=r"options must map names to values.*known: master_late_s, cell"):
        Lifecycle(None).begin(bad, KNOWN)


def test_closed_is_closed_and_may_be_closed_again() -> None:
    life = Lifecycle("rgb_array")
    life.running = True
    life.close()
    life.close()
    with pytest.raises(ActionError, match=r"the environment is closed .*make a new one"):
        life.check_running()
    with pytest.raises(InputError, match="the environment is closed"):
        life.begin(None, KNOWN)
    simulation: Any = None
    with pytest.raises(RenderError, match="the environment is closed"):
        life.render(simulation)


def test_a_mode_that_is_none_is_refused_and_without_one_nothing_is_drawn() -> None:
    with pytest.raises(RenderError, match="rgb"):
        Lifecycle("rgb")
    simulation: Any = None
    assert Lifecycle(None).render(simulation) is None
