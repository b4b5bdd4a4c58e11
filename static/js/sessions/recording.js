// A recording goes to the server in parts, then the form asks what its columns are.

const form = document.getElementById("upload");
const { parts, partBytes, bytesMax, failed, tooLarge } = form.dataset;
const problem = form.querySelector(".problem");
const button = form.querySelector("button");

function tell(text) {
  problem.textContent = text;
  problem.hidden = !text;
  button.disabled = false;
}

const endingOf = (file) => file.name.slice(file.name.lastIndexOf(".")).toLowerCase();

async function send(file, place) {
  const ending = endingOf(file);
  const token = form.elements.csrfmiddlewaretoken.value;
  for (let at = 0; at < file.size || at === 0; at += Number(partBytes)) {
    const answer = await fetch(`${parts}?${new URLSearchParams({ at, ending, file: place })}`, {
      method: "POST",
      headers: { "X-CSRFToken": token, "Content-Type": "application/octet-stream" },
      body: file.slice(at, at + Number(partBytes)),
    });
    if (!answer.ok) throw new Error((await answer.json()).message);
  }
}

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const files = [...form.querySelector("[type=file]").files];
  button.disabled = true;
  tell("");
  if (files.some((file) => file.size > Number(bytesMax))) return tell(tooLarge);
  button.disabled = true;
  try {
    for (const [place, file] of files.entries()) await send(file, place);
  } catch (refused) {
    return tell(refused instanceof TypeError ? failed : refused.message || failed);
  }
  form.elements.ending.value = files.map(endingOf).join(",");
  form.elements.files.value = files.map(({ name }) => name).join("/");
  const [file] = files;
  form.elements.name.value = file.name.slice(0, file.name.lastIndexOf(".")).slice(0, 60);
  form.submit();
});
