"""Arms and pairs of arms as a graph: an observation that shows who passes first, and what that costs."""

from __future__ import annotations

from armtempo.envs.coordination.graph._entries import EDGE_ENTRIES, EDGE_PLACES, GRAPH_ARMS, NODE_ENTRIES, NODE_PLACES
from armtempo.envs.coordination.graph._spaces import graph_space
from armtempo.envs.coordination.graph._view import Graph, Graphs, GraphView, seen_by_all

__all__ = [
    "EDGE_ENTRIES",
    "EDGE_PLACES",
    "GRAPH_ARMS",
    "Graph",
    "GraphView",
    "Graphs",
    "NODE_ENTRIES",
    "NODE_PLACES",
    "graph_space",
    "seen_by_all",
]
