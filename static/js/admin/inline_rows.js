// On a phone each row of an inline table is a card (css/admin/admin.css): its cells carry their columns' names. Rows
// that are added are copies of the empty one.
for (const table of document.querySelectorAll(".tabular table")) {
  const names = [...table.tHead.rows[0].cells].map((cell) => cell.textContent.trim());
  table.classList.add("as-cards");
  for (const row of table.querySelectorAll("tr.form-row"))
    for (const [index, cell] of [...row.cells].entries()) if (names[index]) cell.dataset.label = names[index];
}
