// A form that the browser's passkeys fill in: [data-passkey] has the server's options, data-how says whether a passkey
// is created ("create") or used ("get").

import { _ } from "garry/shared/language";

const PARSE = {
  create: (asked) => PublicKeyCredential.parseCreationOptionsFromJSON(asked),
  get: (asked) => PublicKeyCredential.parseRequestOptionsFromJSON(asked),
};

for (const form of document.querySelectorAll("[data-passkey]")) {
  const status = form.querySelector("[data-say]");
  const isSupported = window.PublicKeyCredential?.parseCreationOptionsFromJSON;
  if (!isSupported) {
    form.querySelector("button").disabled = true;
    status.textContent = _("This browser does not support passkeys. Use a newer one, or an authenticator app.");
    continue;
  }
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const { how, passkey } = form.dataset;
    try {
      const publicKey = PARSE[how](JSON.parse(passkey));
      const answer = await navigator.credentials[how]({ publicKey });
      form.elements.passkey.value = JSON.stringify(answer.toJSON());
      form.submit();
    } catch (problem) {
      status.textContent =
        problem.name === "InvalidStateError"
          ? _("This device already has a passkey for your account.")
          : _("No passkey was given. Try again.");
    }
  });
}
