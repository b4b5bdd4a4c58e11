// Django's light and dark theme (admin/js/theme.js) for our colors. Not a module: it must run before the first paint.
{
  const page = document.documentElement;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const follow = () => {
    const wanted = page.dataset.theme;
    page.dataset.pt = wanted === "dark" || (wanted !== "light" && dark.matches) ? "dark" : "light";
  };
  follow();
  dark.addEventListener("change", follow);
  new MutationObserver(follow).observe(page, { attributeFilter: ["data-theme"] });
}
