// Scores: a tab for each board, and a list that glides once to the newest score, which then turns blue.
const GLIDE_MS = 2000;
const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
const tabs = [...document.querySelectorAll("[role=tab]")];
const title = document.querySelector("h1");
let gliding = 0; // the frame that is asked for

function boardOf(tab) {
  return document.getElementById(tab.getAttribute("aria-controls"));
}

function placeOf(board, row) {
  const middle = row.offsetTop + row.offsetHeight / 2 - board.offsetTop - board.clientHeight / 2;
  return Math.max(0, Math.min(middle, board.scrollHeight - board.clientHeight));
}

function goTo(board) {
  const row = board.querySelector(".you");
  if (row) board.scrollTop = placeOf(board, row);
}

function glide(board) {
  const row = board.querySelector(".you");
  if (!row) return;
  const end = placeOf(board, row);
  if (still) {
    board.scrollTop = end;
    return;
  }
  board.classList.add("gliding");
  const land = () => {
    cancelAnimationFrame(gliding);
    board.classList.remove("gliding");
  };
  for (const touch of ["pointerdown", "wheel", "keydown"]) {
    addEventListener(touch, land, { once: true, passive: true });
  }
  let began;
  const move = (now) => {
    began ??= now;
    const share = Math.min(1, (now - began) / GLIDE_MS);
    board.scrollTop = end * (1 - (1 - share) ** 3);
    if (share < 1) gliding = requestAnimationFrame(move);
    else land();
  };
  gliding = requestAnimationFrame(move);
}

function choose(tab) {
  for (const each of tabs) {
    const chosen = each === tab;
    each.setAttribute("aria-selected", chosen);
    each.tabIndex = chosen ? 0 : -1;
    boardOf(each).hidden = !chosen;
  }
  if (tab.dataset.title) title.textContent = tab.dataset.title;
  goTo(boardOf(tab));
}

for (const [index, tab] of tabs.entries()) {
  tab.addEventListener("click", () => choose(tab));
  tab.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const next = tabs.at((index + step) % tabs.length);
    choose(next);
    next.focus();
  });
}
const boards = [...document.querySelectorAll("section.board")];
addEventListener("resize", () => boards.filter((board) => !board.hidden).forEach(goTo));
for (const board of boards) {
  const rows = board.querySelectorAll("li:not(.you)");
  // What the edge would cut is not shown.
  const show = (seen) => seen.forEach((row) => row.target.classList.toggle("cut", row.intersectionRatio < 0.95));
  const watch = new IntersectionObserver(show, { root: board, threshold: 0.95 });
  rows.forEach((row) => watch.observe(row));
}
if (boards.length) glide(boards[0]);
