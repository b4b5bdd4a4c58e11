"""A session's own programs and pages behind the proxy: source, robot, tablet, therapist's page."""

from __future__ import annotations

import asyncio
import os
import re
import shutil
import sys
import time
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack, suppress
from pathlib import Path
from typing import Any, Self

from playwright.async_api import Page, async_playwright

from tests.support.servers import ROOT, clean_environment

# What the tablet shows, each with its time.
RECORD = """() => {
  window.shown = [];
  const all = { attributes: true, childList: true, subtree: true, characterData: true };
  const watch = () => new MutationObserver(() => {
    const { look, step } = document.body.dataset;
    const words = document.querySelector(".words")?.textContent ?? "";
    shown.push({ at: Date.now() / 1000, look, step, words });
  }).observe(document.body, all);
  addEventListener("DOMContentLoaded", watch);
}"""
# How long until the page says what became of a stop [ms].
STOP = """() => new Promise((done) => {
  const began = performance.now();
  const said = document.querySelector(".said");
  const look = () => /own switch/.test(said.textContent) && done(performance.now() - began);
  new MutationObserver(look).observe(said, { childList: true, subtree: true, characterData: true });
  document.querySelector("[data-robot=stop]").click();
  setTimeout(() => done(60_000), 5_000);
})"""


class RealClinic:
    """Programs and pages that know the proxy's address alone.

    Parameters
    ----------
    row
        The session, as `live_seed` returns it.
    url
        Of the proxy.
    certificate
        A file that programs trust.
    """

    def __init__(self, row: dict[str, Any], url: str, certificate: Path) -> None:
        self.row, self.url = row, url
        self._certificate = certificate
        self._stack = AsyncExitStack()
        self.monitor: Page
        self.tablet: Page

    async def __aenter__(self) -> Self:
        """Start the programs and open the pages."""
        await self._run("source", "-m", "rehab.sources", "synthetic", "--stay")
        await self._run("robot", "-m", "robot", "--base", "null")
        playwright = await self._stack.enter_async_context(async_playwright())
        browser = await playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        self._stack.push_async_callback(browser.close)
        path = f"{self.url}/sessions/{self.row['session']}/"
        pages = []
        for name, cookie, place in (
            ("sessionid", self.row["cookie"], f"{path}monitor/"),
            ("garry_tablet", self.row["tablet"], path),
        ):
            context = await browser.new_context(
                ignore_https_errors=True, viewport={"width": 1280, "height": 900}
            )
            context.set_default_timeout(60_000)
            await context.add_cookies([{"name": name, "value": cookie, "url": self.url}])
            await context.add_init_script(f"({RECORD})()")
            page = await context.new_page()
            await page.goto(place)
            pages.append(page)
        self.monitor, self.tablet = pages
        return self

    async def __aexit__(self, *problem: Any) -> None:
        """End them."""
        await self._stack.aclose()

    async def _run(self, kind: str, *arguments: str) -> None:
        environment = clean_environment(ROOT, 0) | {
            "GARRY_TOKEN": self.row[kind],
            "GARRY_ROBOT_TOKEN": self.row[kind],
            "SSL_CERT_FILE": str(self._certificate),
        }
        program = await asyncio.create_subprocess_exec(
            sys.executable,
            *arguments,
            "--server",
            self.url,
            cwd=ROOT,
            env=environment,
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.DEVNULL,
        )

        async def end() -> None:
            with suppress(ProcessLookupError):
                program.terminate()
            await program.wait()

        self._stack.push_async_callback(end)

    async def find_last(self) -> tuple[int, int]:
        """Return the last steps that the therapist's and the patient's page show."""
        number = await self.monitor.locator("[data-show=number]").text_content() or ""
        step = await self.tablet.locator("body").get_attribute("data-step") or ""
        return int("".join(re.findall(r"\d", number)) or 0), int(step or 0)

    async def is_whole(self) -> bool:
        """Return whether the therapist's page has everybody connected, and claims it freshly."""
        signs = [
            (await self.monitor.locator(f"[data-presence={kind}] small").text_content() or "–")[0]
            for kind in ("source", "tablets", "robot")
        ]
        stale = [await page.locator("body.stale").count() for page in (self.monitor, self.tablet)]
        return "–" not in signs and not any(stale)

    async def go_on(self, within_s: float) -> None:
        """Wait until both pages show more steps."""
        before = max(await self.find_last())

        async def has_more() -> bool:
            return min(await self.find_last()) > before

        await self._wait(has_more, within_s)

    async def come_back(self, within_s: float) -> None:
        """Wait until both pages are fresh, and all programs are connected."""
        await self._wait(self.is_whole, within_s)

    async def _wait(self, is_done: Callable[[], Awaitable[bool]], within_s: float) -> None:
        until_s = time.monotonic() + within_s
        while not await is_done():
            if time.monotonic() > until_s:
                await self.picture("stuck")
                raise TimeoutError(await self.monitor.locator("body").inner_text())
            await asyncio.sleep(0.05)

    async def resume(self) -> None:
        """Let the session go on where it was paused, as a therapist does."""
        if await self.monitor.locator("[data-main]").get_attribute("value") == "resume":
            await self.monitor.click("[data-main]")

    async def picture(self, name: str) -> None:
        """Take pictures of both pages into GARRY_TEST_PICTURES."""
        if folder := os.environ.get("GARRY_TEST_PICTURES"):
            for page, whose in ((self.monitor, "monitor"), (self.tablet, "tablet")):
                await page.screenshot(path=Path(folder) / f"{name}-{whose}.png")

    async def find_false_claims(self) -> list[str]:
        """Return what the pages claim, or leave out, while their server says nothing."""
        alarms = await self.monitor.locator("[data-alarm]").all_text_contents()
        presence = await self.monitor.locator("[data-presence] small").all_text_contents()
        problems = [f"{one!r} is claimed" for one in presence if "not known for" not in one]
        if len(alarms) != 1 or "The server has not answered for" not in alarms[0]:
            problems.append(f"alarms: {alarms}")
        for page, whose in ((self.monitor, "monitor"), (self.tablet, "tablet")):
            if not await page.locator("body.stale").count():
                problems.append(f"the {whose} is not gray")
        words = await self.tablet.locator(".words").text_content() or ""
        if "No connection for" not in words:
            problems.append(f"the tablet says {words!r}")
        return problems

    async def stop(self) -> float:
        """Stop the robot on the therapist's page; return when it says that nobody heard it [s]."""
        return float(await self.monitor.evaluate(STOP)) / 1000

    async def find_celebrated(self, from_s: float, until_s: float) -> list[str]:
        """Return what the tablet answered to steps between two times of this machine's clock."""
        shown = await self.tablet.evaluate("shown")
        return [
            f"{one['words']} at step {one['step']}, {one['at'] - from_s:.1f} s"
            for one in shown
            if from_s < one["at"] < until_s and one["look"] == "feedback"
        ]
