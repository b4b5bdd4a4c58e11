"""The server's entry: pages by Django, sockets by Channels."""

import os
from typing import Any

from channels.routing import ProtocolTypeRouter, URLRouter
from django.conf import settings
from django.core.asgi import get_asgi_application

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "garry_site.settings")
pages: Any = get_asgi_application()

from rehab.people.sign_in.flood_gate import SignInGate  # noqa: E402
from rehab.people.web.static_files import StaticFilesHandler  # noqa: E402
from rehab.routing import websocket_urlpatterns  # noqa: E402  (models must be loaded first)
from rehab.sessions.live.consumers.isolation_gate import IsolationGate  # noqa: E402

if not settings.HOSTED:  # hosted, WhiteNoise serves the static files
    pages = StaticFilesHandler(pages)

# Devices send no Origin, so it is not asked for here; cookies count only on sockets that our own
# pages opened (rehab.sessions.live.auth).
application = IsolationGate(
    ProtocolTypeRouter(
        {"http": SignInGate(pages), "websocket": URLRouter(websocket_urlpatterns)},
    )
)
