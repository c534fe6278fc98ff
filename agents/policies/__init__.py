"""The policy protocol, agent files and learned policies."""

from __future__ import annotations

from armtempo.agents.policies._agent_file import (
    Agent,
    AgentHeader,
    find_agent,
    is_agent_name,
    load_agent,
    save_agent,
)
from armtempo.agents.policies._graph_network import FLAT_SIZE, GRAPH_NAMES, NODE_NUMBERS, flat_rows, graph_shapes
from armtempo.agents.policies._learned import LearnedPolicy, learned_policy, options_of_agent
from armtempo.agents.policies._policy import (
    Actions,
    Observations,
    Policy,
    RandomPolicy,
    action_size,
    chosen_policies,
    to_action,
)

__all__ = [
    "FLAT_SIZE",
    "GRAPH_NAMES",
    "NODE_NUMBERS",
    "Actions",
    "Agent",
    "AgentHeader",
    "LearnedPolicy",
    "Observations",
    "Policy",
    "RandomPolicy",
    "chosen_policies",
    "find_agent",
    "flat_rows",
    "graph_shapes",
    "is_agent_name",
    "learned_policy",
    "load_agent",
    "options_of_agent",
    "save_agent",
    "action_size",
    "to_action",
]
