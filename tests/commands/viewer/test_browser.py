"""Pages in a browser: no complaint, no request, and what they show is what they were given."""

from __future__ import annotations

import html
import re
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armtempo.agents import Evaluation, evaluate
from armtempo.commands.viewer import LivePage, page_data, serve, view_page, write_view
from armtempo.commands.viewer._packing import unpacked
from armtempo.planners import IKCell
from tests.commands.viewer.conftest import Seen, address_of


@pytest.mark.parametrize("at", [0.0, 0.1, 0.17])
def test_the_page_shows_the_instant_of_its_address(
    lee1991_runs: Evaluation[Any, Any, Any], tmp_path: Path, browse: Callable[[str], Seen], at: float
) -> None:
    file = tmp_path / "page.html"
    write_view(lee1991_runs, file)
    seen = browse(address_of(file, f"t={at}&policy=vci,delay&theme=dark"))
    assert seen.console == []
    assert 'data-ready="yes"' in seen.dom
    assert 'data-theme="dark"' in seen.dom
    assert 'id="fault"' not in seen.dom
    assert seen.text("#clock") == f"{at:.3f} s"
    vci = page_data(lee1991_runs)["runs"][1]
    columns = {name: unpacked(one) for name, one in vci["columns"].items()}
    row = int(np.abs(columns["time"][:, 0] - at).argmin())
    shown = html.unescape(seen.dom)
    lam, mu, clearance = columns["lam"][row], columns["mu"][row], columns["clearance"][row, 0]
    assert f"{1e3 * clearance:.2f} mm" in shown
    assert f"{1e3 * clearance:.1f} mm" in shown  # beside the line between the arms
    assert f"{lam[0]:.3f}, {lam[1]:.3f}" in shown
    assert f"{lam[1]:.3f}, {mu[1]:.3f}" in shown
    assert shown.count('class="view') == 2


def test_pages_of_one_arm_open_without_complaint(
    lee2006_runs: Evaluation[Any, Any, Any], chung: IKCell, tmp_path: Path, browse: Callable[[str], Seen]
) -> None:
    for runs in (lee2006_runs, evaluate(chung, ["feedback-ff"], physics="ideal")):
        file = tmp_path / f"{runs.kind}.html"
        write_view(runs, file)
        seen = browse(address_of(file, "t=0.5"))
        assert seen.console == []
        assert 'data-ready="yes"' in seen.dom
        assert seen.text("#clock") == "0.500 s"
        assert seen.dom.count("<article") == len(page_data(runs)["panels"])


KEYS = """<script>
const press = (key, code, shiftKey) =>
  dispatchEvent(new KeyboardEvent("keydown", { key, code: code || key, shiftKey }));
press("2", "Digit2");
press("#", "Digit3", true);
press("ArrowRight");
press("ArrowRight");
press("ArrowRight", "", true);
press("ArrowLeft");
press("d");
press(".");
</script>"""


def test_keys_choose_policies_and_step(
    lee1991_runs: Evaluation[Any, Any, Any], tmp_path: Path, browse: Callable[[str], Seen]
) -> None:
    file = tmp_path / "page.html"
    file.write_text(view_page(lee1991_runs).replace("</body>", f"{KEYS}</body>"), encoding="utf-8")
    seen = browse(address_of(file, "theme=light&slow=20"))
    assert seen.console == []
    assert re.findall(r'data-policy="([\w-]+)"[^>]* aria-pressed="true"', seen.dom) == ["vci", "phase-plane"]
    assert 'class="view focus"' in seen.dom
    assert seen.text("#clock") == "0.011 s"  # 1 + 1 + 10 - 1 ticks of 1 ms
    assert 'data-theme="dark"' in seen.dom


def test_what_plays_stops_at_its_end(
    lee1991_runs: Evaluation[Any, Any, Any], tmp_path: Path, browse: Callable[[str], Seen]
) -> None:
    file, press = tmp_path / "page.html", "<script>document.getElementById('play').click();</script>"
    # Frames are few in virtual time, timers are not.
    frames = "<script>window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 16);</script>"
    page = view_page(lee1991_runs).replace("<header>", f"{frames}<header>").replace("</body>", f"{press}</body>")
    file.write_text(page, encoding="utf-8")
    seen = browse(address_of(file, "slow=1&policy=delay"))
    end = lee1991_runs.results["delay"].trace.time[-1]
    assert seen.console == []
    assert seen.text("#clock") == seen.text("#end") == f"{end:.3f} s"
    assert seen.text("#play") == "▶"
    assert "arrived" in seen.dom


def test_a_waiting_policy_runs_when_it_is_clicked(
    lee1991_runs: Evaluation[Any, Any, Any], browse: Callable[[str], Seen], monkeypatch: pytest.MonkeyPatch
) -> None:
    click, page = "<script>document.querySelector('.waiting')?.click();</script>", LivePage.page
    monkeypatch.setattr(LivePage, "page", lambda live: page(live).replace("</body>", f"{click}</body>"))
    first = replace(lee1991_runs, results={"delay": lee1991_runs.results["delay"]})
    with serve(LivePage(first, ["delay", "vci"], lambda before, policy: lee1991_runs)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        seen = browse(f"http://127.0.0.1:{server.server_address[1]}/")
        server.shutdown()
        thread.join()
    assert seen.console == []
    assert 'data-ready="yes"' in seen.dom
    assert re.findall(r'data-policy="([\w-]+)"[^>]* aria-pressed="true"', seen.dom) == ["vci"]
    assert "waiting" not in re.findall(r'class="(policy[^"]*)"', seen.dom)
