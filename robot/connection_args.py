"""Address and token of the server, from a command line."""

from __future__ import annotations

import os
from argparse import ArgumentParser, Namespace, _ArgumentGroup
from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit, urlunsplit

from robot.atomic_file import write_atomically


class BadConnectionArgs(ValueError):
    """An address or a token that cannot be used; the message names the cure."""


def websocket_url(server: str, path: str) -> str:
    """Return the address of one of a server's sockets.

    Parameters
    ----------
    server
        ``http(s)://host:port`` as in a browser, or ``ws(s)://…``; may have a path before ours.
    path
        The socket's own path, such as ``/ws/source/``.

    Raises
    ------
    BadConnectionArgs
        For anything else.
    """
    try:
        parts = urlsplit(server.strip())
        scheme = {"http": "ws", "https": "wss", "ws": "ws", "wss": "wss"}[parts.scheme]
        is_server = bool(parts.hostname) and parts.port != 0
    except (KeyError, ValueError):
        is_server = False
    if not is_server or parts.query or parts.fragment or parts.username is not None:
        raise BadConnectionArgs(
            f"{server!r} is no server address. Write it as http://127.0.0.1:8000, or https://… for "
            "a hosted server."
        )
    return urlunsplit((scheme, parts.netloc, parts.path.rstrip("/") + path, "", ""))


def check_token(token: str) -> str:
    """Return a token without the blanks around it. Raises BadConnectionArgs."""
    token = token.strip()
    if not token or not token.isascii() or not token.isprintable() or " " in token:
        raise BadConnectionArgs(
            "That is no token. Copy it from the admin page that showed it, as a whole."
        )
    return token


def add_connection_arguments(parser: ArgumentParser | _ArgumentGroup) -> None:
    """Add options for the server, the token and ``--child`` to a command line."""
    parser.add_argument(
        "--server",
        default=os.environ.get("GARRY_SERVER", "http://127.0.0.1:8000"),
        metavar="URL",
        help="address of the server (default: GARRY_SERVER, or http://127.0.0.1:8000)",
    )
    token = parser.add_mutually_exclusive_group()
    token.add_argument("--token", help="the device's token; others may see it in a process list")
    token.add_argument(
        "--token-file",
        type=Path,
        metavar="FILE",
        help="or a file that holds it; the server replaces the token in it each month, where this "
        "account may write it",
    )
    parser.add_argument(
        "--child", action="store_true", help="end when standard input closes, as the server's child"
    )


def find_token_store(
    options: Namespace, notify: Callable[[str], None]
) -> Callable[[str], bool] | None:
    """Return what stores the next token in the command line's file, if there is one.

    Parameters
    ----------
    options
        The command line, with the arguments of ``add_connection_arguments``.
    notify
        Called with lines for people, such as that the file cannot be written.

    Returns
    -------
    Callable or None
        Stores a token, for its owner alone, and returns whether the disk has it. None where there
        is no file, or it cannot be written.
    """
    if options.token_file is None:
        return None
    path = options.token_file.resolve()  # not a link to it
    if not (os.access(path, os.W_OK) and os.access(path.parent, os.W_OK)):
        notify(
            f"The token in {options.token_file} stays as it is, and expires 90 days after the "
            "server has last replaced it: this account cannot write the file or its folder. Let it "
            "write both."
        )
        return None

    def store(token: str) -> bool:
        try:
            write_atomically(path, f"{token}\n".encode("ascii"))
        except OSError as problem:
            notify(
                f"The server gave a new token, which cannot be written to {path} "
                f"({problem.strerror}): the old one stays in use. Let this account write the file "
                "and its folder, and make room."
            )
            return False
        return True

    return store


def find_token(options: Namespace, variable: str, whose: str) -> str:
    """Return the token of the command line, of its file or of an environment variable.

    Parameters
    ----------
    options
        The command line, with the arguments of ``add_connection_arguments``.
    variable
        Name of the environment variable.
    whose
        Who needs the token, for the error message: "a robot".

    Raises
    ------
    BadConnectionArgs
        Where there is no token, or what there is cannot be one.
    """
    if options.token_file is not None:
        try:
            return check_token(options.token_file.read_text("utf-8"))
        except (OSError, UnicodeDecodeError) as problem:
            raise BadConnectionArgs(
                f"The token file {options.token_file} cannot be read: {problem}."
            ) from None
    token = options.token or os.environ.get(variable, "")
    if not token:
        raise BadConnectionArgs(
            f"{whose.capitalize()} needs the token of its device: --token-file FILE, --token "
            f"TOKEN, or {variable} in the environment. Make one in the admin (Devices)."
        )
    return check_token(token)
