"""Tags and filters of all templates."""

import json
from collections.abc import Iterable
from typing import Any

from django import template
from django.templatetags.static import static
from django.urls import reverse
from django.utils.html import format_html, json_script
from django.utils.safestring import SafeString
from django.utils.text import capfirst
from django.utils.translation import gettext as _

from rehab.people.web.help_pages import find_part
from rehab.people.web.page_scripts import REPLAYED_SOCKET, SOCKET, find_modules
from rehab.people.web.tour import show_step, where_in_tour
from rehab.sessions.formatting import (
    format_duration,
    format_rate,
    format_source,
)
from rehab.training.valences import VALENCES
from robot.wire.close_codes import FINAL_FOR_PAGES
from robot.wire.limits import PAGE_HEARTBEAT_S, SERVER_COOKIE

register = template.Library()


@register.simple_tag
def icon(name: str) -> SafeString:
    """Return an icon of static/img/icons.svg. It is hidden from readers: put text beside it."""
    return format_html(
        '<svg class="ic" aria-hidden="true"><use href="{}#{}"></use></svg>',
        static("img/icons.svg"),
        name,
    )


@register.simple_tag
def back(view: str, *args: object) -> SafeString:
    """Return the button, first in a page's heading, that leads to the page above it."""
    return format_html(
        '<a class="btn" href="{}" aria-label="{}">{}</a>',
        reverse(view, args=args),
        _("Back"),
        icon("back"),
    )


@register.simple_tag(takes_context=True)
def import_map(context: dict[str, Any], *scripts: str) -> SafeString:
    """Return where scripts of static/js/ (of all pages, if none is named) find what they import.

    With it comes what the session's socket has to know of the wire, as the JSON element ``wire``.
    """
    files = find_modules(*scripts)
    limits = {
        "final_codes": sorted(FINAL_FOR_PAGES),
        "heartbeat_ms": 1000 * PAGE_HEARTBEAT_S,
        "server_cookie": SERVER_COOKIE,
    }
    if context.get("replayed"):
        files = {**files, SOCKET: REPLAYED_SOCKET}
    imports = {name: static(file) for name, file in files.items()}
    return format_html(
        '{}<script type="importmap" nonce="{}">{}</script>',
        json_script(limits, "wire") if SOCKET in files else "",
        context["request"].csp_nonce,
        SafeString(json.dumps({"imports": imports}, separators=(",", ":"))),
    )


@register.simple_tag(takes_context=True)
def help_address(context: dict[str, Any]) -> str:
    """Return the address of the help on the page that is shown."""
    match = getattr(context.get("request"), "resolver_match", None)
    part = find_part(match.url_name or "") if match else ""
    return f"{reverse('help')}#{part}" if part else reverse("help")


@register.inclusion_tag("people/tour.html", takes_context=True)
def tour(context: dict[str, Any]) -> dict[str, object]:
    """Return what the page shows of the tour."""
    return show_step(context.get("request"))


@register.simple_tag(takes_context=True)
def left_tour(context: dict[str, Any]) -> int:
    """Return the step at which the tour was left; 0 for none, negative while it runs."""
    return -where_in_tour(context["request"])


@register.filter
def with_labels(cells: Iterable[str], headers: Iterable[dict[str, Any]]) -> list[str]:
    """Return the cells of a row of the admin, each with its column's name for cards of a phone."""
    return [
        cell
        if "action-checkbox" in cell[:30]
        else SafeString(
            cell.replace("<td", format_html('<td data-label="{}"', capfirst(header["text"])), 1)
        )
        for cell, header in zip(cells, headers, strict=True)
    ]


@register.filter
def leg(side: str) -> str:
    """Return the label of a leg; "" for none."""
    return {"left": _("left leg"), "right": _("right leg")}.get(side, "")


register.filter("duration", format_duration)
register.filter("source", format_source)
register.filter("rate", format_rate)


@register.filter
def type_name(slug: str) -> str:
    """Return the label of a valence."""
    return _(VALENCES[slug].label)


@register.filter
def level(name: str) -> str:
    """Return the label of a robot level."""
    return _(name) if name else ""
