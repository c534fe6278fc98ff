"""A fuzzer of checkpoints: those that are accepted are restored into a model, which acts."""

from __future__ import annotations

import copy
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import torch

from armtempo.agents.training._checkpoint import read_checkpoint, restore, save_checkpoint
from armtempo.agents.training._model import training_model
from armtempo.agents.training._tasks import training_env, training_task
from armtempo.configs import load_train_config
from tests.fuzz._files import sealed_again
from tests.fuzz._finite import NotFiniteError
from tests.fuzz._mutations import VALUES, WORDS, Random, damaged_bytes, damaged_tree, pick

SMALL = """
name: small
algorithm: {algorithm}
coordination: {{cells: [lee1991]}}
num_envs: 2
total_steps: 64
network: {{sizes: [8]}}
evaluation: {{episodes: 0}}
{rest}
"""
REST = {
    "ppo": "ppo: {rollout_steps: 16, batch_size: 16, epochs: 1}",
    "sac": "sac: {learning_starts: 8, batch_size: 8, buffer_size: 64}",
}


class CheckpointFuzzer:
    """Damaged bytes of checkpoints, and damaged contents."""

    spent = False

    def __init__(self, folder: Path) -> None:
        torch.set_num_threads(1)
        self._file = folder / "checkpoint.pt"
        self._models, self._seeds = {}, {}
        for algorithm, rest in REST.items():
            (folder / "t.yaml").write_text(SMALL.format(algorithm=algorithm, rest=rest), encoding="utf-8")
            config = load_train_config(folder / "t.yaml")
            model: Any = training_model(config, training_env(training_task(config)))
            model.learn(32)
            save_checkpoint(self._file, model, "said", [{"steps": 1}])
            self._models[algorithm], self._seeds[algorithm] = model, self._file.read_bytes()
            assert self.run((algorithm, self._seeds[algorithm]))

    def make(self, random: Random) -> tuple[str, bytes]:
        algorithm = pick(random, list(self._seeds))
        data = self._seeds[algorithm]
        damage = damaged_bytes if random.random() < 0.5 else self._damaged_content
        return algorithm, sealed_again(random, self._file.parent, damage(random, data))

    def _damaged_content(self, random: Random, data: bytes) -> bytes:
        content = torch.load(io.BytesIO(data), weights_only=True)
        if random.random() < 0.5:
            content = _spoilt_tensor(random, content)
        elif random.random() < 0.5:
            key = pick(random, [name for name, value in content.items() if isinstance(value, str) and name != "format"])
            try:
                content[key] = json.dumps(damaged_tree(random, json.loads(content[key])))
            except ValueError:
                content[key] = pick(random, WORDS)
        else:
            content = damaged_tree(
                random, dict(content), (*VALUES, *WORDS, torch.zeros(2), torch.full((3,), torch.nan))
            )
        out = io.BytesIO()
        torch.save(content, out)
        return out.getvalue()

    def run(self, given: tuple[str, bytes]) -> bool:
        algorithm, data = given
        self._file.write_bytes(data)
        model = self._models[algorithm]
        restore(self._file, read_checkpoint(self._file), model, "said")
        for name, value in model.policy.state_dict().items():
            if not bool(torch.isfinite(value).all()):
                raise NotFiniteError(f"accepted, and {name} is not finite")
        if not np.isfinite(model._last_obs).all():
            raise NotFiniteError("accepted, and last_obs is not finite")
        action, _ = model.predict(model._last_obs)
        model.env.step(action)
        return True

    def shown(self, given: tuple[str, bytes]) -> bytes:
        return given[1]


def _tensors(tree: Any, found: list[tuple[Any, Any]]) -> list[tuple[Any, Any]]:
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ():
        if isinstance(value, torch.Tensor):
            found.append((tree, key))
        else:
            _tensors(value, found)
    return found


def _spoilt_tensor(random: Random, content: Any) -> Any:
    content = copy.deepcopy(content)
    where, key = pick(random, _tensors(content, []))
    tensor = where[key].clone()
    match int(random.integers(4)):
        case 0 if tensor.numel() and tensor.is_floating_point():
            tensor.view(-1)[int(random.integers(tensor.numel()))] = pick(random, (np.nan, np.inf, 3e38))
        case 1:
            tensor = tensor[:0] if tensor.ndim else tensor[None]
        case 2:
            tensor = tensor.to(pick(random, (torch.float64, torch.int64, torch.uint8)))
        case _:
            raw = tensor.contiguous().view(-1)
            tensor = (
                raw if random.random() < 0.3 else torch.randint(0, 255, raw.shape).to(tensor.dtype).view(tensor.shape)
            )
    where[key] = tensor
    return content


def checkpoint_files(folder: Path) -> CheckpointFuzzer:
    """Checkpoints of ppo and sac."""
    return CheckpointFuzzer(folder)
