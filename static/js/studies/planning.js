// The plan of a study: its size follows while it is typed, and nothing that is wrong stays folded.
const form = document.querySelector("form[data-size]");
const answer = form.querySelector("output");
const take = answer.parentElement.querySelector("button");
const PAUSE_MS = 250; // in typing
let latest = 0;
let waiting = 0;

async function tellSize() {
  const mine = ++latest;
  const sent = await fetch(form.dataset.size, { method: "POST", body: new FormData(form) });
  if (!sent.ok || mine !== latest) return;
  const { words, participants } = await sent.json();
  answer.textContent = words;
  answer.parentElement.hidden = !words;
  take.hidden = !participants || form.participants.value === String(participants);
  take.textContent = take.dataset.label.replace("{count}", participants);
  take.value = participants;
}

// What only a follow-up tells cannot be chosen until one is planned.
function offerOutcomes() {
  const isPlanned = form.follow_up_days.value.trim() !== "";
  for (const one of form.querySelectorAll("option[value*=follow_up], [type=checkbox][value*=follow_up]")) {
    one.disabled = !isPlanned && !one.selected && !one.checked;
  }
}

function follow() {
  offerOutcomes();
  clearTimeout(waiting);
  // Where the server is away for a moment, the form can be sent all the same.
  waiting = setTimeout(() => tellSize().catch(() => {}), PAUSE_MS);
}

form.addEventListener("input", follow);
take.addEventListener("click", () => {
  form.participants.value = take.value;
  follow();
});
form.addEventListener(
  "invalid",
  (event) => {
    for (let at = event.target; at; at = at.parentElement) if (at.tagName === "DETAILS") at.open = true;
  },
  true,
);
follow();
