"""Pictures: by EGL where it is there, by TinyRenderer else; a window only where there is a display."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import label

from armtempo.arrays import Bools
from armtempo.envs import CoordinationEnv, Renderer, YieldingEnv
from armtempo.envs.bodies import _renderer
from armtempo.envs.bodies._renderer import COLOURS, PICTURE_HEIGHT, PICTURE_WIDTH, egl_available
from armtempo.errors import RenderError
from armtempo.planners import CoordinationCell, IKCell
from armtempo.planners.geometry._pose_motions import harmonic


def _pixels_of(picture: NDArray[np.uint8], arm: int) -> Bools:
    """Where the picture shows an arm: pixels of its hue, stronger than the pale beads of its path."""
    colour = np.array(COLOURS[arm][:3])
    shown = picture / 255.0
    bright = shown.max(axis=2)
    hue = shown / np.maximum(bright, 1e-9)[..., None]
    near = np.abs(hue - colour / colour.max()).max(axis=2) < 0.12
    return np.asarray(near & (bright > 0.15), dtype=np.bool_)


@pytest.fixture(params=["egl", "tiny"])
def renderer_kind(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param == "egl" and not egl_available():
        pytest.skip("no EGL here")
    if request.param == "tiny":
        monkeypatch.setattr(_renderer, "egl_available", lambda: False)
    return str(request.param)


def test_both_arms_are_seen_in_every_picture(lee1991: CoordinationCell, renderer_kind: str) -> None:
    renderer = Renderer(lee1991, "rgb_array")
    assert renderer._scene.hardware == (renderer_kind == "egl")
    try:
        places = []
        for share in (0.0, 0.5, 1.0):
            q = np.array([path.evaluate(share * path.length)[0] for path in lee1991.paths])
            picture = renderer.render(q)
            assert picture is not None
            assert picture.shape == (PICTURE_HEIGHT, PICTURE_WIDTH, 3) == (480, 640, 3)
            assert picture.dtype == np.uint8
            assert picture.flags["C_CONTIGUOUS"]
            assert (picture[[0, 0, -1, -1], [0, -1, 0, -1]] == 255).all()  # on white
            for arm in range(2):
                seen = _pixels_of(picture, arm)
                assert seen.sum() > 1000
                columns = np.flatnonzero(seen.any(axis=0))
                assert 10 < columns.min() < columns.max() < PICTURE_WIDTH - 10  # all of it inside the picture
                places.append(float(np.mean(np.nonzero(seen)[0])))
        assert len(set(places)) == len(places)  # they move
    finally:
        renderer.close()
        renderer.close()


def test_the_master_is_on_the_left(lee1991: CoordinationCell) -> None:
    env = CoordinationEnv(lee1991, physics="ideal", render_mode="rgb_array")
    env.reset()
    picture = env.render()
    assert picture is not None
    master, slave = (float(np.mean(np.nonzero(_pixels_of(picture, arm))[1])) for arm in range(2))
    assert master < PICTURE_WIDTH / 2 < slave
    env.close()


def test_pictures_do_not_change_the_episode(lee1991: CoordinationCell) -> None:
    ends = []
    for mode in (None, "rgb_array"):
        env = YieldingEnv(lee1991, render_mode=mode)
        env.reset(seed=0)
        for _ in range(10):
            observation, *_ = env.step(np.ones(1, dtype=np.float32))
            frame = env.render()
            assert (frame is None) == (mode is None)
        ends.append((observation, env.simulation.joint_positions()))
        env.close()
    np.testing.assert_array_equal(ends[0][0], ends[1][0])
    np.testing.assert_array_equal(ends[0][1], ends[1][1])


@pytest.mark.parametrize("make", [CoordinationEnv, YieldingEnv])
def test_a_window_without_a_display_is_an_error_at_reset(
    lee1991: CoordinationCell, make: type[CoordinationEnv | YieldingEnv], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    env = make(lee1991, physics="ideal", render_mode="human")
    with pytest.raises(RenderError, match=r"needs a display.*xvfb-run.*rgb_array"):
        env.reset()
    env.close()


def test_declared_render_modes_follow_the_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    assert _renderer.render_modes() == ["rgb_array"]
    monkeypatch.setenv("DISPLAY", ":0")
    assert _renderer.render_modes() == ["rgb_array", "human"]


def test_a_kept_renderer_shows_another_target_as_a_new_one_would(chung: IKCell, renderer_kind: str) -> None:
    other = chung.variant(harmonic([0.5, 0.1, 0.8], [0.1, 0.0, 0.2], 1.0, np.eye(3)), 1.0, chung.start)
    pictures = []
    for cells in ((chung, other), (other,)):
        renderer = Renderer(cells[0], "rgb_array")
        for cell in cells:
            renderer.show(cell)
            pictures.append(renderer.render(chung.start[None]))
        renderer.close()
    given, kept, fresh = pictures
    assert kept is not None
    np.testing.assert_array_equal(kept, fresh)
    assert (kept != given).any()


def test_the_links_of_the_puma_join(chung: IKCell) -> None:
    renderer = Renderer(chung, "rgb_array")
    for row in (0, 3000, 6283):
        picture = renderer.render(chung.nominal.q[row, None])
        assert picture is not None
        parts, count = label(_pixels_of(picture, 0))
        sizes = np.bincount(parts.ravel())[1:]
        assert count >= 1
        assert (sizes > 40).sum() == 1  # the beads are smaller
    renderer.close()
