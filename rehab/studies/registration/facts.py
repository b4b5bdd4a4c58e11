"""What a registry, an ethics board and a journal ask of a study, and GARRY cannot know."""

from __future__ import annotations

from django.utils.translation import gettext_lazy as _

BEFORE = ("sponsor", "sponsor_role", "funding", "ethics")  # asked for before a study is registered
# Slug to the question; `checklists` says which items each answers.
ASKED = {
    "sponsor": _("Sponsor: name, address, contact"),
    "sponsor_role": _(
        "What sponsor and funders do in design, conduct, analysis and report, and who decides"
    ),
    "secondary_sponsors": _("Further sponsors"),
    "funding": _("Money and other support, and from whom"),
    "conflicts": _("Conflicts of interest"),
    "contributors": _("Who wrote the protocol: names, affiliations, parts"),
    "committees": _("Committees: who steers, who decides"),
    "data_monitoring": _("Who monitors data and harms, independent of whom"),
    "contact_public": _("Contact for the public"),
    "contact_scientific": _("Contact for science"),
    "registry": _("Registry, number, date of registration"),
    "secondary_ids": _("Further numbers of the study"),
    "ethics": _("Ethics board, number, date and outcome"),
    "scientific_title": _("Scientific title, with design and population"),
    "countries": _("Countries of recruitment"),
    "condition": _("Health condition that is studied"),
    "background": _("Background, with what is known of benefits and harms"),
    "comparator": _("Why this comparator"),
    "involvement": _("How patients and the public took part in the design"),
    "setting": _("Where: kind of clinic, who may provide the treatment"),
    "provider": _("Who treats, with which training"),
    "materials": _("Materials and equipment besides GARRY, and where to get them"),
    "tailoring": _("What therapists may adapt to a person, and how"),
    "concomitant": _("Other care that is allowed or not during the study"),
    "adherence": _("How adherence is helped and measured"),
    "discontinuing": _("When a person’s treatment is changed or stopped"),
    "harms": _("How harms are asked for besides what therapists note"),
    "size": _("Why this number of participants"),
    "everybody": _("Why no criteria say who may take part"),
    "first_day": _("Planned date of the first enrollment"),
    "last_day": _("Planned date of completion"),
    "stopping": _("When the study ends early, and who decides"),
    "recruitment": _("How enough people are found"),
    "retention": _("How people are helped to stay"),
    "blinding": _("Who is blinded, and how"),
    "data": _("How data are entered, checked and kept"),
    "monitoring": _("How the conduct is monitored"),
    "consent": _("Who asks for consent, and how; what for besides this study"),
    "aftercare": _("Care and compensation after the study"),
    "plan": _("Where protocol and analysis plan can be read"),
    "sharing": _("Which data and code are shared, with whom, how"),
    "dissemination": _("How results reach participants and the public"),
}
