// The first steps of a clinic, and those of a trial: what is there is looked at every two seconds.

const EVERY_MS = 2_000;
const root = document.querySelector("[data-state]");

async function look() {
  try {
    const answer = await fetch(root.dataset.state, { cache: "no-store" });
    for (const [slug, [isDone, words]] of Object.entries(await answer.json())) draw(slug, isDone, words);
    const next = root.querySelector(".steps li:not(.done, [data-skipped])");
    for (const step of root.querySelectorAll(".steps li")) step.classList.toggle("next", step === next);
  } catch {
    // asked again
  }
  setTimeout(look, EVERY_MS);
}

function draw(slug, isDone, words) {
  if (isDone && root.dataset.now === slug) location.replace(location.pathname); // to the next one
  const step = root.querySelector(`[data-step=${slug}]`);
  const sign = step?.querySelector("[data-sign]");
  step?.classList.toggle("done", isDone);
  if (sign) sign.textContent = isDone ? "✓" : sign.dataset.sign;
  const live = root.querySelector(`[data-live=${slug}]`);
  if (!live) return;
  // What is done is folded away: the next step is what leads on.
  if (isDone && !live.classList.contains("done")) root.querySelector("details:not([name])")?.removeAttribute("open");
  live.classList.toggle("done", isDone);
  if (live.textContent !== words) live.textContent = words;
  for (const part of root.querySelectorAll("[data-when]")) part.hidden = (part.dataset.when === "done") !== isDone;
  const next = root.querySelector("[name=skip]");
  next?.classList.toggle("primary", isDone);
  next?.classList.toggle("quiet", !isDone);
}

setTimeout(look, EVERY_MS);
