// Which feedback type is in force, and which comes with the next stride or the next phase.

import { _, fill } from "garry/shared/language";
import { phaseName, typeName } from "garry/shared/labels";

const AT_ONCE = "now:"; // before the name of a type that is to hold from the next stride on

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
    if (!session.next_valence) return "";
    const phase = nextPhase ? phaseName(nextPhase.name) : _("the next phase");
    return fill(_("from %(phase)s on; now %(type)s"), { phase, type: label(session, session.valence) });
  }

  function group(session, heading, prefix) {
    const options = document.createElement("optgroup");
    options.label = heading;
    const others = session.types.filter(({ slug }) => slug !== session.valence);
    options.append(...others.map(({ slug }) => new Option(label(session, slug), prefix + slug)));
    return options;
  }

  function fillChoice(session, hasNext) {
    const inForce = new Option(label(session, session.valence), session.valence);
    choice.replaceChildren(inForce, group(session, _("from the next step"), AT_ONCE));
    if (hasNext) choice.append(group(session, _("from the next phase"), ""));
  }

  function draw(session) {
    show("types", describeHistory(session));
    const nextPhase = session.phases.slice(session.phase.index + 1).find(({ feedback }) => feedback);
    choice.disabled = session.types.length < 2;
    show("type-when", describeNext(session, nextPhase));
    const stands = [session.valence, session.next_valence, Boolean(nextPhase), session.types.length].join();
    if (choice.dataset.of === stands) return; // an open list is left alone
    choice.dataset.of = stands;
    fillChoice(session, Boolean(nextPhase));
    choice.value = session.next_valence || session.valence;
  }

  choice.addEventListener("change", () => {
    choice.dataset.of = ""; // so that a refused choice is reset to the type in force
    if (!state.session) return;
    const atOnce = choice.value.startsWith(AT_ONCE);
    const slug = atOnce ? choice.value.slice(AT_ONCE.length) : choice.value;
    change(atOnce ? "valence_now" : "valence", slug).finally(() => draw(state.session));
  });

  return { draw };
}
