// Alarms of other sessions on every page of a therapist: asked for while the page is seen, and acknowledged there.

import { minutesAgo } from "garry/shared/format";

const EVERY_MS = 2_500;
const place = document.querySelector("[data-alarms]");
let shown = "";

// Whether the start page's list of today marks others than those who fell.
function isListOld() {
  const fallen = new Set([...place.querySelectorAll("[data-fell]")].map(({ dataset }) => dataset.fell));
  const listed = [...document.querySelectorAll(".start:not(.chosen) .today a")];
  return listed.some((row) => fallen.has(row.getAttribute("href")) !== row.classList.contains("fell"));
}

async function look() {
  if (!document.hidden) {
    try {
      // Watching is no activity: it does not keep anybody signed in.
      const answer = await fetch(place.dataset.alarms, { headers: { "Garry-Watching": "yes" }, redirect: "error" });
      const found = answer.ok ? (await answer.text()).trim() : "";
      // The token in the forms is another each time.
      const [now, before] = [found, shown].map((text) => text.replace(/<input[^>]*>/g, ""));
      if (answer.ok && now !== before) place.innerHTML = shown = found;
      if (answer.ok && isListOld()) return location.reload();
      for (const since of place.querySelectorAll("[data-since]")) {
        const text = minutesAgo(since.dataset.since);
        if (since.textContent !== text) since.textContent = text;
      }
    } catch {
      // asked again
    }
  }
  setTimeout(look, EVERY_MS);
}

place.addEventListener("submit", async (event) => {
  event.preventDefault();
  const form = event.target;
  const button = form.querySelector("button");
  button.disabled = true;
  try {
    const answer = await fetch(form.action, { method: "POST", body: new FormData(form) });
    // A page that marks who fell shows what is now.
    if (answer.ok) document.querySelector(".fell") ? location.reload() : form.remove();
  } catch {
    // it stays, and may be tapped again
  }
  button.disabled = false;
});

// The page begins below them, however many there are.
new ResizeObserver(() => {
  document.documentElement.style.setProperty("--band", `${place.getBoundingClientRect().height}px`);
}).observe(place);
look();
