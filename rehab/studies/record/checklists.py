"""SPIRIT 2025, CONSORT 2025, TIDieR and WHO's registry items, filled from what is known and asked.

Item numbers are those of the statements (Chan 2025, BMJ 389:e081477; Hopewell 2025, BMJ
389:e081123; Hoffmann 2014, BMJ 348:g1687; WHO Trial Registration Data Set 1.3.1); the words are
ours, and short. An item without an answer is still to be written: GARRY says so, and invents none.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from textwrap import fill

from rehab.studies.models import Study
from rehab.studies.record.prefilled_answers import UNMASKED, know
from rehab.studies.registration.facts import ASKED
from rehab.studies.registration.problems import find_doubts
from rehab.studies.results.results import Results

INDENT = "    "
SUMMARY, REPEATED = "1b", {"masked", "simulated"}  # other things are said once in a list
BY_HAND = "to be written in the report"
NO_ASSESSOR = "another word for “assessor-blinded”: no assessor is marked"
SAID_BLINDED = "a marked assessor, or other words: “{said}” is not so, no assessor is marked"
# Words that say that assessors are blinded, up to three words apart.
ASSESSOR, BLINDED = r"\b(?:assessor|rater)\w*", r"\b(?:blind|mask)\w*"
IN_DOUBT = {"everybody"}  # asked only of a plan that lets a reviewer ask
NEAR = r"\W+(?:(?!not\b)\w+\W+){0,3}?"
SAYS_BLINDED = re.compile(f"{ASSESSOR}{NEAR}{BLINDED}|{BLINDED}{NEAR}{ASSESSOR}", re.IGNORECASE)
# List; then one line for each item: number | words | what answers it.
ITEMS = {
    "SPIRIT 2025": """
        1a | title says it is a protocol, and the design | simulated scientific_title masked
        1b | structured summary | title design arms primary
        2 | version and date | version
        3a | who wrote it | contributors
        3b | sponsor, contact | sponsor
        3c | part of sponsor and funders | sponsor_role
        3d | committees | committees
        4 | registration | registry
        5 | where protocol and analysis plan are | version plan
        6 | data and code that are shared | exportable sharing
        7a | funding | funding
        7b | conflicts of interest | conflicts
        8 | dissemination | dissemination
        9a | background | background
        9b | choice of comparator | comparator
        10 | objectives | question
        11 | patients and public | involvement
        12 | design | design
        13 | setting | clinic setting countries
        14a | eligibility of participants | eligibility everybody
        14b | eligibility of sites and providers | provider
        15a | interventions | arms phases
        15b | when they are changed or stopped | discontinuing
        15c | adherence | adherence
        15d | concomitant care | concomitant
        16 | outcomes | primary secondary
        17 | harms | harms_defined harms
        18 | timeline | timeline
        19 | sample size | participants power size
        20 | recruitment | recruitment
        21a | who makes the sequence | sequence
        21b | type of randomization | allocation
        22 | concealment | concealment
        23 | implementation | implementation
        24a | who is blinded | masked blinding
        24b | how | blinded
        24c | unblinding | unblinding
        25a | collection of data | collected
        25b | retention | retention
        26 | management of data | data
        27a | statistical methods | analysis
        27b | who is analyzed | populations
        27c | missing data | missing
        27d | further analyses | further
        28a | data monitoring committee | data_monitoring
        28b | interim analyses, stopping | looks looks_made stopping
        29 | monitoring of the conduct | monitoring
        30 | ethics approval | ethics
        31 | amendments | changes
        32a | consent | consents consent
        32b | consent to further use | consent
        33 | confidentiality | confidentiality
        34 | care after the trial | aftercare""",
    "CONSORT 2025": """
        1a | title says randomized | simulated scientific_title masked
        1b | structured summary | -
        2 | registration | registry
        3 | protocol and analysis plan | version plan
        4 | sharing | exportable sharing
        5a | funding, part of funders | funding sponsor_role
        5b | conflicts of interest | conflicts
        6 | background | background
        7 | objectives | question
        8 | patients and public | involvement
        9 | design | design
        10 | changes after the start | changes
        11 | setting | clinic setting countries
        12a | eligibility of participants | eligibility everybody
        12b | sites and providers | provider
        13 | interventions | arms phases
        14 | outcomes | primary secondary
        15 | how harms were assessed | harms_defined harms
        16a | sample size | participants power size
        16b | interim analyses, stopping | looks looks_made looks_level stopping
        17a | sequence | sequence
        17b | type of randomization | allocation sizes
        18 | concealment | concealment
        19 | implementation | implementation
        20a | who was blinded | masked blinding unblinded
        20b | how | blinded
        21a | statistical methods | analysis
        21b | who is analyzed | populations
        21c | missing data | missing
        21d | further analyses | further
        22a | flow | flow
        22b | losses and exclusions | losses
        23a | dates | dates
        23b | why it ended | ended stopping
        24a | interventions as delivered | delivered
        24b | concomitant care | concomitant
        25 | baseline data | baseline
        26 | numbers, outcomes, estimates | estimates
        27 | harms | harms_found adverse
        28 | ancillary analyses | ancillary further
        29 | interpretation | -
        30 | limitations | -""",
    "TIDieR": """
        1 | name | title
        2 | why | background
        3 | materials | materials
        4 | procedures | arms phases
        5 | who provides | provider
        6 | how | arms
        7 | where | clinic setting
        8 | when and how much | timeline phases
        9 | tailoring | tailoring
        10 | modifications | changes
        11 | adherence as planned | adherence
        12 | adherence as it was | delivered""",
    "WHO": """
        1 | registry and number | registry
        2 | date of registration | registry
        3 | further numbers | secondary_ids
        4 | support | funding
        5 | primary sponsor | sponsor
        6 | further sponsors | secondary_sponsors
        7 | contact for the public | contact_public
        8 | contact for science | contact_scientific
        9 | public title | simulated title
        10 | scientific title | simulated scientific_title masked
        11 | countries | countries
        12 | condition | condition
        13 | interventions | arms
        14 | eligibility | eligibility everybody
        15 | type | design allocation
        16 | first enrollment | first_day
        17 | size, planned and reached | participants flow
        18 | status | status simulated
        19 | primary outcome | primary
        20 | secondary outcomes | secondary
        21 | ethics | ethics
        22 | completion | last_day
        23 | summary of results | estimates
        24 | sharing of data | sharing""",
}


def checklist_rows(study: Study, results: Results | None) -> Iterator[dict[str, str]]:
    """Yield each item of each list, with its answer and what is still asked.

    Parameters
    ----------
    study
        The study.
    results
        Of a closed study; None before.
    """
    answers = study.facts | know(study, results)  # what happened, not what was planned
    is_unmasked, said_blinded = UNMASKED in answers["masked"], ""
    doubts = find_doubts(study)
    if is_unmasked and _names_assessor(answers.get("blinding", "")):
        said_blinded = answers.pop("blinding")  # a report tells one truth: GARRY's
    for name, items in ITEMS.items():
        said: dict[str, str] = {}  # at which item
        for line in items.strip().splitlines():
            number, words, slugs = (part.strip() for part in line.split("|"))
            named = slugs.split()
            known = [slug for slug in named if answers.get(slug)]
            given = [f"See item {said[s]}." if s in said else answers[s] for s in known]
            if number != SUMMARY:
                said |= {s: said.get(s, number) for s in known if s not in REPEATED}
            asked = [slug for slug in named if slug in ASKED and not answers.get(slug)]
            asked = [slug for slug in asked if slug in doubts or slug not in IN_DOUBT]
            lacking = [
                SAID_BLINDED.format(said=said_blinded)
                if said_blinded and slug == "blinding"
                else doubts.get(slug, str(ASKED[slug])).rstrip(".")
                for slug in asked
            ]
            if slugs == "-" or not (given or lacking):
                lacking = [BY_HAND]
            if "masked" in named and is_unmasked and _says_blinded(given):
                lacking.append(NO_ASSESSOR)
            elif "scientific_title" in named and is_unmasked:
                given.remove(answers["masked"])
            yield {
                "list": name,
                "item": number,
                "what": words,
                "answer": " ".join([*(f"{one.rstrip('.')}." for one in given[:-1]), *given[-1:]]),
                "still asked": "; ".join(lacking),
            }


def _names_assessor(who_is_blinded: str) -> bool:
    """Return whether an answer to who is blinded names assessors, and does not say they are not."""
    clauses = re.split(r"[.;,]", who_is_blinded)
    text = " ".join(one for one in clauses if not re.search(r"\b(?:not|know)\b", one))
    return bool(re.search(ASSESSOR, text, re.IGNORECASE))


def _says_blinded(given: Iterable[str]) -> bool:
    return any(SAYS_BLINDED.search(one) for one in given)


def checklist_text(rows: Iterable[dict[str, str]], name: str) -> str:
    """Return a list as a reader gets it: each item, its answer, what is still asked.

    Parameters
    ----------
    rows, name
        Of `checklist_rows`; a key of `ITEMS`.
    """
    lines = [name]
    for row in rows:
        if row["list"] == name:
            lines.append(f"\n{row['item']:<4}{row['what']}")
            asked = row["still asked"] and f"[Still asked: {row['still asked']}]"
            texts = filter(None, (row["answer"], asked))
            lines += [
                fill(text, 100, initial_indent=INDENT, subsequent_indent=INDENT) for text in texts
            ]
    return "\n".join(lines) + "\n"
