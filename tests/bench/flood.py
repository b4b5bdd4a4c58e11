"""A flood of attempts to sign in, so many a second, until it is told to end. Its own process.

At the end it prints one line of JSON: how many were answered with which status.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import re
import sys
import time
from collections import Counter
from itertools import count
from urllib.parse import urlencode

import uvloop


async def ask(port: int, head: str, body: str = "") -> str:
    """Send a request on a connection of its own; return the answer."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    length = f"Content-Length: {len(body)}\r\n" if body else ""
    writer.write(f"{head}{length}Host: localhost\r\nConnection: close\r\n\r\n{body}".encode())
    answer = (await reader.read()).decode(errors="replace")
    writer.close()
    return answer


async def main(port: int, rate: float, addresses: int) -> None:
    """Flood until standard input ends."""
    page = await ask(port, "GET /sign-in/ HTTP/1.1\r\n")
    token = re.search(r"csrftoken=([^;]+)", page)
    assert token is not None
    cookie = f"Cookie: csrftoken={token[1]}\r\n"
    kind = "Content-Type: application/x-www-form-urlencoded\r\n"
    answers: Counter[str] = Counter()

    async def attempt(number: int) -> None:
        address = (
            f"X-Forwarded-For: 10.{number % addresses // 250}.0.{number % addresses % 250}\r\n"
        )
        form = {"csrfmiddlewaretoken": token[1], "username": "pt", "password": f"wrong {number}"}
        head = f"POST /sign-in/ HTTP/1.1\r\n{cookie}{kind}{address}"
        try:
            answers[(await ask(port, head, urlencode(form))).split(" ")[1]] += 1
        except (OSError, IndexError):
            answers["none"] += 1

    ended = asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
    attempts: set[asyncio.Task[None]] = set()
    due = time.perf_counter()
    for number in count():
        if ended.done():
            break
        attempts.add(task := asyncio.create_task(attempt(number)))
        task.add_done_callback(attempts.discard)
        due += 1 / rate
        await asyncio.sleep(max(0.0, due - time.perf_counter()))
    await asyncio.wait_for(asyncio.gather(*attempts), 60)
    print(json.dumps(answers), flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("port", type=int)
    parser.add_argument("--rate", type=float, default=100.0)
    parser.add_argument("--addresses", type=int, default=1)
    chosen = parser.parse_args()
    uvloop.run(main(chosen.port, chosen.rate, chosen.addresses))
