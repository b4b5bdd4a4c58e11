"""The address at which a tablet reaches this server, as far as the server can know it."""

from __future__ import annotations

from collections.abc import Iterable
from ipaddress import ip_address

from django.http.request import split_domain_port


def _is_for_others(name: str) -> bool:
    """Return whether other machines reach a name or address: no loopback, wildcard or pattern."""
    if not name or name.startswith((".", "*")) or name == "localhost":
        return False
    try:
        address = ip_address(name.strip("[]"))
    except ValueError:
        return True
    return not (address.is_loopback or address.is_unspecified)


def reachable_host(host: str, names: Iterable[str]) -> str | None:
    """Return the host and port that a tablet opens; None where only this machine can.

    Parameters
    ----------
    host
        Where the therapist's own page was opened, `name:port`.
    names
        Names and addresses that the server answers to, the best one first.
    """
    name, port = split_domain_port(host)
    if _is_for_others(name):
        return host
    for other in names:
        if _is_for_others(other):
            return f"{other}:{port}" if port else other
    return None
