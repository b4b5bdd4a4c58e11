// What is as it was cannot be published: the button waits for a change.
const form = document.querySelector("main form");
const fields = [...form.querySelectorAll("input:not([type=hidden]), textarea")];

const look = () => {
  form.querySelector(".primary").disabled = fields.every(({ value, defaultValue }) => value === defaultValue);
};

form.addEventListener("input", look);
look();
