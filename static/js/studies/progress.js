// Simulated studies under way: what was found so far comes by itself.
const EVERY_MS = 3000;

async function refresh() {
  const answer = await fetch(location.href, { headers: { Accept: "text/html" } });
  if (!answer.ok) return;
  const page = new DOMParser().parseFromString(await answer.text(), "text/html");
  const found = page.getElementById("runs");
  if (found) document.getElementById("runs").replaceWith(found);
}

async function watch() {
  if (document.querySelector("#runs [data-works]")) {
    try {
      await refresh();
    } catch {
      // The server is away for a moment; the next try may find it.
    }
  }
  setTimeout(watch, EVERY_MS);
}

setTimeout(watch, EVERY_MS);
