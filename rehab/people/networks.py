"""Network addresses of clients, and whether they belong to a clinic's own networks.

From elsewhere a session is watched only with the patient's consent to remote view. A clinic that
names no networks makes no such distinction and offers no remote view.
"""

from __future__ import annotations

from ipaddress import IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network

from django.conf import settings
from django.core.exceptions import ValidationError
from django.http import HttpRequest
from django.utils.translation import gettext_lazy as _

IPV6_PREFIX_LENGTH = 64  # of an IPv6 address only its network is stored


def validate_networks(text: str) -> None:
    """Refuse text that is not a list of networks."""
    for word in text.split():
        try:
            network = ip_network(word)
        except ValueError:
            raise ValidationError(
                _("“%(word)s” is no network. Give one such as 192.168.1.0/24."),
                params={"word": word},
            ) from None
        if isinstance(network, IPv6Network) and network.prefixlen > IPV6_PREFIX_LENGTH:
            raise ValidationError(
                _("“%(word)s” is too small. Give the whole network, such as 2001:db8:1:2::/64."),
                params={"word": word},
            )


def is_in_networks(networks: str, address: str) -> bool:
    """Return whether an address is in these networks or on the server's own machine."""
    client = ip_address(address)
    own: list[IPv4Network | IPv6Network] = [ip_network(word) for word in networks.split()]
    return client.is_loopback or any(client in network for network in own)


def is_outside(networks: str, address: str) -> bool:
    """Return whether an address, "" where nobody knows it, is outside the networks that are named.

    Nothing is outside where none are named.
    """
    return bool(networks) and not (address and is_in_networks(networks, address))


def client_address(request: HttpRequest) -> str:
    """Return the client address of a request."""
    return resolve_client_address(
        request.META.get("HTTP_X_FORWARDED_FOR", ""), request.META.get("REMOTE_ADDR", "")
    )


def resolve_client_address(forwarded: str, remote: str) -> str:
    """Return the address of a client, as the outermost of our own proxies saw it.

    Entries further left in X-Forwarded-For were written by the client and are not trusted. None is
    where the peer comes from the internet: our own proxies stand in our own network.
    Of an IPv6 address the /64 network is returned: a client has all 2^64 addresses of it.

    Parameters
    ----------
    forwarded
        The header X-Forwarded-For, "" without one.
    remote
        The address of the peer that connected to the server.
    """
    hops = [word.strip() for word in forwarded.split(",") if word.strip()]
    hops = [remote] if _is_of_the_internet(remote) else [*hops, remote]
    try:
        address = ip_address(hops[max(0, len(hops) - 1 - settings.PROXIES)])
    except ValueError:
        return "0.0.0.0"  # noqa: S104  (no valid address; such clients are counted together)
    if isinstance(address, IPv6Address):
        if address.ipv4_mapped:
            return str(address.ipv4_mapped)
        return str(ip_network((address, IPV6_PREFIX_LENGTH), strict=False).network_address)
    return str(address)


def _is_of_the_internet(remote: str) -> bool:
    try:
        return ip_address(remote).is_global
    except ValueError:  # a socket of the machine itself
        return False
