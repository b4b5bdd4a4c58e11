// Shows the password that is typed, for as long as somebody wants to see it.

const password = document.querySelector("[name=password]");
document.querySelector("[data-show]").addEventListener("change", ({ target }) => {
  password.type = target.checked ? "text" : "password";
});
