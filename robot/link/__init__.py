"""The websocket client of robots and sources: it connects to the server, and reconnects.

::

    async with Link(url, token, greet=lambda: {"type": "hello", …}) as link:
        async for message in link:  # goes on over every reconnection; each begins with the greeting
            …
            await link.send({"type": "report", …})

docs/protocol.md is the contract; the close codes here are its table.
"""

from robot.link.dialing import BackOff, Timing, dial
from robot.link.link import FrameTooLarge, Link, Message
from robot.link.refusals import REFUSALS, LinkRefused

__all__ = [
    "REFUSALS",
    "BackOff",
    "FrameTooLarge",
    "Link",
    "LinkRefused",
    "Message",
    "Timing",
    "dial",
]
