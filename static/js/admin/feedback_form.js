// The form of a feedback type: its preview shows what a patient sees in each band, which is named by where it begins.

import { showPreview } from "garry/admin/form_preview";

const form = document.querySelector("#feedbacktype_form");
const preview = document.querySelector(".preview");

function nameBands() {
  for (const band of form.querySelectorAll(".inline-related:not(.empty-form)")) {
    const begins = band.querySelector("[name$=-from_percent]")?.value;
    if (begins) band.querySelector(".inline_label").textContent = preview.dataset.begins.replace("{percent}", begins);
  }
}

if (form && preview) {
  showPreview(form, preview);
  form.addEventListener("input", nameBands);
  nameBands();
}
