"""`python -m rehab.sources NAME …`: runs a source that dials in to the server.

Exit status: 0 all strides are stored, or the session was ended; 1 a check (--check) left something
to look at; 2 the command line, the recording or what comes cannot be used; 3 the server refuses
this source; 130 stopped by Ctrl-C.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
import threading
import time
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Coroutine, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from rehab.sources import SOURCES, summarize
from rehab.sources.arguments import make_parser
from rehab.sources.client import (
    Journal,
    LiveFeed,
    SourceClient,
    StepsLost,
    StridePlayback,
    UnsendableStride,
)
from rehab.sources.reporting import SourceError
from rehab.sources.source import LiveSource
from robot.connection_args import (
    BadConnectionArgs,
    find_token,
    find_token_store,
    websocket_url,
)
from robot.link import Link, LinkRefused

if TYPE_CHECKING:
    from rehab.sources.intake import Intake

SOURCE_PATH = "/ws/source/"
STATUS_EVERY_S = 5.0

EXIT_UNSURE = 1
EXIT_DONE, EXIT_UNUSABLE, EXIT_REFUSED, EXIT_INTERRUPTED = 0, 2, 3, 130


def make_top_parser() -> ArgumentParser:
    """Return the parser that answers to anything but the name of a source."""
    names = "\n".join(f"  {name:14}{summarize(name)}" for name in SOURCES)
    parser = ArgumentParser(
        prog="python -m rehab.sources",
        description=f"{__doc__}\nsources, each with its own --help:\n{names}",
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("source", choices=SOURCES, metavar="NAME")
    return parser


def open_log(path: Path) -> TextIO:
    """Open a file to append to. Raises SourceError where that is not possible."""
    try:
        return path.open("a", encoding="utf-8")
    except OSError as problem:
        raise SourceError(f"The log {path} cannot be written: {problem.strerror}.") from None


def exit_with_parent() -> None:
    """Wait until standard input closes, as it does when the server dies, and exit."""
    while os.read(0, 4096):  # not sys.stdin: Python aborts where a thread holds its lock at the end
        pass
    os._exit(EXIT_INTERRUPTED)


def print_status(text: str) -> None:
    """Print a line for the person who runs the source."""
    print(text, file=sys.stderr, flush=True)


async def run_client(
    client: SourceClient, describe: Callable[[], str], *others: Coroutine[None, None, None]
) -> None:
    """Run a client and other work until the client is done, and print its status now and then.

    Other work that ends changes nothing; other work that fails ends the client.
    """

    async def report_status() -> None:
        while True:
            await asyncio.sleep(STATUS_EVERY_S)
            print_status(describe())

    walking = asyncio.create_task(client.run())
    others_running = [asyncio.create_task(work) for work in (report_status(), *others)]
    waiting = {walking, *others_running}
    try:
        while walking in waiting:
            done, waiting = await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
    finally:
        for task in (walking, *others_running):
            task.cancel()
        await asyncio.gather(walking, *others_running, return_exceptions=True)


async def run_live_source(source: LiveSource, intake: Intake, client: SourceClient) -> None:
    """Run a client with the strides of a live source."""

    async def read() -> None:
        await source.read(intake)
        intake.finish()

    def describe() -> str:
        return f"{client.describe()}; {intake.describe()}"

    await run_client(client, describe, read(), intake.watch())


def check_stream(name: str, options: Namespace) -> int:
    """Print what the columns of a live source are; nothing is sent. Return the exit status.

    0 where all is sure, 1 where a person has to look at something. Raises SourceError.
    """
    from rehab.gait import GaitInputError
    from rehab.sources.intake.stream_check import StreamCheck

    async def listen(source: LiveSource, check: StreamCheck) -> None:
        reading = asyncio.create_task(source.read(check))
        done = asyncio.create_task(check.wait_until_done())
        finished, _ = await asyncio.wait({reading, done}, return_when=asyncio.FIRST_COMPLETED)
        for task in (reading, done):
            task.cancel()
        await asyncio.gather(reading, done, return_exceptions=True)
        if reading in finished:
            reading.result()

    try:
        source = SOURCES[name](options, print_status)
        assert isinstance(source, LiveSource)  # noqa: S101 (others have no such option)
        check = StreamCheck(source.settings, print_status)
        asyncio.run(listen(source, check))
        lines, is_certain = check.describe_setup()
    except GaitInputError as problem:
        raise SourceError(str(problem)) from None
    print(*lines, sep="\n")
    return EXIT_DONE if is_certain else EXIT_UNSURE


def run(name: str, options: Namespace, stack: ExitStack) -> int:
    """Run a source until it is done and return the exit status. Raises what makes it unusable."""
    if options.stay and options.session is not None:
        raise SourceError("--stay goes on with later sessions, --session names one: give only one.")
    url = websocket_url(options.server, SOURCE_PATH)
    token = find_token(options, "GARRY_TOKEN", "a source")
    try:
        source = SOURCES[name](options, print_status)
    except ValueError as problem:  # RecordingError, GaitInputError, UnsendableStride
        raise SourceError(str(problem)) from None
    log = stack.enter_context(open_log(options.log)) if options.log else None

    def on_ack(session: int, number: int) -> None:
        if log is not None:
            line = {"session": session, "number": number, "time": time.time()}
            log.write(json.dumps(line) + "\n")
            log.flush()

    journal = None
    if getattr(options, "journal", None) is not None:
        size = 1_000_000 * options.journal_mb
        journal = Journal(options.journal, url, size, print_status)
        stack.callback(journal.close)

    def make_client(feed: StridePlayback | LiveFeed) -> SourceClient:
        return SourceClient(
            partial(Link, url, token, store_token=find_token_store(options, print_status)),
            feed,
            session=options.session,
            stay=options.stay,
            journal=journal,
            on_ack=on_ack,
            plugin=SOURCES.find_plugin(name),
            simulated=source.simulated,
            notify=print_status,
        )

    if isinstance(source, LiveSource):
        # Imports numpy, which a simulated patient does not need.
        from rehab.sources.intake import Intake

        feed = LiveFeed()
        client = make_client(feed)
        intake = Intake(feed, source.settings, print_status)
        stack.callback(intake.close)

        doing = run_live_source(source, intake, client)
    else:
        client = make_client(
            StridePlayback(
                source.open_walk, options.speed, source.max_unacknowledged, resumes=options.resume
            )
        )
        doing = run_client(client, client.describe)
    try:
        asyncio.run(doing)
    except KeyboardInterrupt:
        print_status(f"Stopped. {client.describe()}")
        return EXIT_INTERRUPTED
    except (LinkRefused, StepsLost) as refusal:
        print_status(f"{refusal}")
        print_status(client.describe())
        return EXIT_REFUSED
    print_status(
        f"Done: {client.acknowledged} strides acknowledged, {client.lost} not taken any more."
    )
    return EXIT_DONE


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the source that the command line names and return the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not words or words[0] not in SOURCES:
        for plugin in SOURCES.plugins:
            if plugin.problem:
                print_status(f"{plugin.package}: {plugin.name} cannot be used: {plugin.problem}.")
        make_top_parser().parse_args(words[:1])
    name = words[0]
    options = make_parser(name, SOURCES[name]).parse_args(words[1:])
    if getattr(options, "check", False):
        try:
            return check_stream(name, options)
        except SourceError as problem:
            print_status(f"{problem}")
            return EXIT_UNUSABLE
        except KeyboardInterrupt:
            return EXIT_INTERRUPTED
    if options.child:
        threading.Thread(target=exit_with_parent, daemon=True).start()
    try:
        with ExitStack() as stack:
            return run(name, options, stack)
    except (BadConnectionArgs, UnsendableStride, SourceError) as problem:
        print_status(f"{problem}")
        return EXIT_UNUSABLE
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
