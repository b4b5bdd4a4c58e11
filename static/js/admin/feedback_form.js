// The form of a feedback type: what a patient sees of each band follows every key.

import { showPreview } from "garry/admin/form_preview";

const form = document.querySelector("#feedbacktype_form");
const preview = document.querySelector(".preview");
if (form && preview) showPreview(form, preview);
