"""What policies are called where there is little room."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

__all__ = ["policy_label", "policy_labels"]


def policy_label(policy: str) -> str:
    """A policy's name, fit for a file's; of a learned agent its algorithm and what its training is called."""
    algorithm, _, agent = policy.rpartition(":")
    if not algorithm:
        return policy
    file = Path(agent)
    name = file.parent.name if file.stem == "agent" else file.stem  # as armtempo train calls them all
    return f"{algorithm}-{name or file.stem}"


def policy_labels(policies: Iterable[str]) -> dict[str, str]:
    """A label for each; those that would be called alike keep their names."""
    labels = {policy: policy_label(policy) for policy in policies}
    count = Counter(labels.values())
    return {policy: label if count[label] == 1 else policy for policy, label in labels.items()}
