"""From where somebody watches: from the clinic, or from elsewhere with the patient's consent alone.

A clinic names its own networks; one that names none makes no difference, and offers no remote view.
"""

from __future__ import annotations

from ipaddress import IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network

from django.conf import settings
from django.core.exceptions import ValidationError
from django.http import HttpRequest
from django.utils.translation import gettext_lazy as _

WHOLE_IPV6 = 64  # of an IPv6 address no more is known (`find_address`)


def check_networks(text: str) -> None:
    """Refuse what names no networks."""
    for word in text.split():
        try:
            network = ip_network(word)
        except ValueError:
            raise ValidationError(
                _("“%(word)s” is no network. Give one such as 192.168.1.0/24."),
                params={"word": word},
            ) from None
        if isinstance(network, IPv6Network) and network.prefixlen > WHOLE_IPV6:
            raise ValidationError(
                _("“%(word)s” is too small. Give the whole network, such as 2001:db8:1:2::/64."),
                params={"word": word},
            )


def is_within(networks: str, address: str) -> bool:
    """Whether an address is of these networks, or of the server's own computer."""
    here = ip_address(address)
    known: list[IPv4Network | IPv6Network] = [ip_network(word) for word in networks.split()]
    return here.is_loopback or any(here in network for network in known)


def client_address(request: HttpRequest) -> str:
    """Give the address that a request comes from."""
    return find_address(
        request.META.get("HTTP_X_FORWARDED_FOR", ""), request.META.get("REMOTE_ADDR", "")
    )


def find_address(forwarded: str, remote: str) -> str:
    """Give the address of a client, as the outermost of our own proxies saw it.

    What stands further left in X-Forwarded-For was written by the client and is not believed.
    Of an IPv6 address the network counts: whoever has one has 2^64 of them.
    """
    seen = [word.strip() for word in forwarded.split(",") if word.strip()]
    seen.append(remote)
    try:
        address = ip_address(seen[max(0, len(seen) - 1 - settings.PROXIES)])
    except ValueError:
        return "0.0.0.0"  # noqa: S104  (an address that is none; such clients share one count)
    if isinstance(address, IPv6Address):
        if address.ipv4_mapped:
            return str(address.ipv4_mapped)
        return str(ip_network((address, 64), strict=False).network_address)
    return str(address)
