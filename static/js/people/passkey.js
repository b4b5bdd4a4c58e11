// A form that the browser's passkeys fill in: [data-passkey] has what the server asks, data-how says
// whether one is made ("create") or used ("get").

import { _ } from "garry/shared/language";

const READ = {
  create: (asked) => PublicKeyCredential.parseCreationOptionsFromJSON(asked),
  get: (asked) => PublicKeyCredential.parseRequestOptionsFromJSON(asked),
};

for (const form of document.querySelectorAll("[data-passkey]")) {
  const say = form.querySelector("[data-say]");
  const able = window.PublicKeyCredential?.parseCreationOptionsFromJSON;
  if (!able) {
    form.querySelector("button").disabled = true;
    say.textContent = _("This browser knows no passkeys. Take a newer one, or an authenticator app.");
    continue;
  }
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const { how, passkey } = form.dataset;
    try {
      const publicKey = READ[how](JSON.parse(passkey));
      const answer = await navigator.credentials[how]({ publicKey });
      form.elements.passkey.value = JSON.stringify(answer.toJSON());
      form.submit();
    } catch (problem) {
      say.textContent =
        problem.name === "InvalidStateError"
          ? _("This device already has a passkey for your account.")
          : _("No passkey was given. Try again.");
    }
  });
}
