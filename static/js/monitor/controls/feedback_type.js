// Which feedback type is in force, and which comes with the next phase.

import { _, fill } from "garry/shared/language";
import { phaseName, typeName } from "garry/shared/labels";

export function createFeedbackType({ state, show, change }) {
  const choice = document.querySelector("[data-type]");

  const label = (session, slug) => typeName(slug, session.types.find((type) => type.slug === slug)?.label);

  function describeHistory(session) {
    const first = label(session, session.began);
    if (!session.changed_to.length) return first;
    const others = session.changed_to.map((slug) => label(session, slug)).join(", ");
    return fill(_("%(first)s, changed to %(others)s"), { first, others });
  }

  function describeNext(session, nextPhase) {
    if (choice.disabled) return _("no further feedback phase");
    if (!session.next_valence) return _("of the next phase: as now");
    const phase = nextPhase ? phaseName(nextPhase.name) : _("the next phase");
    return fill(_("from %(phase)s on; now %(type)s"), { phase, type: label(session, session.valence) });
  }

  function draw(session) {
    show("types", describeHistory(session));
    if (choice.options.length !== session.types.length) {
      choice.replaceChildren(...session.types.map(({ slug }) => new Option(label(session, slug), slug)));
    }
    const wanted = session.next_valence || session.valence;
    if (choice.dataset.of !== wanted) choice.value = choice.dataset.of = wanted; // leaves an open select alone
    const nextPhase = session.phases.slice(session.phase.index + 1).find(({ feedback }) => feedback);
    choice.disabled = session.types.length < 2 || !nextPhase;
    show("type-when", describeNext(session, nextPhase));
  }

  choice.addEventListener("change", () => {
    choice.dataset.of = ""; // so that a refused choice is reset to the type in force
    if (state.session) change("valence", choice.value).finally(() => draw(state.session));
  });

  return { draw };
}
