"""Base classes of the admin: rows by scope, permissions by the table of rights."""

from __future__ import annotations

from typing import Any, ClassVar

from django.contrib import admin
from django.contrib.admin.exceptions import DisallowedModelAdminLookup
from django.contrib.admin.options import IncorrectLookupParameters
from django.contrib.admin.views.main import ChangeList
from django.db import models
from django.db.models import QuerySet
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect
from django.template.response import TemplateResponse
from django.utils.decorators import method_decorator
from django.utils.text import capfirst
from django.utils.translation import gettext

from rehab.people.access import user_of
from rehab.people.audit.history import clinic_id_of
from rehab.people.audit.row_history import changes_of
from rehab.people.roles import Right, Role, is_hidden_beside, rights_of
from rehab.people.row_values import read_key, read_values, save_changes
from rehab.people.scope import ScopedModel, visible_rows
from rehab.people.sign_in import step_up
from rehab.people.web.row_forms import ClinicForm, with_values

AS_READ = "values of a row as they were read"
asks_who_it_is = method_decorator(step_up.required)  # of a page or action


def rights_for(request: HttpRequest, model: type[models.Model]) -> Right:
    """Return what the person of this request may do with a model's rows."""
    user = request.user
    if not user.is_authenticated or not user.is_active:
        return Right.NONE
    return rights_of(user.role, model.__name__)


def may_modify(user: Any, row: ScopedModel) -> bool:
    """Return whether a person may change a visible row: shared rows are for the host alone."""
    return not row.scope.shared or user.role == Role.HOST or clinic_id_of(row) is not None


class RestrictedChangeList(ChangeList):
    """A list that can be filtered by its own filters, its dates and our own links alone.

    Django accepts any field of the model, also one that a role does not see: from the number of
    rows its value could be guessed letter by letter.
    """

    def get_results(self, request: HttpRequest) -> None:
        """Find the rows. Where nothing was searched, they are all there are."""
        super().get_results(request)
        if not (self.query or self.has_active_filters):
            self.full_result_count = self.result_count

    def get_filters(self, request: HttpRequest) -> Any:
        """Return the filters. Refuses unknown lookups and impossible dates."""
        try:
            found = super().get_filters(request)
        except (ValueError, OverflowError) as problem:  # a year after 9999
            raise IncorrectLookupParameters(problem) from problem
        model_admin: Any = self.model_admin
        days = [f"{self.date_hierarchy}__gte", f"{self.date_hierarchy}__lt"]
        known = {*model_admin.link_lookups, *(days if self.date_hierarchy else ())}
        if unknown := found[2].keys() - known:
            raise DisallowedModelAdminLookup(
                f"This list cannot be filtered by {', '.join(unknown)}."
            )
        return found


def hidden_fields(request: HttpRequest, model: type[models.Model]) -> set[str]:
    """Return the fields that refer to persons whom the person of this request may not know."""
    role = getattr(request.user, "role", "")
    relations = (*model._meta.concrete_fields, *model._meta.many_to_many)
    return {
        field.name
        for field in relations
        if isinstance(field.related_model, type)
        and is_hidden_beside(role, field.related_model.__name__)
    }


def omit_fields(fields: Any, omitted: set[str]) -> list[Any]:
    """Return the fields of an admin form, some of them in one line, without the omitted ones."""
    return [
        field if isinstance(field, str) else omit_fields(field, omitted)
        for field in fields
        if field not in omitted
    ]


class ScopedOptions(admin.options.BaseModelAdmin):
    """Options that a model's own pages and its inlines have in common."""

    link_lookups: tuple[str, ...] = ()  # lookups by which links of other pages filter the list

    def get_changelist(self, request: HttpRequest, **kwargs: Any) -> type[ChangeList]:
        """Return the list's class."""
        return RestrictedChangeList

    def get_queryset(self, request: HttpRequest) -> QuerySet[Any]:
        """Return the rows that this person may see."""
        rows: QuerySet[Any] = self.model.objects.visible_to(request.user)
        ordering = self.get_ordering(request)
        return rows.order_by(*ordering) if ordering else rows

    def get_fieldsets(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return the fields without those that are left out, and without empty groups."""
        omitted = self.get_omitted_fields(request, obj)
        return [
            (title, {**options, "fields": fields})
            for title, options in super().get_fieldsets(request, obj)
            if (fields := omit_fields(options["fields"], omitted))
        ]

    def get_omitted_fields(self, request: HttpRequest, obj: Any) -> set[str]:
        """Return the fields of persons whom this person may not know."""
        return hidden_fields(request, self.model)

    def formfield_for_dbfield(self, db_field: Any, request: HttpRequest, **kwargs: Any) -> Any:
        """Return the field without Django's icons beside it, which open windows."""
        field = super().formfield_for_dbfield(db_field, request, **kwargs)
        if field is not None:
            field.widget = getattr(field.widget, "widget", field.widget)
        return field

    def get_field_queryset(self, db: str | None, db_field: Any, request: HttpRequest) -> Any:
        """Return the related rows that this person may see."""
        model = db_field.remote_field.model
        condition = visible_rows(model, request.user)
        rows = super().get_field_queryset(db, db_field, request)
        rows = QuerySet(model) if rows is None else rows
        return rows.none() if condition is None else rows.filter(condition)

    def has_view_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Return whether rows may be read."""
        return Right.VIEW in rights_for(request, self.model)

    def has_add_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Return whether rows may be added."""
        return self._may(request, Right.ADD, obj)

    def has_change_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Return whether this row may be changed."""
        return self._may(request, Right.CHANGE, obj)

    def has_delete_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Return whether this row may be deleted."""
        return self._may(request, Right.DELETE, obj)

    def _may(self, request: HttpRequest, right: Right, obj: Any) -> bool:
        """Look the right up; ``obj`` is the row, or for inlines the row of the page."""
        if right not in rights_for(request, self.model):
            return False
        return not isinstance(obj, ScopedModel) or may_modify(request.user, obj)


class TrackedAdmin(admin.ModelAdmin):
    """A list with its model's name as title, and pages of a row with our own change history."""

    empty_value_display = ""  # so that a card of a phone leaves the column out
    actions_on_top = False
    actions_on_bottom = True  # what is ticked is followed by what to do with it

    def get_object(self, request: HttpRequest, object_id: str, from_field: Any = None) -> Any:
        """Return a row; by its key where ``from_field`` is empty, on which Django fails."""
        row = super().get_object(request, object_id, from_field or None)
        if row is not None:
            vars(row)[AS_READ] = read_values(row)
        return row

    def save_model(self, request: HttpRequest, obj: Any, form: Any, change: bool) -> None:
        """Save a new row; of another one what the form changed, as others may change the rest."""
        if change:
            save_changes(obj, vars(obj)[AS_READ])
        else:
            super().save_model(request, obj, form, change)

    def changelist_view(self, request: HttpRequest, extra_context: Any = None) -> HttpResponse:
        """Show the list with the model's name as title."""
        title = capfirst(self.opts.verbose_name_plural)
        return super().changelist_view(request, {"title": title} | (extra_context or {}))

    def history_view(
        self, request: HttpRequest, object_id: str, extra_context: Any = None
    ) -> HttpResponse:
        """Show the change history of a row to people who may see the row."""
        row = self.get_object(request, object_id)
        if row is None or not self.has_view_permission(request, row):
            raise Http404
        parts = [inline.model for inline in self.get_inline_instances(request, row)]
        context = {
            **self.admin_site.each_context(request),
            "title": gettext("History: %(row)s") % {"row": row},
            "object": row,
            "opts": self.opts,
            "module_name": capfirst(self.opts.verbose_name_plural),
            "changes": changes_of(request.user, row, parts),
        }
        return TemplateResponse(request, "admin/changes.html", context)


class ScopedAdmin(ScopedOptions, TrackedAdmin):
    """Pages of a model. New rows belong to the clinic of the person who adds them."""

    form = ClinicForm
    list_per_page = 50
    show_facets = admin.ShowFacets.NEVER
    row_actions: tuple[str, ...] = ()  # actions that the row's own page offers as well
    viewer_actions: tuple[str, ...] = ()  # those of them that change nothing of the row
    about_actions: Any = ""  # when to use them
    row_words: ClassVar[dict[str, Any]] = {}  # what the row's own page calls them, if not as a list

    def has_module_permission(self, request: HttpRequest) -> bool:
        """Return whether the model is on the front page."""
        return bool(rights_for(request, self.model))

    def get_list_display(self, request: HttpRequest) -> Any:
        """Return the columns without those of persons whom this person may not know."""
        return omit_fields(super().get_list_display(request), hidden_fields(request, self.model))

    def get_exclude(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return the excluded fields with the clinic, which follows from the person."""
        exclude = tuple(super().get_exclude(request, obj) or ())
        return (*exclude, "clinic") if hasattr(self.model, "clinic") else exclude

    def get_form(
        self, request: HttpRequest, obj: Any = None, change: bool = False, **kwargs: Any
    ) -> Any:
        """Return the form; a new row's clinic is the person's own, or none for a host."""
        form: Any = super().get_form(request, obj, change=change, **kwargs)
        own = {"clinic_id": user_of(request).clinic_id} if hasattr(self.model, "clinic") else {}
        return with_values(form, **own)

    def get_omitted_fields(self, request: HttpRequest, obj: Any) -> set[str]:
        """Return as well the fields that can only be read and say nothing yet."""
        names = {field.name for field in self.model._meta.concrete_fields}
        if obj is None or self.has_change_permission(request, obj):
            names.intersection_update(self.get_readonly_fields(request, obj))
        silent = {name for name in names if obj is None or getattr(obj, name) in (None, "", [])}
        return super().get_omitted_fields(request, obj) | silent

    def get_row_actions(self, row: Any) -> tuple[str, ...]:
        """Return the actions that a row's own page offers."""
        return self.row_actions

    def get_row_links(self, request: HttpRequest, row: Any) -> list[tuple[str, Any]]:
        """Return URLs and labels of further pages about a row."""
        return []

    def render_change_form(
        self, request: HttpRequest, context: dict[str, Any], *args: Any, **kwargs: Any
    ) -> HttpResponse:
        """Show the page, with links and actions on top."""
        row = context.get("original")
        if row is not None:
            actions = self.get_actions(request)
            if not self._may(request, Right.CHANGE, row):
                actions = {name: actions[name] for name in actions if name in self.viewer_actions}
            context["about_actions"] = self.about_actions
            context["row_links"] = self.get_row_links(request, row)
            context["row_actions"] = [
                (name, self.row_words.get(name, found[2]), name not in self.viewer_actions)
                for name in self.get_row_actions(row)
                if (found := actions.get(name))
            ]
        return super().render_change_form(request, context, *args, **kwargs)

    def response_action(
        self, request: HttpRequest, queryset: QuerySet[Any], *args: Any
    ) -> HttpResponse | None:
        """Run an action; one from a row's own page returns there."""
        response = super().response_action(request, queryset, *args)
        key = read_key(request.POST.get("stay", ""))
        if key and getattr(response, "url", "") == request.get_full_path():
            meta = self.opts
            return redirect(f"admin:{meta.app_label}_{meta.model_name}_change", key)
        return response

    def get_deleted_objects(self, objs: Any, request: HttpRequest) -> Any:
        """Return what is deleted as well, and what stays without its reference."""
        deleted, *others = super().get_deleted_objects(objs, request)
        return ([*deleted, *self._kept(objs, request)], *others)

    def render_delete_form(self, request: HttpRequest, context: dict[str, Any]) -> HttpResponse:
        """Show what is deleted apart from what stays."""
        kept = self._kept([context["object"]], request)
        deleted = context["deleted_objects"]
        context |= {"kept": kept, "deleted_objects": deleted[: len(deleted) - len(kept)]}
        return super().render_delete_form(request, context)

    def _kept(self, objs: Any, request: HttpRequest) -> list[str]:
        kept = []
        keys = [row.pk for row in objs]
        for relation in self.model._meta.related_objects:
            referrer = relation.related_model
            if relation.on_delete is not models.SET_NULL or not issubclass(referrer, ScopedModel):
                continue
            rows = referrer.objects.visible_to(request.user)
            if count := rows.filter(**{f"{relation.field.name}__in": keys}).count():
                template = gettext("Stays, without its %(what)s: %(things)s (%(count)s)")
                values = {
                    "what": relation.field.verbose_name,
                    "things": referrer._meta.verbose_name_plural,
                    "count": count,
                }
                kept.append(template % values)
        return kept


class ReadOnlyAdmin(ScopedAdmin):
    """Read-only pages of a log, linked from the session of its rows."""

    show_full_result_count = False
    actions = None

    def has_module_permission(self, request: HttpRequest) -> bool:
        """Return False: logs are not on the front page."""
        return False
