// The form of a feedback type: its preview shows what a patient sees in each band.

import { showPreview } from "garry/admin/form_preview";

const form = document.querySelector("#feedbacktype_form");
const preview = document.querySelector(".preview");
if (form && preview) showPreview(form, preview);
