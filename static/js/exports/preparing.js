// Lets an export be written: asks for some more sessions until all are there. Leaving the page stops it; coming back
// goes on, since what is written stays.

const form = document.querySelector(".preparing[data-advance]");
const RETRY_MS = 3000;

async function advance() {
  const answer = await fetch(form.dataset.advance, { method: "POST", body: new FormData(form) });
  const told = await answer.json();
  if (!answer.ok) throw new Error(told.message);
  form.querySelector("progress").value = told.done;
  form.querySelector(".done").textContent = told.done;
  return told.done >= told.total;
}

async function prepare() {
  const wrong = form.querySelector("[role=alert]");
  for (let done = false; !done;) {
    try {
      done = await advance();
      wrong.hidden = true;
    } catch (problem) {
      wrong.textContent = problem.message;
      wrong.hidden = false;
      await new Promise((resume) => setTimeout(resume, RETRY_MS));
    }
  }
  form.querySelector("a[download]").hidden = false;
}

if (form) prepare();
