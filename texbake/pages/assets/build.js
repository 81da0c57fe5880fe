"use strict";
// Sorts and filters the rows of a build's table.
(function () {
  const section = document.getElementById("assets"), body = section.querySelector("tbody");
  const control = function (name) { return section.querySelector(`[name="${name}"]`); };
  const names = [...section.querySelectorAll("th button")].map(function (b) { return b.dataset.column; });
  const words = new Intl.Collator(undefined, { numeric: true });
  const rows = [...body.rows].map(function (row, place) {
    const keys = {};
    names.forEach(function (name, k) {
      const key = row.cells[k].dataset.key;
      keys[name] = key === undefined ? null : name === "name" ? key : Number(key);
    });
    return { row: row, place: place, keys: keys, status: row.className, text: row.cells[0].textContent.toLowerCase() };
  });

  // Names as ranks: words are compared once, and not at each sorting.
  rows.slice().sort(function (a, b) { return words.compare(a.keys.name, b.keys.name); })
    .forEach(function (item, rank) { item.keys.name = rank; });

  let column = "", falls = false;
  const compare = function (a, b) {
    const x = a.keys[column], y = b.keys[column];
    if (x === null || y === null) return (x === null) - (y === null) || a.place - b.place;
    return (falls ? y - x : x - y) || a.place - b.place;
  };
  const sort = function () {
    rows.sort(column ? compare : function (a, b) { return a.place - b.place; });
    body.replaceChildren();  // to move rows from among the others is fifty times slower
    body.append(...rows.map(function (item) { return item.row; }));
    for (const head of section.querySelectorAll("th")) {
      const is = head.firstElementChild.dataset.column === column;
      if (is) head.setAttribute("aria-sort", falls ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    }
    control("order").value = column;
  };
  const filter = function () {
    const status = control("shown").value, text = control("find").value.trim().toLowerCase();
    let shown = 0;
    for (const item of rows) {
      const fits = (!status || item.status === status) && item.text.includes(text);
      item.row.hidden = !fits;
      shown += fits;
    }
    section.querySelector(".count").textContent =
      shown === rows.length ? "" : `${shown.toLocaleString("en")} of ${rows.length.toLocaleString("en")}`;
  };
  const first = function (name) {
    return section.querySelector(`[data-column="${name}"]`).dataset.first === "down";
  };
  section.addEventListener("click", function (event) {
    const name = event.target.dataset && event.target.dataset.column;
    if (!name) return;
    falls = name === column ? !falls : first(name);
    column = name;
    sort();
  });
  control("order").addEventListener("input", function () {
    column = control("order").value;
    falls = column ? first(column) : false;
    sort();
  });
  for (const name of ["shown", "find"]) control(name).addEventListener("input", filter);
  section.dataset.state = "ready";
})();
