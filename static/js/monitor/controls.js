// What a PT steers with, drawn as the session stands: nothing is shown as changed before the server has it.

import { _, fill, number } from "garry/shared/language";
import { phaseName, typeName } from "garry/shared/labels";

const GAINS = [0.85, 0.9, 0.95, 1];
const percent = (share) => `${number(100 * share)} %`;

const PAUSED = {
  restart: _("The server was restarted; nothing was lost. Go on when ready."),
  patient: _("Paused on the patient’s page. Go on when ready."),
  therapist: _("Paused by the therapist."),
};

function drawPause(session) {
  const note = document.querySelector(".notice.why");
  note.hidden = session.state !== "paused";
  const words = PAUSED[session.pause_reason] ?? _("Paused.");
  if (note.textContent !== words) note.textContent = words; // said once, not with each drawing
}

function press(group, value) {
  for (const button of document.querySelectorAll(`[data-${group}] button`)) {
    const on = button.value === String(value);
    button.classList.toggle("on", on);
    button.setAttribute("aria-pressed", on);
  }
}

// Which feedback type is in force, and which comes with the next phase.
export function drawTypes(session, show) {
  const label = (slug) => typeName(slug, session.types.find((type) => type.slug === slug)?.label);
  const next = session.phases.slice(session.phase.index + 1).find(({ feedback }) => feedback);
  const later = session.changed_to.map(label).join(", ");
  show(
    "types",
    later
      ? fill(_("%(first)s, changed to %(others)s"), { first: label(session.began), others: later })
      : label(session.began),
  );
  const choice = document.querySelector("[data-type]"),
    wanted = session.next_valence || session.valence;
  if (choice.options.length !== session.types.length)
    choice.replaceChildren(...session.types.map(({ slug }) => new Option(label(slug), slug)));
  if (choice.dataset.of !== wanted) choice.value = choice.dataset.of = wanted; // not while somebody chooses
  choice.disabled = session.types.length < 2 || !next;
  show(
    "type-when",
    choice.disabled
      ? _("no further feedback phase")
      : session.next_valence
        ? fill(_("from %(phase)s on; now %(type)s"), {
            phase: next ? phaseName(next.name) : _("the next phase"),
            type: label(session.valence),
          })
        : _("of the next phase: as now"),
  );
}

const MAIN = {
  ready: ["start", _("Start"), "play"],
  running: ["pause", _("Pause"), "pause"],
  paused: ["resume", _("Go on"), "play"],
};

export function drawControls(session, show) {
  drawPause(session);
  drawTypes(session, show);
  press("words", session.words_shown ? 1 : 0);
  press("chart", session.chart);
  show("goal", session.goal === null ? "–" : number(session.goal, 2));
  show("threshold", percent(session.activation_threshold));
  press("levels", session.robot_intensity);
  const gains = document.querySelector("[data-gains]");
  const wanted = [...new Set([...GAINS, session.gain])].sort((a, b) => a - b);
  if (gains.dataset.of !== wanted.join()) {
    gains.dataset.of = wanted.join();
    gains.replaceChildren(
      ...wanted.map((gain) =>
        Object.assign(document.createElement("button"), { textContent: number(gain, 2), value: gain }),
      ),
    );
  }
  press("gains", session.gain);
  const next = session.phases[session.phase.index + 1];
  show("next-phase", next ? fill(_("Go to %(phase)s"), { phase: phaseName(next.name) }) : _("No further phase"));
  document.querySelector("[data-next-phase]").disabled = !next;
  const main = document.querySelector("[data-main]"),
    [kind, words, icon] = MAIN[session.state] ?? [];
  main.disabled = !kind;
  if (main.value !== (kind ?? "")) {
    main.value = kind ?? "";
    main.innerHTML = kind
      ? `<svg class="ic" aria-hidden="true"><use href="${document.body.dataset.icons}#${icon}"></use></svg><span>${words}</span>`
      : _("Ended");
  }
  document.querySelector("[data-end]").disabled = !kind;
}
