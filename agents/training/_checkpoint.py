"""Checkpoints: all that a training goes on from, exactly, in one file that is written whole or not at all.

They are torch files that are read with ``weights_only=True``: tensors, numbers, texts, nothing that could run. Behind
the file stands a digest of it, as torch itself does not notice bits that have changed.
"""

from __future__ import annotations

import io
import json
import re
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.save_util import recursive_getattr, recursive_setattr

from armtempo.agents.training._logs import log_sizes, pending, put_back
from armtempo.errors import InputError
from armtempo.files import is_sealed, whole_file, write_sealed

CHECKPOINT_FORMAT = "armtempo checkpoint"
CHECKPOINT_VERSION = 2
NUMBERS = re.compile(r"[<>|=][biuf][1248]")
"""Types of arrays, as numpy writes them."""
_REPLAY = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def save_checkpoint(path: Path, model: Any, config: str, curve: list[dict[str, Any]], *, cut: bool = True) -> None:
    """Write where a training stands, between two rollouts.

    The environments go on from their state where they have one (``get_state``); where not, their episodes begin anew,
    from a seed, when the training is resumed, and with ``cut`` also where it just goes on: both are then the same.

    Args:
        path: The file; logs for TensorBoard are beside it.
        model: The algorithm.
        config: What it was made from, JSON; a training is resumed from the same alone, but for ``total_steps``.
        curve: Rows of the learning curve so far.
        cut: Whether this is a place where every training of this configuration cuts its episodes off.
    """
    env = model.env
    state = env.get_state() if hasattr(env, "get_state") else None
    if state is None and cut:
        _begin_anew(model)
    _, names = model._get_torch_save_params()
    content = {
        "format": CHECKPOINT_FORMAT,
        "version": CHECKPOINT_VERSION,
        "config": config,
        "curve": json.dumps(curve),
        "parameters": model.get_parameters(),
        "variables": {name: recursive_getattr(model, name).detach().clone() for name in names},
        "counters": {
            "num_timesteps": int(model.num_timesteps),
            "n_updates": int(model._n_updates),
            "episode_num": int(model._episode_num),
            "progress": float(model._current_progress_remaining),
        },
        "episodes": json.dumps([list(model.ep_info_buffer or ()), [bool(s) for s in model.ep_success_buffer or ()]]),
        "last_obs": _pack(model._last_obs),
        "episode_starts": _pack(model._last_episode_starts),
        "env": None if state is None else {name: _pack(array) for name, array in state.items()},
        "replay": _replay(model),
        "torch_random": torch.get_rng_state(),
        "random": json.dumps(_random_states(model)),
        "logs": log_sizes(path.parent),
        "recorded": pending(model.logger),
    }
    packed = io.BytesIO()  # what torch says of a full disk is no OSError
    torch.save(content, packed)
    with whole_file(path) as temporary:
        write_sealed(temporary, packed.getbuffer())


def read_checkpoint(path: Path) -> dict[str, Any]:
    """The contents of a checkpoint.

    Raises:
        InputError: There is none, a bit of it is not as it was written, or it is of another version.
    """
    if not path.is_file():
        raise InputError(f"{path}: no checkpoint", remedy="train without --resume first, or give the right --output")
    try:
        with path.open("rb") as stream:
            sealed = is_sealed(stream)
            content = torch.load(stream, map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises anything for files that are not its own
        raise _damaged(path, f"not a checkpoint, or a damaged one: {' '.join(str(error).split())[:80]}") from error
    if not isinstance(content, dict) or content.get("format") != CHECKPOINT_FORMAT:
        raise _damaged(path, "not a checkpoint of armtempo")
    if content.get("version") != CHECKPOINT_VERSION:
        raise InputError(
            f"{path}: a checkpoint of version {content.get('version')}, and this armtempo reads version "
            f"{CHECKPOINT_VERSION}",
            remedy="resume with the armtempo that wrote it, or train again from the start",
        )
    if not sealed:
        raise _damaged(path, "a damaged checkpoint: its digest is not that of its content")
    return content


def _damaged(path: Path, what: str) -> InputError:
    return InputError(f"{path}: {what}", remedy="copy it again, or delete it and train again from the start")


def checkpoint_for(path: Path, config: str) -> dict[str, Any]:
    """The contents of a checkpoint that a training of this configuration can go on from.

    Raises:
        InputError: As ``read_checkpoint``; it is of another configuration, or has gone further already.
    """
    content = read_checkpoint(path)
    _check_config(path, content, config)
    return content


def _check_config(path: Path, content: dict[str, Any], config: str) -> None:
    said = content.get("config")
    if said == config:
        return
    other = InputError(
        f"{path}: made from another configuration or seed",
        remedy="resume with the file and seed it was made from, or give another --output",
    )
    try:
        theirs, ours = json.loads(str(said)), json.loads(config)
        theirs.pop("total_steps")
        asked, done = ours.pop("total_steps"), int(content["counters"]["num_timesteps"])
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise other from error
    if theirs != ours:
        raise other
    if asked < done:
        raise InputError(
            f"{path}: was trained for {done} steps already, and {asked} in all are asked for",
            remedy=f"give more than {done} --steps, or another --output",
        )


def restore(path: Path, content: dict[str, Any], model: Any, config: str) -> list[dict[str, Any]]:
    """Put a new model of the same configuration where the checkpoint stood; returns the curve so far.

    Raises:
        InputError: It is of another configuration, or its contents do not fit.
    """
    _check_config(path, content, config)
    try:
        return _restore(content, model)
    except (LookupError, TypeError, ValueError, RuntimeError, AttributeError, ArithmeticError, AssertionError) as error:
        raise _damaged(path, f"a checkpoint that does not fit: {' '.join(str(error).split())[:80]}") from error


def _restore(content: dict[str, Any], model: Any) -> list[dict[str, Any]]:
    _check_finite([content["parameters"], content["variables"]])
    model.set_parameters(content["parameters"], exact_match=True, device="cpu")
    for name, value in content["variables"].items():
        recursive_setattr(model, f"{name}.data", value)
    counters = content["counters"]
    model.num_timesteps, model._n_updates = counters["num_timesteps"], counters["n_updates"]
    model._episode_num, model._current_progress_remaining = counters["episode_num"], counters["progress"]
    episodes, successes = json.loads(content["episodes"])
    window = model._stats_window_size
    model.ep_info_buffer, model.ep_success_buffer = deque(episodes, maxlen=window), deque(successes, maxlen=window)
    if content["env"] is None:
        _begin_anew(model)
    else:
        model.env.reset()
        model.env.set_state({name: _unpack(packed) for name, packed in content["env"].items()})
    model._last_obs = _unpack(content["last_obs"])
    if not np.isfinite(model._last_obs).all():
        raise ValueError("an observation is not finite")
    model._last_episode_starts = _unpack(content["episode_starts"])
    if content["replay"] is not None:
        _restore_replay(model.replay_buffer, content["replay"])
    put_back(model.logger, content["recorded"])
    curve: list[dict[str, Any]] = json.loads(content["curve"])
    torch.set_rng_state(content["torch_random"])
    general, of_actions = json.loads(content["random"])
    general["state"]["key"] = np.array(general["state"]["key"], dtype=np.uint32)
    np.random.set_state(general)  # noqa: NPY002 - stable-baselines3 draws from it
    model.action_space.np_random.bit_generator.state = of_actions
    return curve


def _check_finite(tree: Any) -> None:
    """Raise ValueError where a tensor in mappings and lists holds a number that is not finite."""
    if isinstance(tree, torch.Tensor):
        if not bool(torch.isfinite(tree).all()):
            raise ValueError("a weight is not finite")
    else:
        for one in tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list | tuple) else ():
            _check_finite(one)


def _begin_anew(model: Any) -> None:
    """Cut all episodes off; the new ones' seed comes from the training's and from how far it is."""
    seed = np.random.SeedSequence([model.seed or 0, model.num_timesteps]).generate_state(1)[0]
    model.env.seed(int(seed) % 2**31)
    model._last_obs = model.env.reset()
    model._last_episode_starts = np.ones(model.env.num_envs, dtype=np.bool_)


def _random_states(model: Any) -> list[Any]:
    general: Any = np.random.get_state(legacy=False)  # noqa: NPY002 - stable-baselines3 draws from it
    general["state"]["key"] = general["state"]["key"].tolist()
    return [general, model.action_space.np_random.bit_generator.state]


def _replay(model: Any) -> dict[str, Any] | None:
    """What the replay buffer holds, of one that has not been filled only the part that is."""
    buffer = getattr(model, "replay_buffer", None)
    if not isinstance(buffer, ReplayBuffer):
        return None
    filled = buffer.buffer_size if buffer.full else buffer.pos
    arrays = {name: _pack(getattr(buffer, name)[:filled]) for name in _REPLAY}
    return {"position": int(buffer.pos), "full": bool(buffer.full), **arrays}


def _restore_replay(buffer: Any, saved: dict[str, Any]) -> None:
    buffer.pos, buffer.full = saved["position"], saved["full"]
    for name in _REPLAY:
        rows = _unpack(saved[name])
        getattr(buffer, name)[: len(rows)] = rows


def _pack(array: Any) -> dict[str, Any]:
    """An array of any type as torch keeps it: unsigned numbers are not its strength."""
    x = np.ascontiguousarray(array)
    return {"type": x.dtype.str, "shape": list(x.shape), "bytes": torch.from_numpy(x.reshape(-1).view(np.uint8).copy())}


def _unpack(packed: dict[str, Any]) -> NDArray[Any]:
    if NUMBERS.fullmatch(packed["type"]) is None:  # numpy reads more than types of numbers there, objects too
        raise ValueError("an array is of something else than numbers")
    array: NDArray[Any] = packed["bytes"].numpy().view(np.dtype(packed["type"])).reshape(packed["shape"])
    return array.copy()
