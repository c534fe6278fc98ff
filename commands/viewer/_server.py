"""A live page: the same page on this machine alone, with policies that run when they are asked for."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING, Any, final

from armtempo.commands.viewer._page import page_data, page_of
from armtempo.errors import ArmtempoError, InfeasibleError, InputError

if TYPE_CHECKING:
    from armtempo.agents import Evaluation

__all__ = ["LivePage", "serve"]

HOST = "127.0.0.1"
LONGEST_NAME = 1000  # of a policy, in bytes
Run = Callable[["Evaluation[Any, Any, Any]", str], "Evaluation[Any, Any, Any]"]
"""Runs one more policy; returns all that have run."""


@final
class LivePage:
    """Policies that have run, and those that may.

    Args:
        evaluation: Who has run so far.
        policies: All that may be asked for.
        run: Runs one of them.
    """

    def __init__(self, evaluation: Evaluation[Any, Any, Any], policies: Sequence[str], run: Run) -> None:
        self._evaluation, self._policies, self._run = evaluation, policies, run
        self._lock = threading.Lock()  # one simulation at a time; browsers ask for several things at once

    def page(self) -> str:
        """The page with all that has run."""
        with self._lock:
            waiting = [name for name in self._policies if name not in self._evaluation.results]
            return page_of(page_data(self._evaluation, waiting), live=True)

    def add(self, policy: str) -> None:
        """Run a policy, if it has not run yet.

        Raises:
            InputError: It is none of those on offer.
            ArmtempoError: It cannot run; where it has no plan that is kept in mind.
        """
        with self._lock:
            if policy not in self._policies:
                raise InputError("no such policy is on offer")
            if policy in self._evaluation.results:
                return
            try:
                self._evaluation = self._run(self._evaluation, policy)
            except InfeasibleError as error:
                refused = {**(self._evaluation.refused or {}), policy: str(error)}
                self._evaluation = replace(self._evaluation, refused=refused)
                raise


def serve(live: LivePage, port: int = 0) -> ThreadingHTTPServer:
    """A server of the page at 127.0.0.1; ``serve_forever`` runs it, ``server_address`` tells its port.

    It answers pages of its own address only, so that no other site in the browser can make it work.

    Args:
        live: The page.
        port: Where; 0: any that is free.

    Raises:
        InputError: The port is taken.
    """

    class Handler(_Handler):
        page = live

    try:
        server = ThreadingHTTPServer((HOST, port), Handler)
    except OSError as error:
        raise InputError(
            f"cannot listen at port {port}: {error.strerror}", remedy="give another --port, or none"
        ) from error
    server.daemon_threads = True
    return server


class _Handler(BaseHTTPRequestHandler):
    page: LivePage
    timeout = 60.0  # of connections that say nothing
    server: ThreadingHTTPServer

    def do_GET(self) -> None:
        """The page, and nothing else."""
        if not self._from_here():
            self._answer(HTTPStatus.FORBIDDEN, "this page is for this machine")
        elif self.path.partition("?")[0] != "/":
            self._answer(HTTPStatus.NOT_FOUND, "there is one page here: /")
        else:
            self._answer(HTTPStatus.OK, self.page.page(), "text/html")

    def do_POST(self) -> None:
        """Run the policy that the body names."""
        length = self.headers.get("Content-Length", "")
        if not self._from_here() or self.headers.get("Origin") not in {f"http://{own}" for own in self._own()}:
            self._answer(HTTPStatus.FORBIDDEN, "this page is for this machine")
        elif self.path != "/run" or not length.isdecimal() or int(length) > LONGEST_NAME:
            self._answer(HTTPStatus.BAD_REQUEST, "POST /run takes the name of a policy")
        else:
            try:
                self.page.add(self.rfile.read(int(length)).decode("utf-8", "replace"))
            except ArmtempoError as error:
                self._answer(HTTPStatus.CONFLICT, str(error))
            else:
                self._answer(HTTPStatus.OK, "done")

    def _own(self) -> set[str]:
        """What browsers call this server."""
        return {f"{name}:{self.server.server_address[1]}" for name in (HOST, "localhost")}

    def _from_here(self) -> bool:
        """Whether the page was asked for by its own name: other names may be those of another site."""
        return self.headers.get("Host") in self._own()

    def _answer(self, status: HTTPStatus, text: str, kind: str = "text/plain") -> None:
        body = text.encode("utf-8")
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 (the base class calls it so)
        """Nothing: the terminal is the command's."""
