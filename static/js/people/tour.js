// Where somebody is in the tour (rehab/people/web/tour.py), kept in this browser: what has `data-tour-to` leads there.

const keep = (number) => {
  document.cookie = `garry_tour=${number}; path=/; max-age=${number === "0" ? 0 : 31536000}; samesite=lax`;
};

const shown = document.querySelector("[data-tour]");
if (shown) keep(shown.dataset.tour); // a page may be of the next step already
document.addEventListener("click", ({ target }) => {
  const way = target.closest("[data-tour-to]");
  if (!way) return;
  keep(way.dataset.tourTo);
  if (!way.href) location.reload();
});
