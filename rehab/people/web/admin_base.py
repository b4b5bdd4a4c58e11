"""The admin of a clinic's people: each row by scope, each act by the table of roles."""

from __future__ import annotations

from typing import Any, ClassVar

from django import forms
from django.contrib import admin, messages
from django.contrib.admin.exceptions import DisallowedModelAdminLookup
from django.contrib.admin.options import IncorrectLookupParameters
from django.contrib.admin.views.main import ChangeList
from django.db import models, transaction
from django.db.models import QuerySet
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect
from django.template.response import TemplateResponse
from django.utils import timezone
from django.utils.text import capfirst
from django.utils.translation import gettext, ngettext
from django.utils.translation import gettext_lazy as _

from rehab.people.access import person
from rehab.people.audit.audit_log import Act, note_safety
from rehab.people.audit.history_text import changes_of
from rehab.people.networks import client_address
from rehab.people.roles import Right, Role, rights_of
from rehab.people.scope import ScopedModel, visible
from rehab.people.sign_in.tokens import TokenRow


def rights(request: HttpRequest, model: type[models.Model]) -> Right:
    """Give what the person behind this request may do with a model's rows."""
    user = request.user
    if not user.is_authenticated or not user.is_active:
        return Right.NONE
    return rights_of(user.role, model.__name__)


def owns(user: Any, row: ScopedModel) -> bool:
    """Whether a visible row is this person's to change: shared rows are the host's alone."""
    if not row.scope.shared or user.role == Role.HOST:
        return True
    owner: Any = row
    for step in row.scope.clinic.split("__"):
        owner = getattr(owner, step)
    return owner is not None


class NarrowedList(ChangeList):
    """A list that only its own filters, its days and our own links narrow.

    Django takes any field of the model, also one that a role is not shown: letter by letter, the
    number of rows would tell what stands in it.
    """

    def get_filters(self, request: HttpRequest) -> Any:
        """Give the filters. Refuses what none of them asks for, and days of no calendar."""
        try:
            found = super().get_filters(request)
        except (ValueError, OverflowError) as problem:  # a year after 9999
            raise IncorrectLookupParameters(problem) from problem
        pages: Any = self.model_admin
        days = [f"{self.date_hierarchy}__gte", f"{self.date_hierarchy}__lt"]
        known = {*pages.linked_by, *(days if self.date_hierarchy else ())}
        if strange := found[2].keys() - known:
            raise DisallowedModelAdminLookup(f"Lists are not narrowed by {', '.join(strange)}.")
        return found


class ScopedOptions(admin.options.BaseModelAdmin):
    """What a model's own pages and its rows inside another model's page have in common."""

    linked_by: tuple[str, ...] = ()  # what links of other pages narrow the list by

    def get_changelist(self, request: HttpRequest, **kwargs: Any) -> type[ChangeList]:
        """Give the list's class."""
        return NarrowedList

    def get_queryset(self, request: HttpRequest) -> QuerySet[Any]:
        """Give the rows that this person may see, and no other."""
        rows: QuerySet[Any] = self.model.objects.visible_to(request.user)
        ordering = self.get_ordering(request)
        return rows.order_by(*ordering) if ordering else rows

    def get_field_queryset(self, db: str | None, db_field: Any, request: HttpRequest) -> Any:
        """Offer related rows that this person may see, and no other."""
        model = db_field.remote_field.model
        condition = visible(model, request.user)
        rows = super().get_field_queryset(db, db_field, request)
        rows = QuerySet(model) if rows is None else rows
        return rows.none() if condition is None else rows.filter(condition)

    def has_view_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Whether rows may be read."""
        return Right.VIEW in rights(request, self.model)

    def has_add_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Whether rows may be added."""
        return self._may(request, Right.ADD, obj)

    def has_change_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Whether this row may be changed."""
        return self._may(request, Right.CHANGE, obj)

    def has_delete_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Whether this row may be deleted."""
        return self._may(request, Right.DELETE, obj)

    def _may(self, request: HttpRequest, right: Right, obj: Any) -> bool:
        """Ask the table; ``obj`` is the row, or for rows inside a page the row of that page."""
        if right not in rights(request, self.model):
            return False
        return not isinstance(obj, ScopedModel) or owns(request.user, obj)


class RowFormSet(forms.BaseInlineFormSet):
    """Rows of a table inside a page: each field is named by its column, for who cannot see it."""

    def add_fields(self, form: Any, index: int | None) -> None:
        """Name the fields."""
        super().add_fields(form, index)
        for field in form.fields.values():
            field.widget.attrs["aria-label"] = field.label


class ClinicForm(forms.ModelForm):
    """A form whose row belongs to a clinic that nobody chooses."""

    new_clinic_id: ClassVar[int | None] = None

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if self.instance.pk is None and hasattr(self.instance, "clinic_id"):
            self.instance.clinic_id = self.new_clinic_id

    def _get_validation_exclusions(self) -> set[str]:
        # The clinic is not in the form, but "once per clinic" must be checked all the same.
        return super()._get_validation_exclusions() - {"clinic"}  # type: ignore[misc, no-any-return]


class RowAdmin(admin.ModelAdmin):
    """Pages of a row, whose history is ours: each value before and after."""

    def get_object(self, request: HttpRequest, object_id: str, from_field: Any = None) -> Any:
        """Find a row; where a form names no field to find it by (Django fails), by its key."""
        return super().get_object(request, object_id, from_field or None)

    def history_view(
        self, request: HttpRequest, object_id: str, extra_context: Any = None
    ) -> HttpResponse:
        """Tell who changed what of a row, to those who may see the row."""
        row = self.get_object(request, object_id)
        if row is None or not self.has_view_permission(request, row):
            raise Http404
        parts = [inline.model for inline in self.get_inline_instances(request, row)]
        context = {
            **self.admin_site.each_context(request),
            "title": gettext("Changes: %(row)s") % {"row": row},
            "object": row,
            "opts": self.opts,
            "module_name": capfirst(self.opts.verbose_name_plural),
            "changes": changes_of(request.user, row, parts),
        }
        return TemplateResponse(request, "admin/changes.html", context)


class ScopedAdmin(ScopedOptions, RowAdmin):
    """A model's pages. New rows belong to the clinic of whoever adds them."""

    form = ClinicForm
    list_per_page = 50
    show_facets = admin.ShowFacets.NEVER
    row_actions: tuple[str, ...] = ()  # actions that a row's own page offers as well
    for_viewers: tuple[str, ...] = ()  # those of them that alter nothing of the row

    def has_module_permission(self, request: HttpRequest) -> bool:
        """Whether the model is on the front page."""
        return bool(rights(request, self.model))

    def get_exclude(self, request: HttpRequest, obj: Any = None) -> Any:
        """Leave the clinic out: it follows from who is signed in."""
        exclude = tuple(super().get_exclude(request, obj) or ())
        return (*exclude, "clinic") if hasattr(self.model, "clinic") else exclude

    def get_form(
        self, request: HttpRequest, obj: Any = None, change: bool = False, **kwargs: Any
    ) -> Any:
        """Give the form; a new row's clinic is the person's own, or none for a host."""
        form: Any = super().get_form(request, obj, change=change, **kwargs)
        return type(form)(form.__name__, (form,), {"new_clinic_id": person(request).clinic_id})

    def changelist_view(self, request: HttpRequest, extra_context: Any = None) -> HttpResponse:
        """Show the list under what it is a list of."""
        title = capfirst(self.opts.verbose_name_plural)
        return super().changelist_view(request, {"title": title} | (extra_context or {}))

    def get_row_links(self, request: HttpRequest, row: Any) -> list[tuple[str, Any]]:
        """Give addresses and words of where one may want to go from a row's page."""
        return []

    def render_change_form(
        self, request: HttpRequest, context: dict[str, Any], *args: Any, **kwargs: Any
    ) -> HttpResponse:
        """Show the page, with ways to elsewhere and what can be done on top."""
        row = context.get("original")
        if row is not None:
            actions = self.get_actions(request)
            if not self._may(request, Right.CHANGE, row):
                actions = {name: actions[name] for name in actions if name in self.for_viewers}
            context["row_links"] = self.get_row_links(request, row)
            context["row_actions"] = [
                (name, found[2], name not in self.for_viewers)
                for name in self.row_actions
                if (found := actions.get(name))
            ]
        return super().render_change_form(request, context, *args, **kwargs)

    def response_action(
        self, request: HttpRequest, queryset: QuerySet[Any], *args: Any
    ) -> HttpResponse | None:
        """Do it; what was asked for on a row's own page leads back there."""
        response = super().response_action(request, queryset, *args)
        key = request.POST.get("stay", "")
        if key.isdecimal() and getattr(response, "url", "") == request.get_full_path():
            meta = self.opts
            return redirect(f"admin:{meta.app_label}_{meta.model_name}_change", int(key))
        return response

    def get_deleted_objects(self, objs: Any, request: HttpRequest) -> Any:
        """Give what goes too, and what stays behind without it."""
        gone, *others = super().get_deleted_objects(objs, request)
        keys = [row.pk for row in objs]
        for relation in self.model._meta.related_objects:
            left = relation.related_model
            if relation.on_delete is not models.SET_NULL or not issubclass(left, ScopedModel):
                continue
            rows = left.objects.visible_to(request.user)
            if count := rows.filter(**{f"{relation.field.name}__in": keys}).count():
                words = gettext("Stays, without its %(what)s: %(things)s (%(count)s)")
                named = {
                    "what": relation.field.verbose_name,
                    "things": left._meta.verbose_name_plural,
                    "count": count,
                }
                gone.append(words % named)
        return (gone, *others)


class TokenAdmin(ScopedAdmin):
    """Pages of rows that are known by a token. It is shown once, when it is made."""

    readonly_fields: ClassVar[tuple[str, ...]] = ("created_at", "last_seen_at", "revoked_at")
    actions = row_actions = ("renew_tokens", "revoke_tokens")

    def save_model(self, request: HttpRequest, obj: Any, form: Any, change: bool) -> None:
        """Save the row; a new one gets its token, shown this one time."""
        token = None if change else obj.new_token()
        super().save_model(request, obj, form, change)
        if token:
            self._show(request, obj, token)

    @admin.action(description=_("Give new tokens (old ones stop at once)"), permissions=["change"])
    def renew_tokens(self, request: HttpRequest, holders: QuerySet[Any]) -> None:
        """Replace the tokens of the chosen rows."""
        for holder in holders:
            with transaction.atomic():
                by, address = person(request), client_address(request)
                note_safety(Act.TOKEN, by, holder, address, timezone.now())
                token = holder.new_token()
                holder.revoked_at = None
                holder.save()
            self._show(request, holder, token)

    @admin.action(description=_("Revoke tokens"), permissions=["change"])
    def revoke_tokens(self, request: HttpRequest, holders: QuerySet[Any]) -> None:
        """Close the door to the chosen rows."""
        open_ones = list(holders.filter(revoked_at__isnull=True))
        for holder in open_ones:  # one by one: it is kept who did it
            holder.revoked_at = timezone.now()
            holder.save(update_fields=["revoked_at"])
        said = ngettext("%(count)d token revoked.", "%(count)d tokens revoked.", len(open_ones))
        messages.success(request, said % {"count": len(open_ones)})

    def _show(self, request: HttpRequest, holder: TokenRow, token: str) -> None:
        said = gettext("Token of %(holder)s, shown this one time only: %(token)s")
        messages.warning(request, said % {"holder": holder, "token": token})


class ReadOnlyAdmin(ScopedAdmin):
    """Pages of a log: rows are read, and reached from the session that they belong to."""

    show_full_result_count = False
    actions = None

    def has_module_permission(self, request: HttpRequest) -> bool:
        """Keep logs off the front page."""
        return False
