"""The settings: one file, every option a GARRY_* variable, good defaults for a clinic.

Whatever loads them makes files that its own account of the machine alone can read. A hosted server
that strangers could enter does not start, whichever program starts it: these errors are raised here
and not by a check, which only Django's own commands run.
"""

import os
from ipaddress import ip_network
from pathlib import Path
from urllib.parse import urlsplit
from zoneinfo import available_timezones

from csp.constants import NONCE, NONE, SELF
from django.core.exceptions import ImproperlyConfigured
from platformdirs import user_data_path

from garry_site import environment
from garry_site.data_folder import close_data_folder, read_secret_key
from garry_site.databases import parse_database
from garry_site.environment import flag, number, string_list, text

os.umask(0o077)
BASE_DIR = Path(__file__).resolve().parent.parent
# An installed package has the pages' files inside and the data in the user's own folder (setup.py).
IS_INSTALLED = (BASE_DIR / "garry_site" / "files").is_dir()
FILES_DIR = BASE_DIR / "garry_site" / "files" if IS_INSTALLED else BASE_DIR
PROGRAM = environment.name_program(IS_INSTALLED)
VARIABLES = environment.VARIABLES  # every GARRY_* variable, once all below are read

# --- where and how it runs ----------------------------------------------------------------------

HOSTED = flag("GARRY_HOSTED", False, "many clinics on one server, behind TLS")
DEMO = text("GARRY_DEMO", "", "password of a demonstration of invented patients (by garry demo)")
DEBUG = flag("GARRY_DEBUG", False, "Django's debug pages; for developers only")
DATA_DIR = Path(
    text(
        "GARRY_DATA_DIR",
        str(user_data_path("garry", appauthor=False) if IS_INSTALLED else BASE_DIR / "var"),
        "folder of database and secrets",
    )
)
BACKUP_KEYS = string_list(
    "GARRY_BACKUP_KEYS", "", "public keys that backups are encrypted to (age1…)"
)
MOVE_KEYS = string_list(
    "GARRY_MOVE_KEYS", "", "public keys, beside those, that a host's page writes a clinic's file to"
)
BACKUP_DIR = text("GARRY_BACKUP_DIR", "", "folder of nightly backups (upkeep)")
BACKUP_DAYS = number("GARRY_BACKUP_DAYS", 30, "days that they are kept", low=2, high=3650)
RESTORE_KEY = text("GARRY_RESTORE_KEY", "", "file with a secret key, for weekly test restores")
SHIPPED_LOGS = text("GARRY_SHIPPED_LOGS", "", "file elsewhere that sealed logs are appended to")
HOST = text("GARRY_HOST", "127.0.0.1", "address that the server listens on")
PORT = number("GARRY_PORT", 8000, "port that the server listens on", low=1, high=65535)
ALLOWED_HOSTS = string_list(
    "GARRY_ALLOWED_HOSTS",
    "" if HOSTED else f"localhost,127.0.0.1,[::1],{HOST}",
    "names that browsers reach the server by",
)

# Phones measure movement on pages by https alone. Without files of a real name a clinic makes its
# own authority (rehab.stations.https); a hosted server's proxy encrypts.
CERTIFICATE = text("GARRY_CERTIFICATE", "", "file of this server's certificate for https, PEM")
CERTIFICATE_KEY = text("GARRY_CERTIFICATE_KEY", CERTIFICATE, "file of its key, PEM")
HTTPS_PORT = number("GARRY_HTTPS_PORT", 8443, "port of https", low=1, high=65535)
if missing := [one for one in (CERTIFICATE, CERTIFICATE_KEY) if one and not Path(one).is_file()]:
    raise ImproperlyConfigured(
        f"{missing[0]} is no file. Give GARRY_CERTIFICATE and GARRY_CERTIFICATE_KEY PEM files, or "
        "unset both for a certificate of the clinic's own."
    )

SECRET_KEY_LENGTH = 50  # as Django's own check asks for
if HOSTED and DEBUG:
    raise ImproperlyConfigured("A hosted server must not show debug pages. Unset GARRY_DEBUG.")
if HOSTED and (not ALLOWED_HOSTS or "*" in ALLOWED_HOSTS):
    raise ImproperlyConfigured(
        "A hosted server must know its own names. Set GARRY_ALLOWED_HOSTS, for example to "
        "garry.example.org."
    )


close_data_folder(DATA_DIR)
SECRET_KEY = text("GARRY_SECRET_KEY", "", "secret that signs cookies and tokens")
if HOSTED and len(SECRET_KEY) < SECRET_KEY_LENGTH:
    raise ImproperlyConfigured(
        "A hosted server needs a secret key of its own. Set GARRY_SECRET_KEY to "
        f"{SECRET_KEY_LENGTH} or more random characters."
    )
SECRET_KEY = SECRET_KEY or read_secret_key(DATA_DIR)
SECRET_KEY_FALLBACKS = string_list(
    "GARRY_SECRET_KEY_FALLBACKS", "", "secret keys from before, until rotatekeys has run"
)

# --- applications -------------------------------------------------------------------------------

INSTALLED_APPS = [
    "rehab",  # before daphne: its own `runserver` takes precedence
    "daphne",
    "channels",
    "rehab.admin_site.GarryAdminConfig",  # django.contrib.admin with our front page
    "django.contrib.auth",
    "django.contrib.contenttypes",
    "django.contrib.sessions",
    "django.contrib.messages",
    "django.contrib.staticfiles",
    "csp",
    "ninja",  # serves the files of the API's documentation, which would else come from a CDN
]
MIDDLEWARE = [
    "garry_site.logs.RequestIdMiddleware",
    "garry_site.tracing.TracingMiddleware",
    "rehab.stations.https.middleware.EncryptionMiddleware",
    "django.middleware.security.SecurityMiddleware",
    "csp.middleware.CSPMiddleware",
    *(["whitenoise.middleware.WhiteNoiseMiddleware"] if HOSTED else []),
    "django.contrib.sessions.middleware.SessionMiddleware",
    "django.middleware.common.CommonMiddleware",
    "django.middleware.csrf.CsrfViewMiddleware",
    "django.contrib.auth.middleware.AuthenticationMiddleware",
    "rehab.people.sign_in.two_stage_sign_in.SessionValidationMiddleware",
    "django.contrib.messages.middleware.MessageMiddleware",
    "django.middleware.clickjacking.XFrameOptionsMiddleware",
    "rehab.stations.tablets.TabletMiddleware",
    "rehab.people.web.language.LanguageMiddleware",
    "rehab.people.web.language.LocalTimeMiddleware",
    "rehab.people.access.AccessMiddleware",
    "rehab.sessions.pages.server.redirect_to_owner.ClinicServerMiddleware",
    "rehab.people.sign_in.lockout.LockoutMiddleware",
]
ROOT_URLCONF = "garry_site.urls"
ASGI_APPLICATION = "garry_site.asgi.application"
TEMPLATES = [
    {
        "BACKEND": "django.template.backends.django.DjangoTemplates",
        "DIRS": [FILES_DIR / "templates"],
        "APP_DIRS": True,
        "OPTIONS": {
            "context_processors": [
                "django.template.context_processors.request",
                "django.template.context_processors.i18n",
                "django.contrib.auth.context_processors.auth",
                "django.contrib.messages.context_processors.messages",
                "csp.context_processors.nonce",
            ]
        },
    }
]

# --- database and servers -----------------------------------------------------------------------

DATABASE_URL = text(
    "GARRY_DATABASE_URL",
    f"sqlite:///{DATA_DIR / 'garry.sqlite3'}",
    "database; SQLite on one machine, postgres://… when hosted",
)
DATABASES = {"default": parse_database(DATABASE_URL)}
if DATABASES["default"]["ENGINE"].endswith("sqlite3"):
    DATA_DIR.mkdir(parents=True, exist_ok=True)
DEFAULT_AUTO_FIELD = "django.db.models.BigAutoField"

ADDRESS = text(
    "GARRY_ADDRESS", "", "host:port by which the proxy reaches this one of several servers"
)
PRIVATE_RECEIVERS = string_list(
    "GARRY_PRIVATE_RECEIVERS", "", "private networks to which clinics may send webhooks and FHIR"
)
for network in PRIVATE_RECEIVERS:
    try:
        ip_network(network)
    except ValueError:
        raise ImproperlyConfigured(
            f"GARRY_PRIVATE_RECEIVERS={network!r} is no network. Give 10.1.0.0/16 or 127.0.0.1/32."
        ) from None

# --- people -------------------------------------------------------------------------------------

AUTH_USER_MODEL = "rehab.User"
PASSWORD_HASHERS = [
    "rehab.people.sign_in.hashing.PooledArgon2PasswordHasher",
    "django.contrib.auth.hashers.PBKDF2PasswordHasher",
]
AUTH_PASSWORD_VALIDATORS = [
    {"NAME": f"django.contrib.auth.password_validation.{name}Validator", "OPTIONS": options}
    for name, options in (
        ("MinimumLength", {"min_length": 12}),
        ("UserAttributeSimilarity", {}),
        ("CommonPassword", {}),
        ("NumericPassword", {}),
    )
]
AUTHENTICATION_BACKENDS = [
    # First: a lockout ends the sign-in there.
    "rehab.people.sign_in.authentication_backends.CountingBackend",
    "rehab.people.sign_in.authentication_backends.PasswordBackend",
    "rehab.people.sign_in.authentication_backends.CodeBackend",
    "rehab.people.sign_in.authentication_backends.PasskeyBackend",
]
LOGIN_URL = "sign-in"
OIDC_ISSUER = text("GARRY_OIDC_ISSUER", "", "address of the hospital's sign-on (OpenID Connect)")
OIDC_CLIENT_ID = text("GARRY_OIDC_CLIENT_ID", "garry", "GARRY's name at the sign-on")
OIDC_CLIENT_SECRET = text("GARRY_OIDC_CLIENT_SECRET", "", "GARRY's secret at the sign-on")
OIDC_NAME = text("GARRY_OIDC_NAME", "Hospital account", "what the button of the sign-on says")
OIDC_SCOPE = text("GARRY_OIDC_SCOPE", "openid profile", "what the sign-on is asked to tell")
OIDC_GROUPS_CLAIM = text("GARRY_OIDC_GROUPS_CLAIM", "groups", "claim that lists a person's groups")
OIDC_CREATE = flag("GARRY_OIDC_CREATE", False, "make accounts for people whom a group lets in")
OIDC_MFA_ACR = string_list(
    "GARRY_OIDC_MFA_ACR", "", "values of acr by which the sign-on vouches for a second factor"
)
OIDC_ORIGIN = "{0.scheme}://{0.netloc}".format(urlsplit(OIDC_ISSUER))
if OIDC_ISSUER and urlsplit(OIDC_ISSUER).scheme != "https" and HOSTED:
    raise ImproperlyConfigured("GARRY_OIDC_ISSUER must begin with https:// on a hosted server.")
SMART_FHIR = text(
    "GARRY_SMART_FHIR", "", "address of the hospital's FHIR server, whose record may launch GARRY"
).rstrip("/")
SMART_IDENTIFIER = text(
    "GARRY_SMART_IDENTIFIER", "", "system of the patients' identifier there that is the code here"
)
SMART_SCOPE = text(
    "GARRY_SMART_SCOPE",
    "launch openid profile patient/Patient.read",
    "what a launch asks the health record for",
)
if SMART_FHIR and not (OIDC_ISSUER and SMART_IDENTIFIER):
    raise ImproperlyConfigured("GARRY_SMART_FHIR needs GARRY_OIDC_ISSUER, GARRY_SMART_IDENTIFIER.")
if SMART_FHIR and urlsplit(SMART_FHIR).scheme != "https" and HOSTED:
    raise ImproperlyConfigured("GARRY_SMART_FHIR must begin with https:// on a hosted server.")
SESSION_ENGINE = "rehab.people.sign_in.sign_in_expiry"
SESSION_COOKIE_AGE = 12 * 3600  # one working day, whatever the activity
SESSION_COOKIE_SAMESITE = "Lax"
SESSION_MINUTES = number(
    "GARRY_SESSION_MINUTES",
    30 if HOSTED else 12 * 60,
    "minutes after which a sign-in ends that nobody uses",
    low=5,
    high=12 * 60,
)
CLINIC_SESSIONS = number(
    "GARRY_CLINIC_SESSIONS",
    1000,
    "sessions at once that a clinic's share of a server's sockets and requests is for",
    low=1,
    high=10_000,
)
PROXIES = number(
    "GARRY_PROXIES",
    1 if HOSTED else 0,
    "proxies of your own before the server, each of which adds to X-Forwarded-For",
    low=0,
    high=9,
)

# --- languages, time, files ---------------------------------------------------------------------

LANGUAGE_CODE = "en"  # of programs and commands, and of browsers that know none of these
# A language that no native speaker has reviewed says so in its name.
LANGUAGES = [
    ("en", "English"),
    ("es", "Español"),
    ("de", "Deutsch (Entwurf)"),
    ("fr", "Français (ébauche)"),
]
LOCALE_PATHS = [FILES_DIR / "locale"]
FORMAT_MODULE_PATH = "garry_site.formats"
USE_TZ = True
TIME_ZONE = text("GARRY_TIME_ZONE", "UTC", "time zone of dates in admin and reports")
if TIME_ZONE not in available_timezones():
    raise ImproperlyConfigured(
        f"GARRY_TIME_ZONE={TIME_ZONE!r} is no time zone. Give a name such as Europe/Madrid."
    )
STATIC_URL = "static/"
STATIC_ROOT = DATA_DIR / "static"
BROWSER_LIBRARIES = {  # browser libraries come from node_modules and are never committed
    "uplot": FILES_DIR / "node_modules" / "uplot" / "dist",
    "canvas-confetti": FILES_DIR / "node_modules" / "canvas-confetti" / "dist",
    "atkinson": FILES_DIR
    / "node_modules"
    / "@fontsource-variable"
    / "atkinson-hyperlegible-next"
    / "files",
}
STATICFILES_DIRS = [
    FILES_DIR / "static",
    *(
        (name, folder)
        for name, folder in [("docs", FILES_DIR / "docs" / "images")]
        if folder.is_dir()
    ),
    *((name, folder) for name, folder in BROWSER_LIBRARIES.items() if folder.is_dir()),
]
STORAGES = {
    "default": {"BACKEND": "django.core.files.storage.FileSystemStorage"},
    "staticfiles": {
        "BACKEND": "rehab.people.web.static_files.MinifiedStorage"
        if HOSTED
        else "django.contrib.staticfiles.storage.StaticFilesStorage"
    },
}
DATA_UPLOAD_MAX_MEMORY_SIZE = 2 * 1024 * 1024  # the server hangs up on anything longer
# More patients than a leaderboard's form accepts, so that the form can refuse them itself.
DATA_UPLOAD_MAX_NUMBER_FIELDS = 5000
DATA_UPLOAD_MAX_NUMBER_FILES = 0  # no page takes any

# --- browsers -----------------------------------------------------------------------------------

CONTENT_SECURITY_POLICY = {
    "DIRECTIVES": {
        "default-src": [SELF],
        "script-src": [SELF, NONCE],
        "style-src": [SELF],
        "img-src": [SELF, "data:"],
        "connect-src": [SELF],
        "object-src": [NONE],
        "base-uri": [NONE],
        # A sign-out goes on to the hospital's.
        "form-action": [SELF, *([OIDC_ORIGIN] if OIDC_ISSUER else [])],
        "frame-ancestors": [NONE],
    }
}
X_FRAME_OPTIONS = "DENY"
SECURE_REFERRER_POLICY = "same-origin"
if HOSTED:
    SESSION_COOKIE_SECURE = CSRF_COOKIE_SECURE = True
    SECURE_SSL_REDIRECT = True
    SECURE_REDIRECT_EXEMPT = ["^healthz$", "^readyz$", "^metrics$"]  # asked past the proxy
    SECURE_PROXY_SSL_HEADER = ("HTTP_X_FORWARDED_PROTO", "https")
    SECURE_HSTS_SECONDS = 365 * 24 * 3600
    SECURE_HSTS_INCLUDE_SUBDOMAINS = True
    SECURE_HSTS_PRELOAD = True
CSRF_TRUSTED_ORIGINS = [f"https://{host}" for host in ALLOWED_HOSTS if HOSTED and host != "*"]

# --- logs ---------------------------------------------------------------------------------------

METRICS_TOKEN = text(
    "GARRY_METRICS_TOKEN", "", "what Prometheus shows at /metrics; without it nobody sees figures"
)
LOG_FORMAT = text("GARRY_LOG_FORMAT", "line", "how a line of the log looks: line or json").lower()
if LOG_FORMAT not in {"line", "json"}:
    raise ImproperlyConfigured("GARRY_LOG_FORMAT must be line or json.")
LOG_LEVEL = text(
    "GARRY_LOG_LEVEL", "INFO", "how much is logged: DEBUG, INFO, WARNING, ERROR"
).upper()
if LOG_LEVEL not in {"DEBUG", "INFO", "WARNING", "ERROR"}:
    raise ImproperlyConfigured("GARRY_LOG_LEVEL must be DEBUG, INFO, WARNING or ERROR.")
LOGGING = {
    "version": 1,
    "disable_existing_loggers": False,
    "formatters": {
        "line": {
            "()": "garry_site.logs.LineFormatter",
            "format": "%(asctime)s %(levelname)s %(name)s: %(message)s",
        },
        "json": {"()": "garry_site.logs.JsonFormatter"},
    },
    "filters": {"refusals": {"()": "garry_site.logs.RefusalFilter"}},
    "handlers": {
        "stderr": {
            "class": "logging.StreamHandler",
            "formatter": LOG_FORMAT,
            "filters": ["refusals"],
        }
    },
    "root": {"handlers": ["stderr"], "level": "WARNING"},
    "loggers": {
        "rehab": {"level": LOG_LEVEL},
        "django.request": {"level": "ERROR"},  # no line for each 404
    },
}
