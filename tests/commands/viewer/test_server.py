"""The live page: policies run when they are asked for, by this machine's browser alone."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import replace
from http.client import HTTPConnection
from typing import Any

import pytest

from armtempo.agents import Evaluation
from armtempo.commands.viewer import LivePage, serve
from armtempo.errors import InfeasibleError, InputError
from tests.commands.viewer.test_page import data_of


class Asked(list[str]):
    """Runs policies out of an evaluation, and remembers which."""

    def __init__(self, runs: Evaluation[Any, Any, Any]) -> None:
        self.runs = runs

    def __call__(self, before: Evaluation[Any, Any, Any], policy: str) -> Evaluation[Any, Any, Any]:
        self.append(policy)
        if policy == "vci":
            raise InfeasibleError("vci finds nothing here")
        return replace(before, results={**before.results, policy: self.runs.results[policy]})


@pytest.fixture
def asked(lee1991_runs: Evaluation[Any, Any, Any]) -> Asked:
    return Asked(lee1991_runs)


@pytest.fixture
def port(asked: Asked) -> Iterator[int]:
    """Of a server whose page shows ``delay``; ``vci`` has no plan."""
    first = replace(asked.runs, results={"delay": asked.runs.results["delay"]})
    with serve(LivePage(first, ["delay", "vci", "phase-plane"], asked)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield int(server.server_address[1])
        server.shutdown()
        thread.join()


def ask(port: int, method: str, path: str, body: str | None = None, **headers: str) -> tuple[int, str]:
    """The answer to a request of the page itself, unless headers say otherwise."""
    own = {"Host": f"127.0.0.1:{port}", "Origin": f"http://127.0.0.1:{port}"}
    connection = HTTPConnection("127.0.0.1", port, timeout=60)
    connection.request(method, path, body, own | headers)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, text


def test_a_policy_runs_once_it_is_asked_for(port: int, asked: Asked) -> None:
    status, page = ask(port, "GET", "/")
    data = data_of(page)
    assert status == 200
    assert "connect-src 'self'" in page
    assert [run["policy"] for run in data["runs"]] == ["delay"]
    assert [one["policy"] for one in data["waiting"]] == ["vci", "phase-plane"]
    assert ask(port, "POST", "/run", "phase-plane") == (200, "done")
    assert ask(port, "POST", "/run", "phase-plane") == (200, "done")
    assert asked == ["phase-plane"]
    data = data_of(ask(port, "GET", "/")[1])
    assert [run["policy"] for run in data["runs"]] == ["delay", "phase-plane"]


def test_a_policy_without_a_plan_says_why(port: int) -> None:
    status, text = ask(port, "POST", "/run", "vci")
    assert status == 409
    assert "finds nothing here" in text
    (vci, _) = data_of(ask(port, "GET", "/")[1])["waiting"]
    assert vci["mishap"] == "no plan"
    assert "finds nothing here" in vci["why"]


def test_other_sites_and_odd_requests_get_nothing(port: int, asked: Asked) -> None:
    assert ask(port, "GET", "/", Host="evil.example")[0] == 403
    assert ask(port, "POST", "/run", "phase-plane", Origin="http://evil.example")[0] == 403
    assert ask(port, "GET", "/etc/passwd")[0] == 404
    assert ask(port, "POST", "/elsewhere", "vci")[0] == 400
    assert ask(port, "POST", "/run", "x" * 5000)[0] == 400
    assert ask(port, "POST", "/run", "ppo:/etc/passwd") == (409, "no such policy is on offer")
    assert asked == []


def test_a_port_that_is_taken_is_told(port: int, asked: Asked) -> None:
    with pytest.raises(InputError, match=f"cannot listen at port {port}.*--port"):
        serve(LivePage(asked.runs, ["delay"], asked), port)
