"use strict";
// Tables that are sorted by their headings and show only the rows that have all words of a filter.
(() => {
  const order = (row, column) => row.cells[column].dataset.order;

  function compare(a, b) {
    if (a === undefined || b === undefined) return (a === undefined) - (b === undefined);
    const [x, y] = [Number(a), Number(b)];
    return Number.isNaN(x) || Number.isNaN(y) ? a.localeCompare(b) : x - y;
  }

  function sort(table, heading) {
    const column = heading.cellIndex;
    const descends = heading.getAttribute("aria-sort") === "ascending";
    for (const other of table.tHead.querySelectorAll("th")) other.setAttribute("aria-sort", "none");
    heading.setAttribute("aria-sort", descends ? "descending" : "ascending");
    const body = table.tBodies[0];
    const rows = [...body.rows].sort((a, b) => {
      const [x, y] = [order(a, column), order(b, column)];
      // What is not known comes last, whichever way round.
      if (x === undefined || y === undefined) return compare(x, y);
      return descends ? compare(y, x) : compare(x, y);
    });
    body.append(...rows);
  }

  function words(row) {
    return [...row.cells].map((cell) => `${cell.dataset.found || ""} ${cell.textContent}`).join(" ").toLowerCase();
  }

  for (const table of document.querySelectorAll("table.sortable")) {
    for (const heading of table.tHead.querySelectorAll("th")) {
      heading.querySelector("button").addEventListener("click", () => sort(table, heading));
    }
  }
  for (const input of document.querySelectorAll("input[data-table]")) {
    const table = document.getElementById(input.dataset.table);
    const count = document.getElementById(`${input.dataset.table}-count`);
    const rows = [...table.tBodies[0].rows].map((row) => [row, words(row)]);
    input.addEventListener("input", () => {
      const wanted = input.value.toLowerCase().split(/\s+/);
      let shown = 0;
      for (const [row, text] of rows) {
        row.hidden = !wanted.every((word) => text.includes(word));
        shown += !row.hidden;
      }
      count.textContent = `${shown} of ${rows.length}`;
    });
  }
})();
