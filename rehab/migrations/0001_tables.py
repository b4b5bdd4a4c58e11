"""All tables with their constraints. Triggers are made by people.audit.guards."""

from typing import Any

import django.contrib.auth.validators
import django.core.serializers.json
import django.core.validators
import django.db.models.deletion
import django.db.models.manager
import django.utils.timezone
from django.conf import settings
from django.db import migrations, models

import rehab.boards.cache_invalidation
import rehab.feedback.translation
import rehab.outbox.models
import rehab.people.audit.history
import rehab.people.models.accounts
import rehab.people.models.clinics
import rehab.people.models.patients
import rehab.people.networks
import rehab.people.sign_in.tokens

# Leases of the servers on a hosted database (rehab/sessions/live/database/server_lease.py). No model: the
# rows are no clinic's, are read and written by the database's clock alone, and belong in no backup.
# SQLite has one server, which needs none.
LEASES = """
CREATE TABLE rehab_server (
    id varchar(32) PRIMARY KEY,
    address varchar(200) NOT NULL,
    ready boolean NOT NULL,
    expires_at timestamp with time zone NOT NULL
)
"""


def create_leases(apps: Any, schema_editor: Any) -> None:
    """Make the table of leases, on PostgreSQL."""
    if schema_editor.connection.vendor == "postgresql":
        schema_editor.execute(LEASES)


def drop_leases(apps: Any, schema_editor: Any) -> None:
    """Drop the table of leases."""
    if schema_editor.connection.vendor == "postgresql":
        schema_editor.execute("DROP TABLE rehab_server")


class Migration(migrations.Migration):
    initial = True

    dependencies = [
        ("auth", "0012_alter_user_first_name_max_length"),
    ]

    operations = [
        migrations.CreateModel(
            name="Chore",
            fields=[
                ("name", models.CharField(max_length=32, primary_key=True, serialize=False)),
                ("succeeded_at", models.DateTimeField(null=True)),
                ("failed_at", models.DateTimeField(null=True)),
                ("said", models.TextField(blank=True)),
            ],
            options={
                "ordering": ["name"],
            },
        ),
        migrations.CreateModel(
            name="Clinic",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("name", models.CharField(max_length=100, unique=True, verbose_name="name")),
                (
                    "time_zone",
                    models.CharField(
                        default="UTC",
                        max_length=64,
                        validators=[rehab.people.models.clinics.validate_time_zone],
                        verbose_name="time zone",
                    ),
                ),
                (
                    "language",
                    models.CharField(
                        choices=rehab.people.models.clinics.language_choices,
                        default="en",
                        max_length=8,
                        verbose_name="language",
                    ),
                ),
                (
                    "boards_across",
                    models.BooleanField(
                        default=False,
                        help_text="Patients who agree may stand, by their animal names, on boards with patients of other clinics.",
                        verbose_name="boards across clinics",
                    ),
                ),
                (
                    "second_factor_required",
                    models.BooleanField(
                        default=False,
                        help_text="Everybody who works here signs in with an app or a passkey besides the password. Whoever has none is led to set one up first; you as well.",
                        verbose_name="second factor required",
                    ),
                ),
                (
                    "research_needs_consent",
                    models.BooleanField(
                        default=True,
                        help_text="Researchers see the sessions of those patients only who have agreed to research.",
                        verbose_name="research needs consent",
                    ),
                ),
                (
                    "care_needs_consent",
                    models.BooleanField(
                        default=False,
                        help_text="No session can be set up for a patient who has not agreed to care.",
                        verbose_name="care needs consent",
                    ),
                ),
                (
                    "note_template",
                    models.TextField(
                        blank=True,
                        help_text="What a session’s page offers to copy into your own record, with places such as {day}, {walked}, {hits}, {conditions}, {noted}, {tests}, {note}. Empty: GARRY’s text.",
                        max_length=2000,
                        validators=[rehab.people.models.clinics.validate_note_template],
                        verbose_name="text of a session",
                    ),
                ),
                (
                    "networks",
                    models.TextField(
                        blank=True,
                        help_text="One a line, such as 192.168.1.0/24. From elsewhere a session is watched only with the patient's consent to remote view; say so in your words. Empty: from anywhere, and nobody is asked.",
                        max_length=1000,
                        validators=[rehab.people.networks.validate_networks],
                        verbose_name="the clinic's own networks",
                    ),
                ),
                (
                    "retention_months",
                    models.PositiveSmallIntegerField(
                        blank=True,
                        help_text="So long after the last session a patient's name, code and all that leads to the person are erased for good. Empty: never.",
                        null=True,
                        validators=[
                            django.core.validators.MinValueValidator(1),
                            django.core.validators.MaxValueValidator(1200),
                        ],
                        verbose_name="keep patients (months)",
                    ),
                ),
                (
                    "log_retention_months",
                    models.PositiveSmallIntegerField(
                        default=36,
                        help_text="How long it is kept who looked at, changed and took out what.",
                        validators=[
                            django.core.validators.MinValueValidator(12),
                            django.core.validators.MaxValueValidator(1200),
                        ],
                        verbose_name="keep the logs (months)",
                    ),
                ),
                ("created_at", models.DateTimeField(auto_now_add=True, verbose_name="created at")),
                ("removing_at", models.DateTimeField(editable=False, null=True)),
            ],
            options={
                "verbose_name": "clinic",
                "verbose_name_plural": "clinics",
                "ordering": ["name"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="User",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("password", models.CharField(max_length=128, verbose_name="password")),
                (
                    "last_login",
                    models.DateTimeField(blank=True, null=True, verbose_name="last login"),
                ),
                (
                    "is_superuser",
                    models.BooleanField(
                        default=False,
                        help_text="Designates that this user has all permissions without explicitly assigning them.",
                        verbose_name="superuser status",
                    ),
                ),
                (
                    "username",
                    models.CharField(
                        error_messages={"unique": "A user with that username already exists."},
                        help_text="Required. 150 characters or fewer. Letters, digits and @/./+/-/_ only.",
                        max_length=150,
                        unique=True,
                        validators=[django.contrib.auth.validators.UnicodeUsernameValidator()],
                        verbose_name="username",
                    ),
                ),
                (
                    "first_name",
                    models.CharField(blank=True, max_length=150, verbose_name="first name"),
                ),
                (
                    "last_name",
                    models.CharField(blank=True, max_length=150, verbose_name="last name"),
                ),
                (
                    "email",
                    models.EmailField(blank=True, max_length=254, verbose_name="email address"),
                ),
                (
                    "is_staff",
                    models.BooleanField(
                        default=False,
                        help_text="Designates whether the user can log into this admin site.",
                        verbose_name="staff status",
                    ),
                ),
                (
                    "is_active",
                    models.BooleanField(
                        default=True,
                        help_text="Designates whether this user should be treated as active. Unselect this instead of deleting accounts.",
                        verbose_name="active",
                    ),
                ),
                (
                    "date_joined",
                    models.DateTimeField(
                        default=django.utils.timezone.now, verbose_name="date joined"
                    ),
                ),
                (
                    "role",
                    models.CharField(
                        choices=[
                            ("host", "Host"),
                            ("lead", "Clinic lead"),
                            ("pt", "Physical therapist"),
                            ("researcher", "Researcher"),
                            ("sponsor", "Sponsor of studies"),
                        ],
                        max_length=16,
                        verbose_name="role",
                    ),
                ),
                (
                    "language",
                    models.CharField(
                        blank=True,
                        choices=rehab.people.models.clinics.language_choices,
                        help_text="Of the pages that this account opens; empty: the clinic's.",
                        max_length=8,
                        verbose_name="language",
                    ),
                ),
                (
                    "subject",
                    models.CharField(editable=False, max_length=255, null=True, unique=True),
                ),
                (
                    "is_service",
                    models.BooleanField(
                        default=False,
                        help_text="For a program, not a person: any lead can create its tokens.",
                        verbose_name="service account",
                    ),
                ),
                ("sign_in_generation", models.PositiveIntegerField(default=0, editable=False)),
                (
                    "groups",
                    models.ManyToManyField(
                        blank=True,
                        help_text="The groups this user belongs to. A user will get all permissions granted to each of their groups.",
                        related_name="user_set",
                        related_query_name="user",
                        to="auth.group",
                        verbose_name="groups",
                    ),
                ),
                (
                    "user_permissions",
                    models.ManyToManyField(
                        blank=True,
                        help_text="Specific permissions for this user.",
                        related_name="user_set",
                        related_query_name="user",
                        to="auth.permission",
                        verbose_name="user permissions",
                    ),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        blank=True,
                        null=True,
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="users",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "user",
                "verbose_name_plural": "users",
                "ordering": ["username"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", rehab.people.models.accounts.ServerUserManager()),
            ],
        ),
        migrations.CreateModel(
            name="Authenticator",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "kind",
                    models.CharField(
                        choices=[("app", "Authenticator app"), ("passkey", "Passkey")], max_length=8
                    ),
                ),
                ("name", models.CharField(max_length=64)),
                ("credential", models.TextField()),
                ("counter", models.BigIntegerField(default=0)),
                ("created_at", models.DateTimeField(auto_now_add=True)),
                ("last_used_at", models.DateTimeField(blank=True, null=True)),
                (
                    "user",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="authenticators",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
            ],
            options={
                "ordering": ["created_at", "pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="ApiToken",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("token_hash", models.CharField(editable=False, max_length=64, unique=True)),
                ("created_at", models.DateTimeField(auto_now_add=True, verbose_name="created at")),
                (
                    "last_seen_at",
                    models.DateTimeField(
                        blank=True, editable=False, null=True, verbose_name="last seen at"
                    ),
                ),
                (
                    "revoked_at",
                    models.DateTimeField(
                        blank=True, editable=False, null=True, verbose_name="revoked at"
                    ),
                ),
                (
                    "name",
                    models.CharField(
                        help_text="What the token is for.", max_length=64, verbose_name="name"
                    ),
                ),
                (
                    "role",
                    models.CharField(
                        choices=[
                            ("lead", "Clinic lead"),
                            ("pt", "Physical therapist"),
                            ("researcher", "Researcher"),
                        ],
                        help_text="The account's own role, or one that sees less: a researcher's token never reads a nickname or code.",
                        max_length=16,
                        verbose_name="role",
                    ),
                ),
                (
                    "may_read",
                    models.BooleanField(
                        default=True, verbose_name="Read patients, sessions and boards"
                    ),
                ),
                (
                    "may_steer",
                    models.BooleanField(
                        default=False,
                        verbose_name="Add patients and sessions, change and steer them",
                    ),
                ),
                (
                    "may_export",
                    models.BooleanField(
                        default=False, verbose_name="Take out the steps of sessions"
                    ),
                ),
                (
                    "expires_at",
                    models.DateTimeField(
                        default=rehab.people.sign_in.tokens.default_expiry,
                        help_text="A year from now at the latest. Renewed, it is valid as long again.",
                        verbose_name="valid until",
                    ),
                ),
                (
                    "user",
                    models.ForeignKey(
                        help_text="What the program does is noted as done by this account.",
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="api_tokens",
                        to=settings.AUTH_USER_MODEL,
                        verbose_name="account",
                    ),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="api_tokens",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "API token",
                "verbose_name_plural": "API tokens",
                "ordering": ["name"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="ClinicMove",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("number", models.PositiveIntegerField()),
                ("file", models.CharField(max_length=64)),
                ("exported_at", models.DateTimeField()),
                ("at", models.DateTimeField()),
                ("finished_at", models.DateTimeField(null=True)),
                ("shifts", models.JSONField()),
                ("shared", models.JSONField(default=dict)),
                ("renamed", models.JSONField(default=dict)),
                ("digests", models.JSONField()),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="moves",
                        to="rehab.clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "move of a clinic",
                "ordering": ["clinic", "number"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="ComposedGesture",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "name",
                    models.SlugField(
                        help_text="Letters, digits and hyphens: slow-wave.",
                        max_length=32,
                        verbose_name="name",
                    ),
                ),
                (
                    "lights",
                    models.TextField(
                        blank=True,
                        help_text="A line each: second, first and second light (off, green, orange): 0.5 green off. The robot moves from 0.5 s on. Empty: one orange light.",
                        verbose_name="lights",
                    ),
                ),
                (
                    "notes",
                    models.TextField(
                        blank=True,
                        help_text="A line each: second, pitch in Hz and duration in s, or one of the robot's melodies: 0.5 440 0.2, or 1 button. Nothing sounds where the robot is gentle. With both empty: one note.",
                        verbose_name="notes",
                    ),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="gestures",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "gesture",
                "verbose_name_plural": "gestures",
                "ordering": ["name"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="ConsentText",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("version", models.PositiveSmallIntegerField(verbose_name="version")),
                ("text", models.TextField(max_length=10000, verbose_name="words")),
                (
                    "written_at",
                    models.DateTimeField(
                        default=django.utils.timezone.now, verbose_name="written at"
                    ),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="consent_texts",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
                (
                    "written_by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                        verbose_name="written by",
                    ),
                ),
            ],
            options={
                "ordering": ["-version"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Device",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("token_hash", models.CharField(editable=False, max_length=64, unique=True)),
                ("created_at", models.DateTimeField(auto_now_add=True, verbose_name="created at")),
                (
                    "last_seen_at",
                    models.DateTimeField(
                        blank=True, editable=False, null=True, verbose_name="last seen at"
                    ),
                ),
                (
                    "revoked_at",
                    models.DateTimeField(
                        blank=True, editable=False, null=True, verbose_name="revoked at"
                    ),
                ),
                (
                    "kind",
                    models.CharField(
                        choices=[
                            ("source", "Sensor"),
                            ("tablet", "Tablet"),
                            ("robot", "Robot"),
                        ],
                        max_length=16,
                        verbose_name="kind",
                    ),
                ),
                ("name", models.CharField(max_length=64, verbose_name="name")),
                (
                    "builtin",
                    models.BooleanField(
                        default=False,
                        editable=False,
                        help_text="The server runs it itself.",
                        verbose_name="built in",
                    ),
                ),
                (
                    "side",
                    models.CharField(blank=True, editable=False, max_length=8, verbose_name="leg"),
                ),
                (
                    "place",
                    models.CharField(
                        blank=True, editable=False, max_length=8, verbose_name="place"
                    ),
                ),
                (
                    "successor_hash",
                    models.CharField(blank=True, db_index=True, editable=False, max_length=64),
                ),
                (
                    "retired_hash",
                    models.CharField(blank=True, db_index=True, editable=False, max_length=64),
                ),
                (
                    "rotated_at",
                    models.DateTimeField(
                        editable=False, null=True, verbose_name="token changed by itself"
                    ),
                ),
                (
                    "token_expires_at",
                    models.DateTimeField(editable=False, null=True, verbose_name="valid until"),
                ),
                (
                    "copy_seen_at",
                    models.DateTimeField(editable=False, null=True, verbose_name="old token seen"),
                ),
                (
                    "approved_at",
                    models.DateTimeField(editable=False, null=True, verbose_name="let in at"),
                ),
                (
                    "network",
                    models.CharField(
                        blank=True, editable=False, max_length=45, verbose_name="network"
                    ),
                ),
                (
                    "browser",
                    models.CharField(
                        blank=True, editable=False, max_length=32, verbose_name="browser"
                    ),
                ),
                (
                    "screen_px_per_mm",
                    models.FloatField(
                        editable=False, null=True, verbose_name="pixels a millimeter"
                    ),
                ),
                (
                    "screen_distance_m",
                    models.FloatField(default=1.5, editable=False, verbose_name="viewing distance"),
                ),
                (
                    "approver",
                    models.ForeignKey(
                        editable=False,
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                        verbose_name="let in by",
                    ),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="devices",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "device",
                "verbose_name_plural": "devices",
                "ordering": ["station", "kind", "name"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Endpoint",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("name", models.CharField(max_length=64, verbose_name="name")),
                (
                    "kind",
                    models.CharField(
                        choices=[
                            ("webhook", "Webhook (Standard Webhooks)"),
                            ("fhir", "FHIR R4 server: sessions"),
                        ],
                        default="webhook",
                        max_length=8,
                        verbose_name="kind",
                    ),
                ),
                (
                    "url",
                    models.CharField(
                        help_text="https://…; addresses within a network only where the host allows them.",
                        max_length=400,
                        verbose_name="address",
                    ),
                ),
                (
                    "wants_sessions",
                    models.BooleanField(default=True, verbose_name="a session ended"),
                ),
                ("wants_falls", models.BooleanField(default=True, verbose_name="a patient fell")),
                (
                    "wants_incidents",
                    models.BooleanField(default=True, verbose_name="a robot stopped by itself"),
                ),
                (
                    "wants_backups",
                    models.BooleanField(default=True, verbose_name="a backup failed"),
                ),
                (
                    "wants_exports",
                    models.BooleanField(default=True, verbose_name="an export is ready"),
                ),
                ("active", models.BooleanField(default=True, verbose_name="active")),
                ("secret", models.TextField(editable=False)),
                ("created_at", models.DateTimeField(auto_now_add=True, verbose_name="created at")),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="endpoints",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "receiver",
                "verbose_name_plural": "receivers",
                "ordering": ["name"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Enrollment",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("code", models.CharField(max_length=24, verbose_name="code")),
                ("levels", models.JSONField(default=list)),
                (
                    "keep_data",
                    models.BooleanField(
                        help_text="As the patient agreed. Else sessions are left out of the study's results.",
                        verbose_name="data may be kept after a withdrawal",
                    ),
                ),
                (
                    "consent_version",
                    models.CharField(
                        blank=True, max_length=40, verbose_name="version of the consent"
                    ),
                ),
                ("consented_on", models.DateField(null=True, verbose_name="consented on")),
                (
                    "enrolled_at",
                    models.DateTimeField(
                        default=django.utils.timezone.now, verbose_name="enrolled"
                    ),
                ),
                ("withdrawn_at", models.DateTimeField(null=True, verbose_name="withdrawn")),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="+",
                        to="rehab.clinic",
                    ),
                ),
                (
                    "enrolled_by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
            ],
            options={
                "verbose_name": "participant",
                "ordering": ["study", "pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Allocation",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("salt", models.CharField(blank=True, editable=False, max_length=32)),
                ("digest", models.CharField(default="", editable=False, max_length=64)),
                ("erased", models.BooleanField(default=False, editable=False)),
                ("group", models.CharField(max_length=64)),
                ("at", models.DateTimeField(default=django.utils.timezone.now)),
                (
                    "enrollment",
                    models.OneToOneField(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="allocation",
                        to="rehab.enrollment",
                    ),
                ),
            ],
            options={
                "verbose_name": "allocation",
                "ordering": ["pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="FeedbackType",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "slug",
                    models.CharField(
                        choices=rehab.feedback.translation.valence_choices,
                        max_length=16,
                        verbose_name="feedback type",
                    ),
                ),
                (
                    "hit_points",
                    models.SmallIntegerField(
                        blank=True,
                        help_text="For a step at or above the goal, 1 to 1000.",
                        null=True,
                        verbose_name="points at the goal",
                    ),
                ),
                (
                    "miss_points",
                    models.SmallIntegerField(
                        blank=True,
                        help_text="For a step below the goal, −1 to −1000.",
                        null=True,
                        verbose_name="points below the goal",
                    ),
                ),
                (
                    "cue_above",
                    models.CharField(
                        blank=True, max_length=32, verbose_name="robot, after five strong seconds"
                    ),
                ),
                (
                    "cue_below",
                    models.CharField(
                        blank=True, max_length=32, verbose_name="robot, after five weak seconds"
                    ),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="feedback_types",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "feedback type",
                "verbose_name_plural": "feedback types",
                "ordering": ["pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="FeedbackBand",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "from_percent",
                    models.PositiveSmallIntegerField(
                        validators=[django.core.validators.MaxValueValidator(1000)],
                        verbose_name="from, % of the goal",
                    ),
                ),
                ("words", models.JSONField(blank=True, default=dict, verbose_name="words")),
                (
                    "confetti",
                    models.CharField(
                        choices=[
                            ("none", "none"),
                            ("little", "a little"),
                            ("much", "much"),
                            ("most", "the most"),
                        ],
                        default="none",
                        max_length=8,
                        verbose_name="confetti",
                    ),
                ),
                (
                    "feedback_type",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="bands",
                        to="rehab.feedbacktype",
                        verbose_name="feedback type",
                    ),
                ),
            ],
            options={
                "verbose_name": "band",
                "verbose_name_plural": "bands",
                "ordering": ["feedback_type", "from_percent"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="GestureStep",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "position",
                    models.PositiveSmallIntegerField(
                        help_text="Empty: after the row above.", verbose_name="number"
                    ),
                ),
                (
                    "turn_deg",
                    models.FloatField(
                        default=0.0,
                        help_text="First; to the left above 0.",
                        verbose_name="turn (°)",
                    ),
                ),
                (
                    "forward_m",
                    models.FloatField(
                        default=0.0, help_text="Then; back below 0.", verbose_name="forward (m)"
                    ),
                ),
                (
                    "hold_s",
                    models.FloatField(
                        default=0.0, help_text="At the end.", verbose_name="pause (s)"
                    ),
                ),
                (
                    "pace",
                    models.FloatField(
                        default=1.0,
                        help_text="Share of the full speed, 0.2 to 1.",
                        verbose_name="pace",
                    ),
                ),
                (
                    "within_s",
                    models.FloatField(
                        blank=True,
                        help_text="It stops if it takes longer. Empty: as usual.",
                        null=True,
                        verbose_name="time (s)",
                    ),
                ),
                (
                    "gesture",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="steps",
                        to="rehab.composedgesture",
                        verbose_name="gesture",
                    ),
                ),
            ],
            options={
                "verbose_name": "step",
                "verbose_name_plural": "steps",
                "ordering": ["gesture", "position"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="HistoryEntry",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("salt", models.CharField(blank=True, editable=False, max_length=32)),
                ("digest", models.CharField(default="", editable=False, max_length=64)),
                ("erased", models.BooleanField(default=False, editable=False)),
                (
                    "model_name",
                    models.CharField(
                        choices=rehab.people.audit.history.model_choices,
                        max_length=32,
                        verbose_name="what",
                    ),
                ),
                ("object_id", models.BigIntegerField(verbose_name="number")),
                (
                    "kind",
                    models.CharField(
                        choices=[
                            ("added", "Added"),
                            ("changed", "Changed"),
                            ("deleted", "Deleted"),
                        ],
                        max_length=8,
                        verbose_name="kind",
                    ),
                ),
                (
                    "changes",
                    models.JSONField(
                        default=dict,
                        encoder=django.core.serializers.json.DjangoJSONEncoder,
                        verbose_name="values",
                    ),
                ),
                (
                    "through",
                    models.CharField(
                        blank=True,
                        help_text="The program or tablet that did it.",
                        max_length=64,
                        verbose_name="by which program or device",
                    ),
                ),
                (
                    "at",
                    models.DateTimeField(
                        db_index=True, default=django.utils.timezone.now, verbose_name="at"
                    ),
                ),
                (
                    "by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                        verbose_name="by",
                    ),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="+",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "change",
                "verbose_name_plural": "changes",
                "ordering": ["-at", "-pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="ImportTombstone",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("id_hash", models.CharField(max_length=64)),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="+",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Leaderboard",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("name", models.CharField(max_length=32, verbose_name="name on the tablet")),
                ("active", models.BooleanField(default=True, verbose_name="active")),
                (
                    "among",
                    models.CharField(
                        choices=[
                            ("self", "The patient's own sessions"),
                            ("group", "A group of patients"),
                            ("clinic", "All patients of the clinic"),
                            ("across", "Patients of several clinics"),
                        ],
                        default="self",
                        max_length=16,
                        verbose_name="compare with",
                    ),
                ),
                (
                    "metric",
                    models.CharField(
                        choices=[
                            ("hit_rate", "Steps at the goal (%)"),
                            ("score", "Score"),
                            ("mean_performance", "Mean step, in % of the own goal"),
                            ("best_streak", "Best streak"),
                            ("points_per_100_steps", "Points per 100 steps"),
                            ("improvement_over_baseline", "Improvement over the own baseline (%)"),
                            ("retention_in_washout", "Improvement kept in the washout (%)"),
                            ("steps", "Steps"),
                            ("active_minutes", "Minutes walked"),
                            ("attended", "Sessions attended"),
                            ("target_met", "Days on which the target was met"),
                        ],
                        default="hit_rate",
                        max_length=32,
                        verbose_name="measure",
                    ),
                ),
                (
                    "higher_is_better",
                    models.BooleanField(default=True, verbose_name="higher is better"),
                ),
                (
                    "aggregation",
                    models.CharField(
                        choices=[
                            ("each", "Each session"),
                            ("best", "Best session"),
                            ("latest", "Latest session"),
                            ("mean", "Mean of the last sessions"),
                            ("sum", "Sum over the period"),
                        ],
                        default="each",
                        max_length=16,
                        verbose_name="a row is",
                    ),
                ),
                (
                    "mean_of",
                    models.PositiveSmallIntegerField(
                        default=3,
                        validators=[django.core.validators.MinValueValidator(1)],
                        verbose_name="sessions in the mean",
                    ),
                ),
                (
                    "types",
                    models.CharField(
                        choices=[
                            ("same", "The type just walked"),
                            ("chosen", "Chosen types"),
                            ("all", "All types"),
                        ],
                        default="same",
                        max_length=16,
                        verbose_name="feedback types",
                    ),
                ),
                (
                    "valences",
                    models.JSONField(blank=True, default=list, verbose_name="which types"),
                ),
                (
                    "min_valid_strides",
                    models.PositiveIntegerField(
                        default=100,
                        help_text="A session counts if it has at least so many valid steps with feedback.",
                        verbose_name="minimum steps",
                    ),
                ),
                (
                    "min_minutes",
                    models.PositiveSmallIntegerField(
                        blank=True,
                        help_text="A session with fewer steps counts as well if it was walked so long.",
                        null=True,
                        verbose_name="or minimum minutes",
                    ),
                ),
                (
                    "include_simulated",
                    models.BooleanField(default=False, verbose_name="simulated sessions too"),
                ),
                (
                    "period",
                    models.CharField(
                        choices=[
                            ("all", "All time"),
                            ("days_30", "Last 30 days"),
                            ("week", "This week"),
                            ("month", "This month"),
                            ("dates", "Between two dates"),
                        ],
                        default="days_30",
                        max_length=16,
                        verbose_name="period",
                    ),
                ),
                ("period_from", models.DateField(blank=True, null=True, verbose_name="from")),
                ("period_to", models.DateField(blank=True, null=True, verbose_name="to")),
                (
                    "frozen_on",
                    models.DateField(
                        blank=True,
                        help_text="For a report: the board stays as it was at the end of this day. No patient is added afterwards; patients who leave the boards are removed from it, too.",
                        null=True,
                        verbose_name="frozen on",
                    ),
                ),
                (
                    "display",
                    models.CharField(
                        choices=[
                            ("neighbors", "You and two on each side"),
                            ("top", "The best"),
                            ("top_and_me", "The best, and you"),
                            ("total", "One total, reached together"),
                        ],
                        default="neighbors",
                        max_length=16,
                        verbose_name="rows",
                    ),
                ),
                (
                    "top_n",
                    models.PositiveSmallIntegerField(
                        default=10,
                        validators=[
                            django.core.validators.MinValueValidator(1),
                            django.core.validators.MaxValueValidator(50),
                        ],
                        verbose_name="how many of the best",
                    ),
                ),
                (
                    "total_goal",
                    models.PositiveIntegerField(
                        blank=True,
                        help_text="Draws a bar that fills up to it.",
                        null=True,
                        validators=[django.core.validators.MinValueValidator(1)],
                        verbose_name="goal of the total",
                    ),
                ),
                ("show_ranks", models.BooleanField(default=True, verbose_name="show places")),
                (
                    "ties",
                    models.CharField(
                        choices=[
                            ("standard", "1, 2, 2, 4"),
                            ("dense", "1, 2, 2, 3"),
                            ("earlier", "1, 2, 3, 4: the earlier first"),
                        ],
                        default="standard",
                        max_length=16,
                        verbose_name="equal figures",
                    ),
                ),
                (
                    "tie_breaker",
                    models.CharField(
                        blank=True,
                        choices=[
                            ("hit_rate", "Steps at the goal (%)"),
                            ("score", "Score"),
                            ("mean_performance", "Mean step, in % of the own goal"),
                            ("best_streak", "Best streak"),
                            ("points_per_100_steps", "Points per 100 steps"),
                            ("improvement_over_baseline", "Improvement over the own baseline (%)"),
                            ("retention_in_washout", "Improvement kept in the washout (%)"),
                            ("steps", "Steps"),
                            ("active_minutes", "Minutes walked"),
                            ("attended", "Sessions attended"),
                            ("target_met", "Days on which the target was met"),
                        ],
                        help_text="Whoever has more of this comes first; after that, whoever was earlier.",
                        max_length=32,
                        verbose_name="of equal figures, first",
                    ),
                ),
                (
                    "names",
                    models.CharField(
                        choices=[
                            ("pseudonym", "Animal names"),
                            ("initials", "Initials"),
                            ("code", "Codes"),
                        ],
                        default="pseudonym",
                        max_length=16,
                        verbose_name="names",
                    ),
                ),
                (
                    "min_participants",
                    models.PositiveSmallIntegerField(
                        default=5,
                        help_text="With fewer, everyone sees the own sessions only.",
                        validators=[django.core.validators.MinValueValidator(5)],
                        verbose_name="minimum patients",
                    ),
                ),
                (
                    "occasion",
                    models.CharField(
                        choices=[
                            ("after_session", "After a session"),
                            ("waiting", "While the tablet waits"),
                            ("pt_only", "Only here, for therapists"),
                        ],
                        default="after_session",
                        max_length=16,
                        verbose_name="shown",
                    ),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        blank=True,
                        null=True,
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="leaderboards",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "leaderboard",
                "verbose_name_plural": "leaderboards",
                "ordering": ["name"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="BoardSnapshot",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("definition", models.TextField()),
                ("results", models.JSONField()),
                (
                    "version",
                    models.BigIntegerField(default=rehab.boards.cache_invalidation.draw_token),
                ),
                (
                    "board",
                    models.OneToOneField(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="snapshot",
                        to="rehab.leaderboard",
                    ),
                ),
            ],
            options={
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="LogSeal",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("log", models.CharField(max_length=16)),
                ("number", models.PositiveIntegerField()),
                ("moves", models.PositiveIntegerField(default=0)),
                ("first_id", models.BigIntegerField()),
                ("last_id", models.BigIntegerField()),
                ("last_at", models.DateTimeField()),
                ("previous", models.CharField(blank=True, max_length=64)),
                ("digest", models.CharField(max_length=64)),
                ("sealed_at", models.DateTimeField(default=django.utils.timezone.now)),
                ("cut_at", models.DateTimeField(null=True)),
                (
                    "clinic",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="+",
                        to="rehab.clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "seal of a log",
                "ordering": ["log", "clinic", "number"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="MeasureDefinition",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("slug", models.SlugField(max_length=32, verbose_name="slug")),
                ("name", models.CharField(max_length=64, verbose_name="name")),
                ("unit", models.CharField(max_length=16, verbose_name="unit")),
                (
                    "higher_is_better",
                    models.BooleanField(default=True, verbose_name="higher is better"),
                ),
                (
                    "value_min",
                    models.FloatField(
                        help_text="Smallest value that can be real.", verbose_name="value min"
                    ),
                ),
                (
                    "value_max",
                    models.FloatField(
                        help_text="Largest value that can be real.", verbose_name="value max"
                    ),
                ),
                (
                    "goal_min",
                    models.FloatField(help_text="A goal lies above this.", verbose_name="goal min"),
                ),
                (
                    "goal_max",
                    models.FloatField(
                        help_text="A goal lies at or below this.", verbose_name="goal max"
                    ),
                ),
                (
                    "first_goal",
                    models.FloatField(
                        blank=True,
                        help_text="Offered where a patient has no goal yet; the middle where left empty.",
                        null=True,
                        verbose_name="first goal",
                    ),
                ),
                (
                    "channel",
                    models.CharField(
                        blank=True,
                        help_text="Name of the extra value in the source's steps that holds it. Left empty, it is the value of the step itself.",
                        max_length=64,
                        validators=[
                            django.core.validators.RegexValidator(
                                "^[A-Za-z0-9_.:-]{1,64}\\Z",
                                "Only letters, digits and . _ : - as sources send it.",
                            )
                        ],
                        verbose_name="channel",
                    ),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        blank=True,
                        null=True,
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="measures",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "measure",
                "verbose_name_plural": "measures",
                "ordering": ["name"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="OutboxMessage",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "key",
                    models.CharField(
                        default=rehab.outbox.models.new_key,
                        max_length=64,
                        unique=True,
                        verbose_name="number",
                    ),
                ),
                (
                    "topic",
                    models.CharField(
                        choices=[
                            ("session.ended", "a session ended"),
                            ("patient.fall", "a patient fell"),
                            ("robot.incident", "a robot stopped by itself"),
                            ("backup.failed", "a backup failed"),
                            ("export.ready", "an export is ready"),
                        ],
                        max_length=32,
                        verbose_name="what",
                    ),
                ),
                ("body", models.JSONField(verbose_name="content")),
                ("at", models.DateTimeField(verbose_name="at")),
                ("due_at", models.DateTimeField(verbose_name="next attempt")),
                ("attempts", models.PositiveSmallIntegerField(default=0, verbose_name="attempts")),
                (
                    "state",
                    models.CharField(
                        choices=[
                            ("waiting", "waiting"),
                            ("delivered", "delivered"),
                            ("refused", "refused"),
                        ],
                        default="waiting",
                        max_length=16,
                        verbose_name="state",
                    ),
                ),
                (
                    "answer",
                    models.CharField(blank=True, max_length=500, verbose_name="last answer"),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="+",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
                (
                    "endpoint",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="messages",
                        to="rehab.endpoint",
                        verbose_name="receiver",
                    ),
                ),
            ],
            options={
                "verbose_name": "message to a receiver",
                "verbose_name_plural": "messages to receivers",
                "ordering": ["-at", "-pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Pairing",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("code", models.CharField(max_length=8, unique=True)),
                ("secret_hash", models.CharField(max_length=64, unique=True)),
                ("expires_at", models.DateTimeField()),
                ("address", models.CharField(blank=True, max_length=45)),
                ("browser", models.CharField(blank=True, max_length=32)),
                (
                    "device",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="+",
                        to="rehab.device",
                    ),
                ),
            ],
            options={
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Patient",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "code",
                    models.CharField(
                        help_text="The clinic's own number for this patient, never a name.",
                        max_length=32,
                        verbose_name="code",
                    ),
                ),
                (
                    "nickname",
                    models.CharField(
                        help_text="Shown on the screens, so that patient and therapist can check.",
                        max_length=32,
                        verbose_name="nickname",
                    ),
                ),
                (
                    "pseudonym",
                    models.CharField(
                        default=rehab.people.models.patients.generate_pseudonym,
                        editable=False,
                        max_length=16,
                        unique=True,
                        verbose_name="pseudonym",
                    ),
                ),
                (
                    "own_goal",
                    models.CharField(
                        blank=True,
                        default="",
                        help_text="“Walk to the bakery”. The patient reads it at the start and at the end.",
                        max_length=80,
                        verbose_name="goal in the patient’s words",
                    ),
                ),
                (
                    "body_mass_kg",
                    models.FloatField(
                        blank=True,
                        help_text="Needed when sensors send raw signals: A2 is power per kilogram.",
                        null=True,
                        validators=[
                            django.core.validators.MinValueValidator(10),
                            django.core.validators.MaxValueValidator(300),
                        ],
                        verbose_name="body mass (kg)",
                    ),
                ),
                (
                    "paretic_side",
                    models.CharField(
                        blank=True,
                        choices=[("left", "Left"), ("right", "Right")],
                        max_length=8,
                        verbose_name="paretic side",
                    ),
                ),
                (
                    "birth_year",
                    models.PositiveSmallIntegerField(
                        blank=True,
                        help_text="Researchers see only the decade of age.",
                        null=True,
                        validators=[
                            django.core.validators.MinValueValidator(1900),
                            django.core.validators.MaxValueValidator(2100),
                        ],
                        verbose_name="year of birth",
                    ),
                ),
                (
                    "stroke_month",
                    models.DateField(
                        blank=True,
                        help_text="Researchers see only the months since then.",
                        null=True,
                        verbose_name="month of the stroke",
                    ),
                ),
                (
                    "severity",
                    models.CharField(
                        blank=True,
                        choices=[("mild", "mild"), ("moderate", "moderate"), ("severe", "severe")],
                        max_length=8,
                        verbose_name="severity",
                    ),
                ),
                (
                    "language",
                    models.CharField(
                        choices=rehab.people.models.clinics.language_choices,
                        default="en",
                        max_length=8,
                        verbose_name="language",
                    ),
                ),
                (
                    "screen_side",
                    models.CharField(
                        choices=[
                            ("right", "on the right (usual)"),
                            ("left", "on the left"),
                            ("center", "everything in the middle"),
                            ("in_right", "everything in the right half"),
                            ("in_left", "everything in the left half"),
                        ],
                        default="right",
                        max_length=8,
                        verbose_name="where things are",
                    ),
                ),
                (
                    "screen_text",
                    models.CharField(
                        choices=[("normal", "normal"), ("large", "large"), ("largest", "largest")],
                        default="normal",
                        max_length=8,
                        verbose_name="size of words",
                    ),
                ),
                (
                    "screen_still",
                    models.BooleanField(
                        default=False,
                        help_text="No confetti, and nothing moves except the level.",
                        verbose_name="calm page",
                    ),
                ),
                (
                    "screen_sounds",
                    models.BooleanField(
                        default=False,
                        help_text="A soft tone for each step, the higher the better; a second one for points. The patient can mute it on the page.",
                        verbose_name="sounds",
                    ),
                ),
                (
                    "boards",
                    models.CharField(
                        choices=[
                            ("own", "None: sees own sessions only"),
                            ("total", "Counts in totals, stands in no row"),
                            ("clinic", "Boards of this clinic"),
                            ("across", "Boards of this clinic and across clinics"),
                        ],
                        default="own",
                        help_text="What the patient has agreed to. Taken back, it takes effect at once.",
                        max_length=8,
                        verbose_name="leaderboards",
                    ),
                ),
                (
                    "alias",
                    models.CharField(
                        blank=True,
                        editable=False,
                        max_length=32,
                        null=True,
                        unique=True,
                        verbose_name="animal name",
                    ),
                ),
                (
                    "blinded",
                    models.BooleanField(
                        default=False,
                        help_text="No leaderboards and no scores: the patient sees none and stands on none.",
                        verbose_name="in a blinded study",
                    ),
                ),
                (
                    "simulated",
                    models.BooleanField(default=False, editable=False, verbose_name="simulated"),
                ),
                (
                    "legacy_id",
                    models.BigIntegerField(
                        editable=False,
                        help_text="The participant of the original GARRY's database.",
                        null=True,
                    ),
                ),
                ("created_at", models.DateTimeField(auto_now_add=True, verbose_name="created at")),
                (
                    "ended_at",
                    models.DateTimeField(editable=False, null=True, verbose_name="program ended"),
                ),
                (
                    "end_reason",
                    models.CharField(
                        blank=True,
                        choices=[
                            ("done", "The program is complete"),
                            ("wish", "The patient wishes to stop"),
                            ("health", "Health"),
                            ("moved", "Goes on elsewhere"),
                            ("other", "Another reason"),
                        ],
                        editable=False,
                        max_length=8,
                        verbose_name="why it ended",
                    ),
                ),
                (
                    "erased_at",
                    models.DateTimeField(editable=False, null=True, verbose_name="erased"),
                ),
                (
                    "erasure_reason",
                    models.CharField(
                        blank=True,
                        choices=[
                            ("asked", "The patient asks for it"),
                            ("mistake", "Was entered by mistake"),
                            ("retention", "Kept long enough"),
                        ],
                        editable=False,
                        max_length=9,
                        verbose_name="why it was erased",
                    ),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="patients",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "patient",
                "verbose_name_plural": "patients",
                "ordering": ["nickname", "code"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.AddField(
            model_name="leaderboard",
            name="group",
            field=models.ManyToManyField(
                blank=True,
                related_name="+",
                to="rehab.patient",
                verbose_name="patients of the group",
            ),
        ),
        migrations.CreateModel(
            name="FamilyLink",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("token_hash", models.CharField(editable=False, max_length=64, unique=True)),
                ("shows_name", models.BooleanField(default=True, verbose_name="with the nickname")),
                ("created_at", models.DateTimeField(verbose_name="created at")),
                ("expires_at", models.DateTimeField(verbose_name="valid until")),
                ("ended_at", models.DateTimeField(null=True, verbose_name="ended")),
                ("opened_at", models.DateTimeField(null=True, verbose_name="last opened")),
                ("opened", models.PositiveIntegerField(default=0, verbose_name="times opened")),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="+",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
                (
                    "created_by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                        verbose_name="given by",
                    ),
                ),
                (
                    "patient",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="family_links",
                        to="rehab.patient",
                        verbose_name="patient",
                    ),
                ),
            ],
            options={
                "verbose_name": "family link",
                "ordering": ["-created_at", "-pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.AddField(
            model_name="enrollment",
            name="patient",
            field=models.ForeignKey(
                on_delete=django.db.models.deletion.PROTECT,
                related_name="enrollments",
                to="rehab.patient",
            ),
        ),
        migrations.CreateModel(
            name="Consent",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "purpose",
                    models.CharField(
                        choices=[
                            ("care", "Care"),
                            ("research", "Research"),
                            ("boards", "Boards"),
                            ("remote", "Remote view"),
                            ("family", "Family view"),
                        ],
                        max_length=8,
                        verbose_name="to what",
                    ),
                ),
                (
                    "level",
                    models.CharField(
                        blank=True,
                        choices=[
                            ("own", "None: sees own sessions only"),
                            ("total", "Counts in totals, stands in no row"),
                            ("clinic", "Boards of this clinic"),
                            ("across", "Boards of this clinic and across clinics"),
                        ],
                        max_length=8,
                        verbose_name="how far",
                    ),
                ),
                ("given_at", models.DateTimeField(verbose_name="given at")),
                ("withdrawn_at", models.DateTimeField(null=True, verbose_name="withdrawn at")),
                (
                    "recorded_by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                        verbose_name="recorded by",
                    ),
                ),
                (
                    "withdrawn_by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                        verbose_name="withdrawn by",
                    ),
                ),
                (
                    "text",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="+",
                        to="rehab.consenttext",
                        verbose_name="text",
                    ),
                ),
                (
                    "patient",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="consents",
                        to="rehab.patient",
                        verbose_name="patient",
                    ),
                ),
            ],
            options={
                "ordering": ["-given_at", "-pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="AuditEntry",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("salt", models.CharField(blank=True, editable=False, max_length=32)),
                ("digest", models.CharField(default="", editable=False, max_length=64)),
                ("erased", models.BooleanField(default=False, editable=False)),
                (
                    "at",
                    models.DateTimeField(default=django.utils.timezone.now, verbose_name="when"),
                ),
                (
                    "through",
                    models.CharField(
                        blank=True, max_length=64, verbose_name="by which program or device"
                    ),
                ),
                (
                    "act",
                    models.CharField(
                        choices=[
                            ("view", "Looked at"),
                            ("change", "Changed"),
                            ("export", "Took data out"),
                            ("backup", "Backed up"),
                            ("erase", "Erased"),
                            ("unlock", "Unlocked an account"),
                            ("factors", "Removed second factors"),
                            ("reset", "Confirmed a host's reset"),
                            ("sign_in", "Signed in"),
                            ("sign_in_failed", "Failed to sign in"),
                            ("lock_out", "Was locked out"),
                            ("sign_ins_ended", "Ended all sign-ins"),
                            ("factor_added", "Added a second factor"),
                            ("factor_removed", "Removed a second factor"),
                            ("recovery_codes", "Made new recovery codes"),
                            ("password", "Changed a password"),
                            ("sign_on", "Linked or unlinked a hospital account"),
                            ("token_use", "Used a token from a new network"),
                            ("refused", "Was refused"),
                            ("token", "Gave a new token"),
                            ("tablet_in", "Let a tablet in"),
                            ("token_copy", "Used a token that was replaced"),
                            ("family_link", "Gave a family a link"),
                            ("family_end", "Ended a family's link"),
                            ("family_view", "Looked at, by a family's link"),
                            ("unblind", "Revealed a study's arm"),
                            ("clinic_in", "Took the clinic in"),
                            ("clinic_out", "Removed a clinic"),
                            ("robot_stop", "Stopped the robot"),
                            ("robot_arm", "Armed the robot"),
                            ("robot_trial", "Tried a gesture on the robot"),
                        ],
                        max_length=16,
                        verbose_name="what",
                    ),
                ),
                (
                    "about",
                    models.CharField(blank=True, max_length=200, verbose_name="where in GARRY"),
                ),
                (
                    "address",
                    models.CharField(blank=True, max_length=45, verbose_name="network address"),
                ),
                ("count", models.PositiveIntegerField(default=1, verbose_name="times")),
                (
                    "by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                        verbose_name="who",
                    ),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="+",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
                (
                    "patient",
                    models.ForeignKey(
                        db_constraint=False,
                        null=True,
                        on_delete=django.db.models.deletion.DO_NOTHING,
                        related_name="+",
                        to="rehab.patient",
                        verbose_name="whose",
                    ),
                ),
            ],
            options={
                "verbose_name": "audit entry",
                "verbose_name_plural": "audit log",
                "ordering": ["-at", "-pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Assessment",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "test",
                    models.CharField(
                        max_length=16,
                        verbose_name="test",
                    ),
                ),
                ("value", models.FloatField(verbose_name="result")),
                ("answers", models.JSONField(blank=True, default=list, verbose_name="answers")),
                ("remarks", models.TextField(blank=True, verbose_name="remarks")),
                ("device", models.CharField(blank=True, max_length=64, verbose_name="walked with")),
                (
                    "at",
                    models.DateTimeField(default=django.utils.timezone.now, verbose_name="when"),
                ),
                (
                    "struck_at",
                    models.DateTimeField(editable=False, null=True, verbose_name="struck out"),
                ),
                (
                    "by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                        verbose_name="by",
                    ),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="assessments",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
                (
                    "patient",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="assessments",
                        to="rehab.patient",
                        verbose_name="patient",
                    ),
                ),
            ],
            options={
                "verbose_name": "test result",
                "verbose_name_plural": "test results",
                "ordering": ["at", "pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Protocol",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("name", models.CharField(max_length=64, verbose_name="name")),
                ("description", models.TextField(blank=True, verbose_name="description")),
                (
                    "wanted_hits",
                    models.PositiveSmallIntegerField(
                        blank=True,
                        help_text="Filled in where a session is set up with it; left empty, it stays.",
                        null=True,
                        validators=[
                            django.core.validators.MinValueValidator(1),
                            django.core.validators.MaxValueValidator(100),
                        ],
                        verbose_name="target hit rate, % of steps",
                    ),
                ),
                (
                    "close_percent",
                    models.PositiveSmallIntegerField(
                        blank=True,
                        help_text="Steps too close to the goal to call neither earn nor cost points. Leave empty to call every step a hit or a miss.",
                        null=True,
                        validators=[django.core.validators.MaxValueValidator(49)],
                        verbose_name="close steps, % beyond the goal",
                    ),
                ),
                (
                    "questionnaires",
                    models.JSONField(blank=True, default=list, verbose_name="questionnaires"),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        blank=True,
                        null=True,
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="protocols",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "protocol",
                "verbose_name_plural": "protocols",
                "ordering": ["name"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Preset",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("name", models.CharField(max_length=64, verbose_name="name")),
                ("options", models.JSONField(default=dict, verbose_name="options")),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="presets",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
                (
                    "measure",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="presets",
                        to="rehab.measuredefinition",
                        verbose_name="measure",
                    ),
                ),
                (
                    "protocol",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="presets",
                        to="rehab.protocol",
                        verbose_name="protocol",
                    ),
                ),
            ],
            options={
                "verbose_name": "preset",
                "verbose_name_plural": "presets",
                "ordering": ["name"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="ProtocolPhase",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("position", models.PositiveSmallIntegerField(verbose_name="position")),
                (
                    "kind",
                    models.CharField(
                        choices=[
                            ("baseline", "Baseline"),
                            ("familiarization", "Familiarization"),
                            ("training", "Training"),
                            ("catch", "Catch"),
                            ("washout", "Washout"),
                            ("retention", "Retention"),
                        ],
                        max_length=16,
                        verbose_name="kind",
                    ),
                ),
                ("name", models.CharField(max_length=64, verbose_name="name")),
                (
                    "feedback",
                    models.BooleanField(
                        help_text="Whether the patient gets feedback in this phase.",
                        verbose_name="feedback",
                    ),
                ),
                (
                    "gain",
                    models.FloatField(
                        default=1.0,
                        help_text="What is shown is this share of the measured value (0.5 to 1.5).",
                        verbose_name="gain",
                    ),
                ),
                (
                    "strides",
                    models.PositiveIntegerField(
                        blank=True,
                        help_text="Ends after so many.",
                        null=True,
                        verbose_name="strides",
                    ),
                ),
                (
                    "seconds",
                    models.FloatField(
                        blank=True,
                        help_text="Ends after so many seconds.",
                        null=True,
                        verbose_name="seconds",
                    ),
                ),
                (
                    "goal_percent",
                    models.FloatField(
                        blank=True,
                        help_text="Goal from here on, % of baseline; left empty, it stays.",
                        null=True,
                        verbose_name="goal",
                    ),
                ),
                (
                    "robot",
                    models.BooleanField(
                        default=True,
                        help_text="Whether the robot answers in this phase.",
                        verbose_name="robot",
                    ),
                ),
                (
                    "rest_s",
                    models.FloatField(
                        blank=True,
                        help_text="Pause after it, seconds; you end it.",
                        null=True,
                        verbose_name="rest",
                    ),
                ),
                (
                    "protocol",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="phases",
                        to="rehab.protocol",
                        verbose_name="protocol",
                    ),
                ),
            ],
            options={
                "verbose_name": "protocol phase",
                "verbose_name_plural": "protocol phases",
                "ordering": ["protocol", "position"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="ClinicTest",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "code",
                    models.CharField(
                        help_text="Names it in exports. Clinics of one study give it the same.",
                        max_length=12,
                        validators=[
                            django.core.validators.RegexValidator(
                                "^[a-z][a-z0-9]{1,11}\\Z", "2 to 12 small letters, digits."
                            )
                        ],
                        verbose_name="short name",
                    ),
                ),
                ("name", models.CharField(max_length=64, verbose_name="name")),
                (
                    "steps",
                    models.TextField(
                        blank=True,
                        help_text="A line for each step.",
                        max_length=2000,
                        verbose_name="how it is done",
                    ),
                ),
                (
                    "items",
                    models.TextField(
                        help_text="A line each. A number in a range: “Knee bends | 0 | 2”. One that is asked back outside of what is usual: “Knee angle | 0 | 150 | 20 | 120”. A choice, which counts 0, 1, 2: “Tone | none, some, much”. A remark: “Shoes | text”. The result is the sum.",
                        max_length=12000,
                        verbose_name="items",
                    ),
                ),
                (
                    "unit",
                    models.CharField(
                        blank=True,
                        help_text="Of the result. Empty: points.",
                        max_length=16,
                        verbose_name="unit",
                    ),
                ),
                (
                    "higher_is_better",
                    models.BooleanField(default=True, verbose_name="a higher result is better"),
                ),
                (
                    "least_change",
                    models.FloatField(
                        blank=True,
                        help_text="Smaller changes are shown as no change. Empty: each one counts.",
                        null=True,
                        validators=[django.core.validators.MinValueValidator(0)],
                        verbose_name="least change that counts",
                    ),
                ),
                (
                    "is_offered",
                    models.BooleanField(
                        default=True,
                        help_text="Off: results stay, and no new ones are taken.",
                        verbose_name="offered",
                    ),
                ),
                (
                    "fixed_at",
                    models.DateTimeField(editable=False, null=True, verbose_name="fixed since"),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="own_tests",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "test of the clinic’s own",
                "verbose_name_plural": "tests of the clinic’s own",
                "ordering": ["name"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
                "constraints": [
                    models.UniqueConstraint(
                        fields=("clinic", "code"), name="own_test_once_per_clinic"
                    )
                ],
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Questionnaire",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("name", models.CharField(max_length=64, verbose_name="name")),
                (
                    "intro",
                    models.CharField(
                        blank=True,
                        default="",
                        max_length=200,
                        verbose_name="words above each question",
                    ),
                ),
                (
                    "language",
                    models.CharField(
                        choices=rehab.people.models.clinics.language_choices,
                        default="en",
                        max_length=8,
                        verbose_name="language",
                    ),
                ),
                (
                    "items",
                    models.TextField(
                        help_text="A line each, with the words at both ends of its scale and the number of points: “How tired are you? | not at all | very | 7”.",
                        max_length=12000,
                        verbose_name="questions",
                    ),
                ),
                (
                    "source",
                    models.CharField(
                        blank=True,
                        max_length=300,
                        verbose_name="where it is from, and why you may use it",
                    ),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="questionnaires",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "questionnaire",
                "verbose_name_plural": "questionnaires",
                "ordering": ["name"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="RecoveryCode",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("code_hash", models.CharField(max_length=64)),
                (
                    "user",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="recovery_codes",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
            ],
            options={
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="ResetRequest",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("asked_at", models.DateTimeField()),
                ("confirmed_at", models.DateTimeField(null=True)),
                (
                    "account",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
                (
                    "asked_by",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
                (
                    "confirmed_by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
            ],
            options={
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="ServerKey",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("purpose", models.CharField(max_length=16)),
                ("number", models.PositiveIntegerField()),
                ("sealed", models.TextField()),
                ("recovery", models.TextField(blank=True)),
            ],
            options={
                "ordering": ["purpose", "-number"],
                "constraints": [
                    models.UniqueConstraint(fields=("purpose", "number"), name="server_key_number")
                ],
            },
        ),
        migrations.CreateModel(
            name="SessionEvent",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "after_number",
                    models.PositiveIntegerField(
                        help_text="The last step before it; 0 for none.",
                        verbose_name="after number",
                    ),
                ),
                (
                    "kind",
                    models.CharField(
                        choices=[
                            ("start", "start"),
                            ("pause", "pause"),
                            ("resume", "resume"),
                            ("finish", "finish"),
                            ("abort", "abort"),
                            ("goal", "goal"),
                            ("goal_adaptation", "automatic goal"),
                            ("gain", "gain"),
                            ("phase", "phase"),
                            ("activation_threshold", "activation threshold"),
                            ("robot_intensity", "robot intensity"),
                            ("valence", "feedback type"),
                            ("valence_now", "feedback type from the next step"),
                            ("feedback_text", "words"),
                            ("words_shown", "words shown"),
                            ("chart_style", "chart style"),
                            ("goal_followed", "goal followed"),
                            ("planned_rest", "planned rest"),
                            ("heart_rate_limit", "heart rate above its limit"),
                            ("plugin", "plug-in"),
                            ("robot_stop", "robot stop"),
                            ("robot_arm", "robot arm"),
                            ("robot_decision", "robot decision"),
                            ("robot_gesture", "robot gesture"),
                            ("rest", "rest"),
                            ("pain", "pain"),
                            ("dizziness", "dizziness"),
                            ("near_fall", "near fall"),
                            ("fall", "fall"),
                            ("fall_severity", "hurt by the fall"),
                            ("fall_withdrawn", "it was not a fall"),
                            ("fall_acknowledged", "fall seen by a therapist"),
                            ("stop_acknowledged", "robot’s stop seen by a therapist"),
                            ("verbal_cue", "verbal cue"),
                            ("borg", "exertion"),
                            ("belt_speed", "belt speed"),
                            ("weight_support", "body-weight support"),
                            ("walking_aid", "walking aid"),
                            ("orthosis", "orthosis"),
                            ("handrail", "handrail"),
                            ("helping_hand", "therapist’s hand"),
                        ],
                        max_length=32,
                        verbose_name="kind",
                    ),
                ),
                ("old", models.FloatField(null=True, verbose_name="old")),
                ("value", models.FloatField(null=True, verbose_name="value")),
                ("at", models.DateTimeField(verbose_name="at")),
                ("data", models.JSONField(default=dict, verbose_name="data")),
                (
                    "by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                        verbose_name="by",
                    ),
                ),
            ],
            options={
                "verbose_name": "session event",
                "verbose_name_plural": "session events",
                "ordering": ["session", "pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="AdverseEvent",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "what",
                    models.CharField(blank=True, max_length=200, verbose_name="what happened"),
                ),
                (
                    "grade",
                    models.PositiveSmallIntegerField(
                        choices=[
                            (0, "no adverse event"),
                            (1, "mild"),
                            (2, "moderate"),
                            (3, "severe"),
                            (4, "a danger to life"),
                            (5, "death"),
                        ],
                        verbose_name="how bad",
                    ),
                ),
                (
                    "serious",
                    models.BooleanField(
                        default=False,
                        help_text="Death, danger to life, hospital, lasting disability.",
                        verbose_name="serious",
                    ),
                ),
                (
                    "relation",
                    models.CharField(
                        choices=[
                            ("none", "not related"),
                            ("possible", "possibly related"),
                            ("probable", "probably related"),
                            ("certain", "certainly related"),
                        ],
                        max_length=8,
                        verbose_name="caused by the study",
                    ),
                ),
                ("expected", models.BooleanField(default=False, verbose_name="expected")),
                (
                    "at",
                    models.DateTimeField(
                        default=django.utils.timezone.now, verbose_name="known since"
                    ),
                ),
                ("reported_at", models.DateTimeField(null=True, verbose_name="reported")),
                (
                    "by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
                (
                    "enrollment",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="adverse_events",
                        to="rehab.enrollment",
                    ),
                ),
                (
                    "entry",
                    models.OneToOneField(
                        null=True,
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="adverse_event",
                        to="rehab.sessionevent",
                    ),
                ),
            ],
            options={
                "verbose_name": "adverse event",
                "ordering": ["pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="SignInAttempts",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("key", models.CharField(max_length=64, unique=True)),
                ("failures", models.PositiveIntegerField(default=0)),
                ("counted_at", models.DateTimeField(db_index=True)),
                ("locked_until", models.DateTimeField(null=True)),
                ("signed_in_at", models.DateTimeField(null=True)),
                (
                    "user",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
            ],
            options={
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="SignOnGroup",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "name",
                    models.CharField(
                        help_text="As the hospital's sign-on names it.",
                        max_length=200,
                        verbose_name="group",
                    ),
                ),
                (
                    "role",
                    models.CharField(
                        choices=[
                            ("lead", "Clinic lead"),
                            ("pt", "Physical therapist"),
                            ("researcher", "Researcher"),
                            ("sponsor", "Sponsor of studies"),
                        ],
                        max_length=16,
                        verbose_name="role",
                    ),
                ),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="sign_on_groups",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "sign-on group",
                "verbose_name_plural": "sign-on groups",
                "ordering": ["clinic", "name"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Station",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("name", models.CharField(max_length=64, verbose_name="name")),
                (
                    "robot_stopped",
                    models.BooleanField(
                        default=False, editable=False, verbose_name="robot stopped"
                    ),
                ),
                ("pin_hash", models.CharField(blank=True, editable=False, max_length=128)),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="stations",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "verbose_name": "station",
                "verbose_name_plural": "stations",
                "ordering": ["name"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="PinAttempts",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("screen", models.CharField(max_length=64)),
                ("failures", models.PositiveIntegerField(default=0)),
                ("locked_until", models.DateTimeField()),
                (
                    "station",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="+",
                        to="rehab.station",
                        verbose_name="station",
                    ),
                ),
            ],
            options={
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.AddField(
            model_name="device",
            name="station",
            field=models.ForeignKey(
                on_delete=django.db.models.deletion.CASCADE,
                related_name="devices",
                to="rehab.station",
                verbose_name="station",
            ),
        ),
        migrations.CreateModel(
            name="Study",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "code",
                    models.CharField(
                        help_text="Begins the participants' codes, such as VAL-001. Name no condition in it.",
                        max_length=8,
                        validators=[
                            django.core.validators.RegexValidator(
                                "^[A-Z][A-Z0-9]{1,7}\\Z", "2 to 8 capital letters, digits."
                            )
                        ],
                        verbose_name="short name",
                    ),
                ),
                (
                    "title",
                    models.CharField(
                        help_text="Assessors and patients read it: name no arm's condition as the better one.",
                        max_length=120,
                        verbose_name="title",
                    ),
                ),
                (
                    "question",
                    models.TextField(max_length=4000, verbose_name="question and hypothesis"),
                ),
                (
                    "state",
                    models.CharField(
                        choices=[
                            ("draft", "Draft"),
                            ("registered", "Registered"),
                            ("running", "Running"),
                            ("closed", "Closed"),
                        ],
                        default="draft",
                        editable=False,
                        max_length=12,
                    ),
                ),
                (
                    "crossover",
                    models.BooleanField(
                        default=False,
                        help_text="Everybody walks every arm, in balanced orders.",
                        verbose_name="crossover",
                    ),
                ),
                (
                    "method",
                    models.CharField(
                        choices=[
                            ("blocks", "Permuted blocks of random size"),
                            ("minimization", "Minimization"),
                            ("list", "A list of our own"),
                        ],
                        default="blocks",
                        max_length=12,
                        verbose_name="allocation",
                    ),
                ),
                ("factors", models.JSONField(default=list, editable=False)),
                ("probability", models.FloatField(default=0.8, editable=False)),
                ("sealed", models.TextField(editable=False)),
                ("commitment", models.CharField(editable=False, max_length=64)),
                (
                    "participants",
                    models.PositiveIntegerField(
                        validators=[
                            django.core.validators.MinValueValidator(2),
                            django.core.validators.MaxValueValidator(10000),
                        ],
                        verbose_name="participants planned",
                    ),
                ),
                (
                    "months_since_stroke",
                    models.PositiveSmallIntegerField(
                        blank=True,
                        help_text="Who may enroll. Empty: every patient, however recent the stroke.",
                        null=True,
                        verbose_name="least months since the stroke",
                    ),
                ),
                (
                    "inclusion",
                    models.TextField(
                        blank=True,
                        help_text="One a line. Each is asked when a patient is enrolled, and has to be met.",
                        max_length=4000,
                        verbose_name="criteria of inclusion",
                    ),
                ),
                (
                    "exclusion",
                    models.TextField(
                        blank=True,
                        help_text="One a line. Who meets one of them is not enrolled.",
                        max_length=4000,
                        verbose_name="criteria of exclusion",
                    ),
                ),
                (
                    "visits",
                    models.PositiveSmallIntegerField(
                        default=1, verbose_name="visits in each period"
                    ),
                ),
                (
                    "days_between",
                    models.PositiveSmallIntegerField(default=1, verbose_name="days between visits"),
                ),
                (
                    "washout_days",
                    models.PositiveSmallIntegerField(
                        default=7, verbose_name="days between periods"
                    ),
                ),
                (
                    "follow_up_days",
                    models.PositiveSmallIntegerField(
                        blank=True,
                        help_text="After the last visit: a baseline, without feedback. Empty: no follow-up.",
                        null=True,
                        verbose_name="days to the follow-up",
                    ),
                ),
                (
                    "window_days",
                    models.PositiveSmallIntegerField(
                        blank=True,
                        help_text="Before or after the planned day. Further off is a deviation. Empty: any day will do.",
                        null=True,
                        validators=[
                            django.core.validators.MinValueValidator(0),
                            django.core.validators.MaxValueValidator(30),
                        ],
                        verbose_name="days that a visit may be off",
                    ),
                ),
                (
                    "goal_percent",
                    models.FloatField(
                        default=100,
                        validators=[
                            django.core.validators.MinValueValidator(50),
                            django.core.validators.MaxValueValidator(200),
                        ],
                        verbose_name="goal (% of baseline)",
                    ),
                ),
                (
                    "primary_outcome",
                    models.CharField(
                        max_length=32,
                        verbose_name="primary outcome",
                    ),
                ),
                (
                    "secondary_outcomes",
                    models.JSONField(blank=True, default=list, verbose_name="secondary outcomes"),
                ),
                (
                    "margin",
                    models.FloatField(
                        blank=True,
                        help_text="By how much a later arm may be worse than an earlier one in the primary outcome, in its unit. Empty: the study asks which arm is better.",
                        null=True,
                        validators=[
                            django.core.validators.MinValueValidator(0.001),
                            django.core.validators.MaxValueValidator(1000),
                        ],
                        verbose_name="margin of non-inferiority",
                    ),
                ),
                (
                    "spending",
                    models.CharField(
                        blank=True,
                        choices=[
                            ("obrien_fleming", "Seldom early (O’Brien and Fleming)"),
                            ("pocock", "Alike at each look (Pocock)"),
                        ],
                        help_text="How alpha, the chance of a false finding (0.05), is spent. Without it no look may stop the study.",
                        max_length=16,
                        verbose_name="looks before the end",
                    ),
                ),
                (
                    "planned_sd",
                    models.FloatField(
                        blank=True,
                        help_text="Of the primary outcome, from earlier studies.",
                        null=True,
                        validators=[
                            django.core.validators.MinValueValidator(0.001),
                            django.core.validators.MaxValueValidator(1000),
                        ],
                        verbose_name="SD between people",
                    ),
                ),
                ("assumed", models.JSONField(default=dict, editable=False)),
                ("facts", models.JSONField(default=dict, editable=False)),
                (
                    "created_at",
                    models.DateTimeField(default=django.utils.timezone.now, editable=False),
                ),
                ("registered_at", models.DateTimeField(editable=False, null=True)),
                ("started_at", models.DateTimeField(editable=False, null=True)),
                ("closed_at", models.DateTimeField(editable=False, null=True)),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="studies",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
                (
                    "created_by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
            ],
            options={
                "verbose_name": "study",
                "verbose_name_plural": "studies",
                "ordering": ["-created_at", "-pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Screening",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("unmet", models.JSONField(default=list)),
                ("declined", models.BooleanField(default=False)),
                ("at", models.DateTimeField(default=django.utils.timezone.now)),
                (
                    "by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
                (
                    "patient",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="screenings",
                        to="rehab.patient",
                    ),
                ),
                (
                    "study",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="screenings",
                        to="rehab.study",
                    ),
                ),
            ],
            options={
                "verbose_name": "screening",
                "ordering": ["pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="PowerRun",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("at", models.DateTimeField(default=django.utils.timezone.now)),
                ("settings", models.JSONField()),
                ("simulations", models.PositiveIntegerField(verbose_name="simulated studies")),
                ("found", models.JSONField(default=dict)),
                ("worked_at", models.DateTimeField(null=True)),
                ("trouble", models.TextField(blank=True)),
                (
                    "by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
                (
                    "study",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="power_runs",
                        to="rehab.study",
                    ),
                ),
            ],
            options={
                "verbose_name": "power simulation",
                "ordering": ["-pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.AddField(
            model_name="enrollment",
            name="study",
            field=models.ForeignKey(
                on_delete=django.db.models.deletion.PROTECT,
                related_name="enrollments",
                to="rehab.study",
            ),
        ),
        migrations.CreateModel(
            name="Arm",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("position", models.PositiveSmallIntegerField()),
                ("code", models.CharField(max_length=4, verbose_name="code")),
                ("name", models.CharField(max_length=64, verbose_name="name")),
                (
                    "weight",
                    models.PositiveSmallIntegerField(default=1, verbose_name="part of the ratio"),
                ),
                (
                    "valence",
                    models.CharField(
                        choices=rehab.feedback.translation.valence_choices,
                        max_length=16,
                        verbose_name="feedback type",
                    ),
                ),
                ("gain", models.FloatField(default=1.0, verbose_name="gain")),
                (
                    "robot_intensity",
                    models.FloatField(
                        choices=[(1.0, "normal"), (0.5, "gentle"), (0.0, "off")],
                        default=1.0,
                        verbose_name="robot",
                    ),
                ),
                (
                    "schedule",
                    models.CharField(
                        choices=[
                            ("every", "after every step, or every so many"),
                            ("bandwidth", "only outside of a band about the goal"),
                            ("faded", "more and more rarely"),
                            ("summary", "as a summary of so many steps"),
                        ],
                        default="every",
                        max_length=16,
                        verbose_name="feedback comes",
                    ),
                ),
                (
                    "schedule_steps",
                    models.PositiveSmallIntegerField(
                        default=1,
                        validators=[
                            django.core.validators.MinValueValidator(1),
                            django.core.validators.MaxValueValidator(100),
                        ],
                        verbose_name="steps between feedback",
                    ),
                ),
                (
                    "schedule_band",
                    models.PositiveSmallIntegerField(
                        default=10,
                        validators=[
                            django.core.validators.MinValueValidator(1),
                            django.core.validators.MaxValueValidator(50),
                        ],
                        verbose_name="band without feedback, ± % of the goal",
                    ),
                ),
                (
                    "measure",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="+",
                        to="rehab.measuredefinition",
                        verbose_name="measure",
                    ),
                ),
                (
                    "protocol",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to="rehab.protocol",
                        verbose_name="protocol",
                    ),
                ),
                (
                    "study",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="arms",
                        to="rehab.study",
                    ),
                ),
            ],
            options={
                "verbose_name": "arm",
                "ordering": ["study", "position"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="StudyEvent",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("salt", models.CharField(blank=True, editable=False, max_length=32)),
                ("digest", models.CharField(default="", editable=False, max_length=64)),
                ("erased", models.BooleanField(default=False, editable=False)),
                (
                    "kind",
                    models.CharField(
                        choices=[
                            ("registered", "Registered"),
                            ("started", "Started"),
                            ("revised", "Changed: a new version"),
                            ("closed", "Closed"),
                            ("enrolled", "Enrolled"),
                            ("withdrawn", "Withdrew"),
                            ("marked", "Mark given"),
                            ("unmarked", "Mark taken"),
                            ("consented", "Agreed to a new version"),
                            ("asked", "A second person is asked to reveal the arm"),
                            ("unblinded", "Arm revealed"),
                            ("emergency", "Arm revealed in an emergency"),
                            ("refused", "Revealing the arm was refused"),
                            ("looked", "Looked at results before the end"),
                            ("guessed", "Group guessed"),
                        ],
                        max_length=12,
                        verbose_name="what",
                    ),
                ),
                ("about", models.CharField(blank=True, max_length=120, verbose_name="about")),
                ("reason", models.TextField(blank=True, max_length=1000, verbose_name="reason")),
                ("at", models.DateTimeField(default=django.utils.timezone.now, verbose_name="at")),
                (
                    "by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                        verbose_name="by",
                    ),
                ),
                (
                    "enrollment",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="events",
                        to="rehab.enrollment",
                    ),
                ),
                (
                    "study",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="events",
                        to="rehab.study",
                    ),
                ),
            ],
            options={
                "verbose_name": "event",
                "ordering": ["pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="StudyMark",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("salt", models.CharField(blank=True, editable=False, max_length=32)),
                ("digest", models.CharField(default="", editable=False, max_length=64)),
                ("erased", models.BooleanField(default=False, editable=False)),
                (
                    "task",
                    models.CharField(
                        choices=[
                            ("assessor", "Assesses, and must not know the arm"),
                            ("interim", "May look before the study is closed"),
                            ("monitor", "Monitors harms by arm"),
                        ],
                        max_length=8,
                        verbose_name="task",
                    ),
                ),
                ("at", models.DateTimeField(default=django.utils.timezone.now)),
                ("ended_at", models.DateTimeField(null=True)),
                (
                    "by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
                (
                    "study",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="marks",
                        to="rehab.study",
                    ),
                ),
                (
                    "user",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="study_marks",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
            ],
            options={
                "verbose_name": "mark",
                "ordering": ["pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="StudyVersion",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("number", models.PositiveSmallIntegerField()),
                ("document", models.JSONField()),
                ("digest", models.CharField(max_length=64)),
                (
                    "reason",
                    models.TextField(blank=True, max_length=1000, verbose_name="why it is changed"),
                ),
                (
                    "needs_consent",
                    models.BooleanField(
                        default=False, verbose_name="participants have to agree again"
                    ),
                ),
                ("at", models.DateTimeField(default=django.utils.timezone.now)),
                (
                    "by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
                (
                    "study",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="versions",
                        to="rehab.study",
                    ),
                ),
            ],
            options={
                "verbose_name": "version",
                "ordering": ["number"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.AddField(
            model_name="enrollment",
            name="version",
            field=models.ForeignKey(
                on_delete=django.db.models.deletion.PROTECT,
                related_name="+",
                to="rehab.studyversion",
            ),
        ),
        migrations.CreateModel(
            name="TrainingSession",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "created_at",
                    models.DateTimeField(
                        db_index=True, default=django.utils.timezone.now, verbose_name="created at"
                    ),
                ),
                (
                    "valence",
                    models.CharField(
                        choices=rehab.feedback.translation.valence_choices,
                        db_index=True,
                        max_length=16,
                        verbose_name="feedback type",
                    ),
                ),
                (
                    "changed_to",
                    models.CharField(
                        blank=True,
                        editable=False,
                        help_text="Types after the first, in order.",
                        max_length=64,
                    ),
                ),
                (
                    "trained_side",
                    models.CharField(
                        choices=[("left", "Left"), ("right", "Right")],
                        max_length=8,
                        verbose_name="trained side",
                    ),
                ),
                (
                    "source",
                    models.CharField(
                        blank=True,
                        help_text="Where its steps come from.",
                        max_length=200,
                        verbose_name="source",
                    ),
                ),
                ("simulated", models.BooleanField(default=False, verbose_name="simulated")),
                (
                    "source_args",
                    models.JSONField(
                        default=list,
                        editable=False,
                        help_text="Arguments of the source that the server runs.",
                    ),
                ),
                ("plan", models.JSONField(verbose_name="plan")),
                ("device", models.CharField(blank=True, max_length=64, verbose_name="device")),
                (
                    "belt_speed_m_s",
                    models.FloatField(blank=True, null=True, verbose_name="belt speed (m/s)"),
                ),
                (
                    "weight_support_percent",
                    models.FloatField(
                        blank=True, null=True, verbose_name="body-weight support (%)"
                    ),
                ),
                (
                    "state",
                    models.CharField(
                        choices=[
                            ("ready", "Ready"),
                            ("running", "Running"),
                            ("paused", "Paused"),
                            ("finished", "Finished"),
                            ("aborted", "Ended early"),
                        ],
                        default="ready",
                        max_length=16,
                        verbose_name="state",
                    ),
                ),
                (
                    "goal",
                    models.FloatField(
                        blank=True,
                        help_text="Goal in force (the measure's unit).",
                        null=True,
                        verbose_name="goal",
                    ),
                ),
                (
                    "started_at",
                    models.DateTimeField(blank=True, null=True, verbose_name="started at"),
                ),
                ("ended_at", models.DateTimeField(blank=True, null=True, verbose_name="ended at")),
                (
                    "active_s",
                    models.FloatField(
                        default=0.0, help_text="Time without pauses.", verbose_name="walked (s)"
                    ),
                ),
                (
                    "excluded",
                    models.BooleanField(
                        default=False,
                        editable=False,
                        help_text="Corrected: in no figure, board or trend.",
                        verbose_name="left out",
                    ),
                ),
                (
                    "legacy_id",
                    models.BigIntegerField(
                        editable=False, null=True, verbose_name="imported session"
                    ),
                ),
                ("legacy_row", models.JSONField(editable=False, null=True)),
                ("last_number", models.PositiveIntegerField(default=0, editable=False)),
                ("unsealed", models.BooleanField(default=True, editable=False)),
                ("checkpoint", models.JSONField(editable=False, null=True)),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="sessions",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
                (
                    "created_by",
                    models.ForeignKey(
                        blank=True,
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                        verbose_name="created by",
                    ),
                ),
                (
                    "measure",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="sessions",
                        to="rehab.measuredefinition",
                        verbose_name="measure",
                    ),
                ),
                (
                    "patient",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="sessions",
                        to="rehab.patient",
                        verbose_name="patient",
                    ),
                ),
                (
                    "protocol",
                    models.ForeignKey(
                        blank=True,
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="sessions",
                        to="rehab.protocol",
                        verbose_name="protocol",
                    ),
                ),
                (
                    "station",
                    models.ForeignKey(
                        blank=True,
                        db_index=False,
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="sessions",
                        to="rehab.station",
                        verbose_name="station",
                    ),
                ),
            ],
            options={
                "verbose_name": "session",
                "verbose_name_plural": "sessions",
                "ordering": ["-created_at", "-pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="StudyVisit",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("number", models.PositiveSmallIntegerField()),
                ("attempt", models.PositiveSmallIntegerField(default=1)),
                ("period", models.PositiveSmallIntegerField()),
                ("follow_up", models.BooleanField(default=False)),
                ("day", models.DateField(verbose_name="day")),
                (
                    "enrollment",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="visits",
                        to="rehab.enrollment",
                    ),
                ),
                (
                    "version",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="+",
                        to="rehab.studyversion",
                    ),
                ),
                (
                    "session",
                    models.OneToOneField(
                        null=True,
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="study_visit",
                        to="rehab.trainingsession",
                    ),
                ),
            ],
            options={
                "verbose_name": "study visit",
                "ordering": ["enrollment", "number", "attempt"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Step",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("number", models.PositiveIntegerField(verbose_name="number")),
                (
                    "time_s",
                    models.FloatField(help_text="The source's clock.", verbose_name="time (s)"),
                ),
                (
                    "received_at",
                    models.DateTimeField(
                        help_text="The server's clock.", verbose_name="received at"
                    ),
                ),
                (
                    "side",
                    models.CharField(
                        choices=[("left", "Left"), ("right", "Right")],
                        max_length=8,
                        verbose_name="side",
                    ),
                ),
                ("value", models.FloatField(null=True, verbose_name="value")),
                ("gain", models.FloatField(verbose_name="gain")),
                ("shown", models.FloatField(null=True, verbose_name="shown")),
                ("goal", models.FloatField(null=True, verbose_name="goal")),
                ("performance", models.FloatField(null=True, verbose_name="performance")),
                ("hit", models.BooleanField(null=True, verbose_name="hit")),
                (
                    "close",
                    models.BooleanField(
                        db_default=False,
                        help_text="Too uncertain to count as a hit or a miss.",
                        verbose_name="close",
                    ),
                ),
                (
                    "late",
                    models.BooleanField(
                        db_default=False,
                        help_text="It arrived too late to be shown live.",
                        verbose_name="late",
                    ),
                ),
                ("points", models.SmallIntegerField(null=True, verbose_name="points")),
                ("valid", models.BooleanField(verbose_name="valid")),
                ("reasons", models.JSONField(default=list, verbose_name="reasons")),
                (
                    "phase",
                    models.PositiveSmallIntegerField(
                        help_text="Index into the plan's phases.", verbose_name="phase"
                    ),
                ),
                ("rules_version", models.PositiveSmallIntegerField(verbose_name="rules version")),
                ("extra", models.JSONField(default=dict, verbose_name="extra")),
                (
                    "session",
                    models.ForeignKey(
                        db_index=False,
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="steps",
                        to="rehab.trainingsession",
                        verbose_name="session",
                    ),
                ),
            ],
            options={
                "verbose_name": "step",
                "verbose_name_plural": "steps",
                "ordering": ["session", "number"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="SessionSeal",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("number", models.PositiveIntegerField()),
                ("moves", models.PositiveIntegerField(default=0)),
                ("first_step", models.PositiveIntegerField()),
                ("last_step", models.PositiveIntegerField()),
                ("first_event", models.PositiveIntegerField()),
                ("last_event", models.PositiveIntegerField()),
                ("steps", models.CharField(max_length=64)),
                ("events", models.CharField(max_length=64)),
                ("previous", models.CharField(blank=True, max_length=64)),
                ("digest", models.CharField(max_length=64)),
                ("sealed_at", models.DateTimeField(default=django.utils.timezone.now)),
                ("replaced_at", models.DateTimeField(null=True)),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="+",
                        to="rehab.clinic",
                    ),
                ),
                (
                    "session",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="seals",
                        to="rehab.trainingsession",
                    ),
                ),
            ],
            options={
                "verbose_name": "seal of a session",
                "ordering": ["clinic", "number"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="SessionMetric",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "slug",
                    models.CharField(
                        choices=[
                            ("score", "Score"),
                            ("hit_rate", "Hit rate"),
                            ("mean_performance", "Mean performance"),
                            ("best_streak", "Best streak"),
                            ("points_per_100_steps", "Points per 100 steps"),
                            ("improvement_over_baseline", "Improvement over baseline"),
                            ("retention_in_washout", "Retention in washout"),
                            ("steps", "Steps"),
                            ("active_minutes", "Active minutes"),
                            ("attended", "Sessions attended"),
                            ("target_met", "Target met"),
                        ],
                        max_length=32,
                        verbose_name="slug",
                    ),
                ),
                ("value", models.FloatField(verbose_name="value")),
                (
                    "session",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="metrics",
                        to="rehab.trainingsession",
                        verbose_name="session",
                    ),
                ),
            ],
            options={
                "verbose_name": "session metric",
                "verbose_name_plural": "session metrics",
                "ordering": ["session", "slug"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.AddField(
            model_name="sessionevent",
            name="session",
            field=models.ForeignKey(
                on_delete=django.db.models.deletion.PROTECT,
                related_name="events",
                to="rehab.trainingsession",
                verbose_name="session",
            ),
        ),
        migrations.CreateModel(
            name="SessionCorrection",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                (
                    "field",
                    models.CharField(
                        choices=[("patient", "Who walked"), ("counts", "Counts"), ("note", "Note")],
                        max_length=16,
                        verbose_name="what",
                    ),
                ),
                ("old", models.TextField(blank=True, verbose_name="before")),
                ("new", models.TextField(blank=True, verbose_name="after")),
                ("reason", models.TextField(verbose_name="reason")),
                ("at", models.DateTimeField(verbose_name="at")),
                (
                    "by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.SET_NULL,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                        verbose_name="by",
                    ),
                ),
                (
                    "session",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="corrections",
                        to="rehab.trainingsession",
                        verbose_name="session",
                    ),
                ),
            ],
            options={
                "verbose_name": "correction",
                "verbose_name_plural": "corrections",
                "ordering": ["session", "pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="RobotIncident",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("at", models.DateTimeField(verbose_name="at")),
                ("reason", models.CharField(max_length=64, verbose_name="why the robot stopped")),
                ("recording", models.TextField(verbose_name="recording")),
                (
                    "session",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="incidents",
                        to="rehab.trainingsession",
                        verbose_name="session",
                    ),
                ),
            ],
            options={
                "verbose_name": "incident of a robot",
                "verbose_name_plural": "incidents of robots",
                "ordering": ["session", "pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="QuestionnaireResponse",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("slug", models.CharField(max_length=32, verbose_name="questionnaire")),
                ("instrument", models.JSONField()),
                ("answers", models.JSONField(default=list, verbose_name="answers")),
                (
                    "asked_at",
                    models.DateTimeField(
                        default=django.utils.timezone.now, verbose_name="planned at"
                    ),
                ),
                ("finished_at", models.DateTimeField(null=True, verbose_name="finished at")),
                (
                    "session",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="questionnaires",
                        to="rehab.trainingsession",
                        verbose_name="session",
                    ),
                ),
            ],
            options={
                "verbose_name": "answered questionnaire",
                "verbose_name_plural": "answered questionnaires",
                "ordering": ["session", "pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="Visit",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("day", models.DateField(verbose_name="day")),
                ("at", models.TimeField(blank=True, null=True, verbose_name="time")),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="visits",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
                (
                    "patient",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="visits",
                        to="rehab.patient",
                        verbose_name="patient",
                    ),
                ),
            ],
            options={
                "verbose_name": "visit",
                "ordering": ["day", "at", "pk"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="ClinicOwner",
            fields=[
                (
                    "clinic",
                    models.OneToOneField(
                        on_delete=django.db.models.deletion.CASCADE,
                        primary_key=True,
                        related_name="+",
                        serialize=False,
                        to="rehab.clinic",
                    ),
                ),
                ("owner", models.CharField(blank=True, max_length=200)),
                ("epoch", models.PositiveIntegerField(default=0)),
            ],
            options={
                "ordering": ["clinic"],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
                "indexes": [models.Index(fields=["owner"], name="clinic_by_owner")],
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.CreateModel(
            name="BoardChange",
            fields=[
                (
                    "token",
                    models.BigIntegerField(
                        default=rehab.boards.cache_invalidation.draw_token,
                        primary_key=True,
                        serialize=False,
                    ),
                ),
                ("patient_key", models.BigIntegerField()),
                ("at", models.DateTimeField(default=django.utils.timezone.now)),
                (
                    "clinic",
                    models.ForeignKey(
                        db_constraint=False,
                        db_index=False,
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="+",
                        to="rehab.clinic",
                    ),
                ),
            ],
            options={
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
                "indexes": [models.Index(fields=["clinic", "at"], name="board_change_by_clinic")],
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.AddConstraint(
            model_name="user",
            constraint=models.CheckConstraint(
                condition=models.Q(
                    models.Q(("clinic__isnull", True), ("role", "host")),
                    models.Q(models.Q(("role", "host"), _negated=True), ("clinic__isnull", False)),
                    _connector="OR",
                ),
                name="user_clinic_fits_role",
                violation_error_message="A host has no clinic; every other role needs one.",
            ),
        ),
        migrations.AddConstraint(
            model_name="user",
            constraint=models.CheckConstraint(
                condition=models.Q(("role__in", ["host", "lead", "pt", "researcher", "sponsor"])),
                name="user_role_is_known",
            ),
        ),
        migrations.AddConstraint(
            model_name="clinicmove",
            constraint=models.UniqueConstraint(
                fields=("clinic", "number"), name="clinic_moved_in_order"
            ),
        ),
        migrations.AddConstraint(
            model_name="composedgesture",
            constraint=models.UniqueConstraint(
                fields=("clinic", "name"), name="gesture_name_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            model_name="consenttext",
            constraint=models.UniqueConstraint(
                fields=("clinic", "version"), name="consent_text_version_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            model_name="feedbacktype",
            constraint=models.UniqueConstraint(
                fields=("clinic", "slug"), name="feedback_type_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            model_name="feedbackband",
            constraint=models.UniqueConstraint(
                fields=("feedback_type", "from_percent"), name="feedback_band_once_per_type"
            ),
        ),
        migrations.AddConstraint(
            model_name="gesturestep",
            constraint=models.UniqueConstraint(
                fields=("gesture", "position"), name="gesture_step_position_once"
            ),
        ),
        migrations.AddIndex(
            model_name="historyentry",
            index=models.Index(fields=["model_name", "object_id"], name="history_by_row"),
        ),
        migrations.AddConstraint(
            model_name="importtombstone",
            constraint=models.UniqueConstraint(
                fields=("clinic", "id_hash"), name="import_tombstone_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            model_name="logseal",
            constraint=models.UniqueConstraint(
                fields=("log", "clinic", "number"), name="log_sealed_in_order"
            ),
        ),
        migrations.AddConstraint(
            model_name="logseal",
            constraint=models.UniqueConstraint(
                condition=models.Q(("clinic__isnull", True)),
                fields=("log", "number"),
                name="log_of_hosts_sealed_in_order",
            ),
        ),
        migrations.AddConstraint(
            model_name="measuredefinition",
            constraint=models.UniqueConstraint(
                fields=("clinic", "slug"), name="measure_slug_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            model_name="measuredefinition",
            constraint=models.UniqueConstraint(
                condition=models.Q(("clinic__isnull", True)),
                fields=("slug",),
                name="measure_slug_once_shared",
            ),
        ),
        migrations.AddConstraint(
            model_name="measuredefinition",
            constraint=models.CheckConstraint(
                condition=models.Q(
                    ("value_min__lt", models.F("value_max")),
                    ("goal_min__gte", 0),
                    ("goal_min__lt", models.F("goal_max")),
                ),
                name="measure_bounds_in_order",
                violation_error_message="Each smallest value must lie below the largest; goals lie above 0.",
            ),
        ),
        migrations.AddIndex(
            model_name="outboxmessage",
            index=models.Index(
                condition=models.Q(("state", "waiting")), fields=["due_at"], name="waiting_message"
            ),
        ),
        migrations.AddConstraint(
            model_name="patient",
            constraint=models.UniqueConstraint(
                fields=("clinic", "code"), name="patient_code_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            model_name="patient",
            constraint=models.UniqueConstraint(
                fields=("clinic", "legacy_id"), name="patient_imported_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            model_name="leaderboard",
            constraint=models.UniqueConstraint(
                fields=("clinic", "name"), name="board_name_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            model_name="leaderboard",
            constraint=models.UniqueConstraint(
                condition=models.Q(("clinic__isnull", True)),
                fields=("name",),
                name="board_name_once_across",
            ),
        ),
        migrations.AddConstraint(
            model_name="leaderboard",
            constraint=models.CheckConstraint(
                condition=models.Q(
                    models.Q(("period", "dates"), _negated=True),
                    models.Q(
                        ("period_from__isnull", False), ("period_to__gte", models.F("period_from"))
                    ),
                    _connector="OR",
                ),
                name="board_dates_in_order",
                violation_error_message="Give both dates, the first not after the second.",
            ),
        ),
        migrations.AddConstraint(
            model_name="leaderboard",
            constraint=models.CheckConstraint(
                condition=models.Q(
                    models.Q(("among__in", ["self", "group", "clinic"]), ("clinic__isnull", False)),
                    models.Q(("among", "across"), ("clinic__isnull", True)),
                    _connector="OR",
                ),
                name="board_across_is_the_hosts",
                violation_error_message="Boards across clinics are the host's, and a host has no other boards.",
            ),
        ),
        migrations.AddConstraint(
            model_name="consent",
            constraint=models.UniqueConstraint(
                condition=models.Q(("withdrawn_at__isnull", True)),
                fields=("patient", "purpose"),
                name="consent_holds_once",
            ),
        ),
        migrations.AddIndex(
            model_name="auditentry",
            index=models.Index(fields=["clinic", "-at"], name="audit_by_clinic_and_date"),
        ),
        migrations.AddIndex(
            model_name="auditentry",
            index=models.Index(fields=["patient", "-at"], name="audit_by_patient_and_date"),
        ),
        migrations.AddIndex(
            model_name="assessment",
            index=models.Index(fields=["patient", "test", "at"], name="assessment_by_patient"),
        ),
        migrations.AddConstraint(
            model_name="protocol",
            constraint=models.UniqueConstraint(
                fields=("clinic", "name"), name="protocol_name_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            model_name="protocol",
            constraint=models.UniqueConstraint(
                condition=models.Q(("clinic__isnull", True)),
                fields=("name",),
                name="protocol_name_once_shared",
            ),
        ),
        migrations.AddConstraint(
            model_name="preset",
            constraint=models.UniqueConstraint(
                fields=("clinic", "name"),
                name="preset_name_once_per_clinic",
                violation_error_message="A preset of this name exists. Choose another name.",
            ),
        ),
        migrations.AddConstraint(
            model_name="protocolphase",
            constraint=models.UniqueConstraint(
                fields=("protocol", "position"), name="protocol_phase_position_once"
            ),
        ),
        migrations.AddConstraint(
            model_name="questionnaire",
            constraint=models.UniqueConstraint(
                fields=("clinic", "name"), name="questionnaire_name_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            model_name="recoverycode",
            constraint=models.UniqueConstraint(
                fields=("user", "code_hash"), name="recovery_code_once"
            ),
        ),
        migrations.AddConstraint(
            model_name="resetrequest",
            constraint=models.UniqueConstraint(
                fields=("account", "asked_by"), name="reset_request_once_per_host"
            ),
        ),
        migrations.AddConstraint(
            model_name="signongroup",
            constraint=models.UniqueConstraint(
                fields=("name", "clinic"),
                name="sign_on_group_once_a_clinic",
                violation_error_message="This clinic has this group already.",
            ),
        ),
        migrations.AddConstraint(
            model_name="station",
            constraint=models.UniqueConstraint(
                fields=("clinic", "name"), name="station_name_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            model_name="pinattempts",
            constraint=models.UniqueConstraint(
                fields=("station", "screen"), name="pin_attempts_once_per_screen"
            ),
        ),
        migrations.AddConstraint(
            model_name="study",
            constraint=models.UniqueConstraint(
                fields=("clinic", "code"), name="study_code_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            model_name="arm",
            constraint=models.UniqueConstraint(
                fields=("study", "code"), name="arm_code_once_per_study"
            ),
        ),
        migrations.AddConstraint(
            model_name="studymark",
            constraint=models.UniqueConstraint(
                condition=models.Q(("ended_at", None)),
                fields=("study", "user", "task"),
                name="study_mark_holds_once",
            ),
        ),
        migrations.AddConstraint(
            model_name="studyversion",
            constraint=models.UniqueConstraint(
                fields=("study", "number"), name="study_version_once"
            ),
        ),
        migrations.AddConstraint(
            model_name="enrollment",
            constraint=models.UniqueConstraint(
                fields=("study", "patient"), name="enrolled_once_per_study"
            ),
        ),
        migrations.AddConstraint(
            model_name="enrollment",
            constraint=models.UniqueConstraint(
                fields=("study", "code"), name="participant_code_once"
            ),
        ),
        migrations.AddIndex(
            model_name="trainingsession",
            index=models.Index(fields=["clinic", "-created_at"], name="session_by_clinic_and_date"),
        ),
        migrations.AddIndex(
            model_name="trainingsession",
            index=models.Index(
                fields=["patient", "-created_at"], name="session_by_patient_and_date"
            ),
        ),
        migrations.AddIndex(
            model_name="trainingsession",
            index=models.Index(fields=["station", "state"], name="session_by_station_and_state"),
        ),
        migrations.AddIndex(
            model_name="trainingsession",
            index=models.Index(
                condition=models.Q(("state", "running")),
                fields=["clinic"],
                name="running_session_by_clinic",
            ),
        ),
        migrations.AddIndex(
            model_name="trainingsession",
            index=models.Index(
                condition=models.Q(("unsealed", True)),
                fields=["clinic"],
                name="unsealed_session_by_clinic",
            ),
        ),
        migrations.AddConstraint(
            model_name="trainingsession",
            constraint=models.UniqueConstraint(
                fields=("clinic", "legacy_id"), name="session_imported_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            model_name="studyvisit",
            constraint=models.UniqueConstraint(
                fields=("enrollment", "number", "attempt"), name="study_visit_once"
            ),
        ),
        migrations.AddConstraint(
            model_name="step",
            constraint=models.UniqueConstraint(
                fields=("session", "number"), name="step_number_once"
            ),
        ),
        migrations.AddConstraint(
            model_name="sessionseal",
            constraint=models.UniqueConstraint(
                fields=("clinic", "number"), name="sessions_sealed_in_order"
            ),
        ),
        migrations.AddIndex(
            model_name="sessionmetric",
            index=models.Index(fields=["slug", "value"], name="metric_by_value"),
        ),
        migrations.AddConstraint(
            model_name="sessionmetric",
            constraint=models.UniqueConstraint(
                fields=("session", "slug"), name="session_metric_once"
            ),
        ),
        migrations.AddIndex(
            model_name="sessionevent",
            index=models.Index(
                condition=models.Q(
                    (
                        "kind__in",
                        (
                            "fall",
                            "fall_withdrawn",
                            "fall_acknowledged",
                            "stop_acknowledged",
                            "robot_stop",
                            "robot_arm",
                        ),
                    )
                ),
                fields=["at"],
                name="event_of_alarm",
            ),
        ),
        migrations.AddConstraint(
            model_name="questionnaireresponse",
            constraint=models.UniqueConstraint(
                fields=("session", "slug"), name="questionnaire_once"
            ),
        ),
        migrations.AddIndex(
            model_name="visit",
            index=models.Index(fields=["clinic", "day"], name="visit_by_clinic_and_day"),
        ),
        migrations.AddConstraint(
            model_name="visit",
            constraint=models.UniqueConstraint(fields=("patient", "day"), name="visit_once_a_day"),
        ),
        migrations.RunPython(create_leases, drop_leases),
    ]
