"""An evaluation as one page that needs nothing else: arms in space, charts, one clock."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.text import Text

from armtempo import __version__
from armtempo.commands.reports import REPORTS, labelled, title_of
from armtempo.commands.viewer._blend import BLEND_VIEW
from armtempo.commands.viewer._coordination import COORDINATION_VIEW
from armtempo.commands.viewer._ik import IK_VIEW
from armtempo.commands.viewer._kind_view import KindView, torque_panels
from armtempo.commands.viewer._packing import packed
from armtempo.commands.viewer._panels import panel_json
from armtempo.commands.viewer._runs import columns_of, most_rows, run_json
from armtempo.commands.viewer._scene import color_of_policy, scene_json, way_of
from armtempo.envs.bodies import Trace
from armtempo.errors import InputError
from armtempo.files import check_output, whole_file

if TYPE_CHECKING:
    from armtempo.agents import Evaluation, Kind

__all__ = ["VIEWS", "page_data", "page_of", "usual_policy", "view_page", "write_view"]

VIEWS: dict[str, KindView[Any, Any, Any]] = {"coordination": COORDINATION_VIEW, "blend": BLEND_VIEW, "ik": IK_VIEW}
"""By the ``kind`` of a cell's file; other kinds show their arms and torques."""
PLAIN: KindView[Any, Any, Any] = KindView()


def usual_policy(kind: Kind[Any, Any, Any, Any]) -> str:
    """Who is shown where nobody is named."""
    return VIEWS.get(kind.name, PLAIN).usual or kind.policies[0]


def page_data(evaluation: Evaluation[Any, Any, Any], waiting: Sequence[str] = ()) -> dict[str, Any]:
    """What the page shows, as JSON can hold it.

    Args:
        evaluation: What ran.
        waiting: Policies that a live page offers to run; those that were refused are told with the reason.

    Raises:
        InputError: No policy has a trace.
    """
    evaluation = labelled(evaluation)
    cell, view = evaluation.cell, VIEWS.get(evaluation.kind, PLAIN)
    results = {name: one for name, one in evaluation.results.items() if isinstance(getattr(one, "trace", None), Trace)}
    if not results:
        raise InputError(
            "there is nothing to be seen: no policy ran, or none with a Trace", remedy="name a policy that has a plan"
        )
    cells = {name: getattr(result.trace, "cell", cell) for name, result in results.items()}
    most = most_rows([columns_of(view, cells[name], result.trace) for name, result in results.items()])
    runs = [run_json(view, cell, name, k, result, most) for k, (name, result) in enumerate(results.items())]
    ways: dict[bytes, int] = {}
    paths: list[dict[str, Any]] = []
    for run in runs:
        run["paths"] = []
        for way in way_of(cells[run["policy"]]):
            if way.tobytes() not in ways:
                ways[way.tobytes()] = len(paths)
                paths.append(packed(way))
            run["paths"].append(ways[way.tobytes()])
    traces = [result.trace for result in results.values()]
    report = REPORTS[evaluation.kind]
    best = [name for name in report.best(evaluation) if name in results]
    sound = [run["policy"] for run in runs if not run["mishap"]]
    return {
        "armtempo": __version__,
        "title": cell.name,
        "subtitle": title_of(evaluation, report.title_suffix(evaluation)).removeprefix(f"{cell.name} "),
        "caption": Text.from_markup(report.caption(evaluation)).plain,
        "summary": Text.from_markup(report.summary_sentence(evaluation)).plain,
        "first": [*best, *sound, *results][0],
        "scene": scene_json(cell),
        "paths": paths,
        "panels": [panel_json(panel) for panel in (*view.panels(cell, traces), *torque_panels(cell.arms))],
        "runs": runs,
        "waiting": [_waiting(name, k, evaluation.refused or {}) for k, name in enumerate(waiting)],
    }


def _waiting(policy: str, number: int, refused: Mapping[str, str]) -> dict[str, Any]:
    """A policy that has not run."""
    mishap = "no plan" if policy in refused else ""
    return {
        "policy": policy,
        "color": color_of_policy(policy, number),
        "mishap": mishap,
        "why": refused.get(policy, ""),
    }


def view_page(evaluation: Evaluation[Any, Any, Any]) -> str:
    """An evaluation as a page (HTML) that needs nothing else, no network either.

    It shows the first episode of every policy: arms, paths, obstacles and nearest points in space, coordination charts,
    phase planes, torques and clearance, or what else counts in its kind of cell, under one clock.

    Args:
        evaluation: What ``armtempo.agents.evaluate`` returns.

    Raises:
        InputError: No policy has a trace.
    """
    return page_of(page_data(evaluation))


def page_of(data: Mapping[str, Any], *, live: bool = False) -> str:
    """The page that shows ``data``; a ``live`` one may ask its server for more, others can reach nothing at all."""
    folder = files("armtempo.commands.viewer") / "page"
    parts = {
        name: (folder / name).read_text(encoding="utf-8") for name in ("page.html", "page.css", "three.js", "page.js")
    }
    text = json.dumps(data, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    parts["data"] = text.replace("<", "\\u003c")  # no word of it can end the script that it is in
    parts["connect"] = "; connect-src 'self'" if live else ""
    return re.sub(r"/\*\{([\w.]+)\}\*/", lambda found: parts[found[1]], parts["page.html"])


def write_view(evaluation: Evaluation[Any, Any, Any], file: str | Path) -> None:
    """Write ``view_page`` to a file, whole or not at all.

    Args:
        evaluation: What ``armtempo.agents.evaluate`` returns.
        file: Usually named ``.html``.

    Raises:
        InputError: The file cannot be written, or no policy has a trace.
    """
    check_output(file)
    page = view_page(evaluation)
    with whole_file(Path(file)) as temporary:
        temporary.write_text(page, encoding="utf-8")
