"""The application: addresses, and what each answers."""

from __future__ import annotations

import json
import re
import tempfile
import threading
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import quote

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route

from twinloop._experiment.envelope import is_bounded
from twinloop._ground.texts import in_unit, two_digits
from twinloop.campaign.assessment import foreseen, latest_lesson
from twinloop.errors import InvalidInput, NotAvailable, StoreFailure, TwinloopError
from twinloop.faces.about_test import (
    excitation_words,
    hold_back_ranges,
    hold_back_words,
    reason,
    unknown_risk,
)
from twinloop.faces.cautions import advised_to_stop, not_reliable, serious_of
from twinloop.faces.columns import columns, columns_file
from twinloop.faces.dashboard.desk import Desk, to_be_learnt
from twinloop.faces.dashboard.fence import App, Fence
from twinloop.faces.ends import ends, varying_words
from twinloop.faces.opening import changed_since
from twinloop.faces.report.page import source_page, style, templates
from twinloop.faces.report.source import source
from twinloop.faces.sheet import Sheet
from twinloop.faces.telling import is_chosen, numbered, to_be_flown
from twinloop.faces.withdrawing import recorded
from twinloop.logs import MOST_BYTES, write_columns
from twinloop.planning.leaving import risk_of_what, risk_words
from twinloop.planning.quality import quality_unit
from twinloop.test import Test

MOST_WORDS = 10_000
"""Bytes of what a form says."""
LOGS = (".csv", ".npz")
LONGEST_NAME = 100
"""Characters of a log's name in a message."""


def application(desk: Desk, hosts: tuple[str, ...], token: str = "") -> App:
    """The dashboard of a store, behind its fence.

    Args:
        desk: of the store.
        hosts: names that the server goes by.
        token: that is asked for; empty: none.
    """
    pages = Pages(desk)
    routes = [
        Route("/", pages.campaigns),
        Route("/dashboard.js", pages.script),
        Route("/c/{place:int}", pages.campaign),
        Route("/c/{place:int}/state", pages.state),
        Route("/c/{place:int}/tests", pages.tests),
        Route("/c/{place:int}/report", pages.report),
        Route("/c/{place:int}/tests/{number:int}/sheet", pages.sheet),
        Route("/c/{place:int}/tests/{number:int}/columns.csv", pages.columns),
        Route("/c/{place:int}/ask", pages.ask, methods=["POST"]),
        Route("/c/{place:int}/log", pages.attach, methods=["POST"]),
        Route("/c/{place:int}/tests/{number:int}/approve", pages.approve, methods=["POST"]),
        Route("/c/{place:int}/tests/{number:int}/log", pages.tell, methods=["POST"]),
        Route("/c/{place:int}/tests/{number:int}/failed", pages.fail, methods=["POST"]),
        Route("/c/{place:int}/tests/{number:int}/abandon", pages.abandon, methods=["POST"]),
        Route("/c/{place:int}/flights/{which}/withdraw", pages.withdraw, methods=["POST"]),
    ]
    handlers: dict[Any, Any] = {TwinloopError: _refused}
    return Fence(Starlette(routes=routes, exception_handlers=handlers), hosts, token)


class Pages:
    """What each address shows; the store is read for each, so that it shows what is kept now.

    Args:
        desk: of the store.
    """

    def __init__(self, desk: Desk) -> None:
        self.desk = desk
        self._reports: dict[str, tuple[str, str]] = {}
        self._one_report = threading.Lock()  # who asks at the same time waits for the same page
        folder = resources.files("twinloop.faces.dashboard")
        self._files = {
            name: folder.joinpath(name).read_text("utf-8") for name in ("page.html", "dashboard.js")
        }
        self._style = style() + folder.joinpath("dashboard.css").read_text("utf-8")

    async def campaigns(self, request: Request) -> Response:
        """The campaigns of the store; where there is one, that one."""
        found = await run_in_threadpool(self.desk.campaigns)
        if len(found) == 1:
            return RedirectResponse("/c/1", 303)
        return self._page(title="Campaigns", campaigns=found, name=None)

    async def script(self, request: Request) -> Response:
        """The page's own script."""
        return Response(self._files["dashboard.js"], media_type="text/javascript")

    async def campaign(self, request: Request) -> Response:
        """The page of a campaign."""
        name = await self._named(request)
        return self._page(title=name, campaigns=[], name=name, at=f"/c/{request.path_params['place']}")

    async def state(self, request: Request) -> Response:
        """What the page looks for every other second."""
        return JSONResponse(await run_in_threadpool(self.desk.state, await self._named(request)))

    async def tests(self, request: Request) -> Response:
        """The tests that wait to be flown, with what can be said of each."""
        name = await self._named(request)
        return JSONResponse(await run_in_threadpool(self._waiting, name))

    async def report(self, request: Request) -> Response:
        """The report, as it would be written now."""
        name = await self._named(request)
        return HTMLResponse(await run_in_threadpool(self._report, name))

    async def sheet(self, request: Request) -> Response:
        """A test sheet, to be printed."""
        name, number = await self._named(request), request.path_params["number"]
        return PlainTextResponse(await run_in_threadpool(self._sheet, name, number))

    async def columns(self, request: Request) -> Response:
        """What is added to the commands, and the predicted run."""
        name, number = await self._named(request), request.path_params["number"]
        text, file = await run_in_threadpool(self._columns, name, number)
        # As RFC 6266 has it, for a name that people have given.
        disposition = f"attachment; filename*=UTF-8''{quote(file, safe='')}"
        return Response(text, media_type="text/csv", headers={"content-disposition": disposition})

    async def ask(self, request: Request) -> Response:
        """Plans the next test, behind."""
        said = await _words(request)
        return await self._done(
            self.desk.ask, await self._named(request), said.get("last") is True, status=202
        )

    async def approve(self, request: Request) -> Response:
        """Keeps that a test may be flown."""
        return await self._done(self.desk.approve, await self._named(request), request.path_params["number"])

    async def abandon(self, request: Request) -> Response:
        """Keeps that a test will not be flown."""
        return await self._done(self.desk.abandon, await self._named(request), request.path_params["number"])

    async def fail(self, request: Request) -> Response:
        """Keeps that a test failed, and why."""
        reason = _reason(await _words(request), needed=True)
        return await self._done(
            self.desk.fail, await self._named(request), request.path_params["number"], reason
        )

    async def withdraw(self, request: Request) -> Response:
        """Takes back a flight that was recorded by mistake, and keeps why."""
        reason = _reason(await _words(request), needed=True)
        return await self._done(
            self.desk.withdraw, await self._named(request), request.path_params["which"], reason
        )

    async def tell(self, request: Request) -> Response:
        """Tells a log: the body is the file, its name and the reason of an abort stand in the address."""
        name, number = await self._named(request), request.path_params["number"]
        reason = _reason(dict(request.query_params), needed=False)
        with tempfile.TemporaryDirectory() as folder:
            log, called = await _received(request, Path(folder))
            return await self._done(self.desk.tell, name, number, log, called, reason)

    async def attach(self, request: Request) -> Response:
        """Attaches a log without a test."""
        name = await self._named(request)
        with tempfile.TemporaryDirectory() as folder:
            return await self._done(self.desk.attach, name, *(await _received(request, Path(folder))))

    async def _named(self, request: Request) -> str:
        """Campaigns go by their place in the store: a name may hold anything."""
        place: int = request.path_params["place"]
        known = await run_in_threadpool(self.desk.campaigns)
        if not 1 <= place <= len(known):
            there = f"1 to {len(known)}" if len(known) > 1 else "1, the only one" if known else "none"
            raise InvalidInput(
                f"Campaign: expected {there} of this store, found {place}; the page / lists them."
            )
        return str(known[place - 1]["name"])

    async def _done(self, act: Callable[..., str], *given: object, status: int = 200) -> Response:
        return JSONResponse({"said": await run_in_threadpool(act, *given)}, status)

    def _page(self, **facts: object) -> Response:
        template = templates().from_string(self._files["page.html"])
        policy = (
            "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; frame-ancestors 'self';"
            " base-uri 'none'"
        )
        return HTMLResponse(
            template.render(sheet=_unescaped(self._style), store=self.desk.title, **facts),
            headers={"content-security-policy": policy},
        )

    def _waiting(self, name: str) -> dict[str, object]:
        campaign, may = self.desk.look(name), self.desk.approved(name)
        stored_as = self.desk.stored_as(name)
        units = {gain.name: gain.unit for gain in campaign.family.law_gains}
        bounded = is_bounded(campaign.signals)
        advice = advised_to_stop(campaign) if to_be_flown(campaign) else None
        unreliable = " ".join(not_reliable(stored_as, serious_of(latest_lesson(campaign))))
        return {
            "experiments": len(campaign.experiments),
            "unlearnt": " ".join(
                filter(None, [to_be_learnt(campaign), changed_since(self.desk.store, campaign, name)])
            ),
            "tests": [
                {
                    "number": test.number,
                    "gains": {
                        name: in_unit(f"{value:.6g}", units.get(name, ""))
                        for name, value in test.parameters.items()
                    },
                    "predicted": None if test.predicted is None else f"{test.predicted:.4g}",
                    "spread": None if test.spread is None else two_digits(test.spread),
                    "unit": quality_unit(campaign.setup.quality),
                    "risk": None
                    if test.risk is None
                    else risk_words(test.risk, campaign.setup.predicted_flights, bounded),
                    "risk_of": risk_of_what(bounded),
                    "risk_unknown": unknown_risk(test, campaign.runs > 0, is_chosen(campaign, test))
                    if test.risk is None
                    else None,
                    "advice": advice,
                    "unreliable": unreliable,
                    "reason": reason(test, flown=bool(campaign.history), chosen=is_chosen(campaign, test)),
                    "ends": _ends(test),
                    "varies": varying_words(test, columns_file(stored_as, test).name),
                    "excitation": excitation_words(test, columns_file(stored_as, test).name),
                    "hold_back": hold_back_words(test),
                    "approved": may.get(test.number) if test.number is not None else None,
                }
                for test in to_be_flown(campaign)
            ],
            "recorded": [{"which": which, "words": words} for which, words in recorded(campaign).items()],
        }

    def _report(self, name: str) -> str:
        with self._one_report:
            return self._report_of(name)

    def _report_of(self, name: str) -> str:
        now = str(self.desk.state(name)["state"])
        if self._reports.get(name, ("", ""))[0] != now:
            found = source(self.desk.store, name, self.desk.threads)
            if not found.campaign.history:
                raise NotAvailable(
                    f"Report: expected a learnt experiment, found none. {to_be_learnt(found.campaign)}"
                )
            self._reports[name] = now, source_page(found)
        return self._reports[name][1]

    def _sheet(self, name: str, number: int) -> str:
        campaign = self.desk.agreeing(name)
        test = numbered(campaign, number)
        predicted = foreseen(campaign, test) if campaign.history else None
        stored_as = self.desk.stored_as(name)
        file = columns_file(stored_as, test).name
        return Sheet.of(campaign, stored_as, test, predicted, file, advised_to_stop(campaign)).text

    def _columns(self, name: str, number: int) -> tuple[str, str]:
        """The text of a test's file, and what the file is called."""
        campaign = self.desk.agreeing(name)
        test = numbered(campaign, number)
        predicted = foreseen(campaign, test) if campaign.history else None
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "columns.csv"
            write_columns(path, columns(test, predicted))
            return path.read_text("utf-8"), columns_file(self.desk.stored_as(name), test).name


def _ends(test: Test) -> list[list[str]]:
    """Where a test starts and should end, and the ranges by which its excitation is held back, as a table."""
    ranges = hold_back_ranges(test)
    head = ["state", "start", "target", *(("inner range", "outer range") if ranges else ())]
    rows = [
        [
            f"{each.state.name} ({each.state.unit})" if each.state.unit not in ("", "1") else each.state.name,
            f"{each.start:.4g}",
            " to ".join(dict.fromkeys(f"{value:.4g}" for value in each.targets)),
            *(ranges.get(each.state.name, ("any", "any")) if ranges else ()),
        ]
        for each in ends(test)
    ]
    return [head, *rows]


async def _body(request: Request, most: int) -> bytes:
    """The body of a request, of which no more is ever held than is allowed."""
    found = bytearray()
    try:
        async for piece in request.stream():
            found += piece
            if len(found) > most:
                raise InvalidInput(
                    f"Upload: expected at most {most} bytes, found more; cut it to the flight."
                )
    except ClientDisconnect:
        raise InvalidInput(
            "Upload: expected it whole, found that it stopped half-way; send it again."
        ) from None
    return bytes(found)


async def _words(request: Request) -> dict[str, Any]:
    body = await _body(request, MOST_WORDS)
    try:
        found = json.loads(body or b"{}")
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise InvalidInput("Form: expected one JSON object, found something else.")
    return found


def _reason(said: dict[str, Any], needed: bool) -> str:
    reason = said.get("reason", "")
    if not isinstance(reason, str) or len(reason) > 500 or (needed and not reason.strip()):
        raise InvalidInput(
            "Reason: expected a few words, at most 500 characters, found none or more; say why."
        )
    return reason.strip()


async def _received(request: Request, folder: Path) -> tuple[Path, str]:
    """The body as a file, and the name that it had elsewhere, for people to read: only its ending decides anything."""
    name = re.split(r"[/\\]", request.query_params.get("file", ""))[-1]
    suffix = Path(name).suffix.lower()
    if suffix not in LOGS:
        raise InvalidInput(f"Log: expected a file that ends with {' or '.join(LOGS)}, found another one.")
    path = folder / f"log{suffix}"
    path.write_bytes(await _body(request, MOST_BYTES))
    return path, "".join(letter for letter in name if letter.isprintable())[-LONGEST_NAME:]


async def _refused(request: Request, failure: Exception) -> Response:
    """A sentence instead of a page."""
    status = 409 if isinstance(failure, StoreFailure) else 422
    if request.url.path.endswith("/report"):
        return PlainTextResponse(f"{failure}\n", 200)
    return JSONResponse({"failed": str(failure)}, status)


def _unescaped(text: str) -> Any:
    from markupsafe import Markup

    return Markup(text)
