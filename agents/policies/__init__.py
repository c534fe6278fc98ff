"""The policy protocol, agent files and learned policies."""

from __future__ import annotations

from armtempo.agents.policies._agent_file import (
    Agent,
    AgentHeader,
    find_agent,
    is_agent_name,
    load_agent,
    save_agent,
    shipped_agents,
)
from armtempo.agents.policies._learned import LearnedOneArmPolicy, LearnedPolicy, check_fits, learned_policy
from armtempo.agents.policies._policy import (
    Actions,
    Observations,
    Policy,
    RandomActions,
    SingleArmPolicy,
    chosen_policies,
    run_to_end,
    to_action,
)

__all__ = [
    "Actions",
    "Agent",
    "AgentHeader",
    "LearnedOneArmPolicy",
    "LearnedPolicy",
    "Observations",
    "Policy",
    "RandomActions",
    "SingleArmPolicy",
    "check_fits",
    "chosen_policies",
    "find_agent",
    "is_agent_name",
    "learned_policy",
    "load_agent",
    "run_to_end",
    "save_agent",
    "shipped_agents",
    "to_action",
]
