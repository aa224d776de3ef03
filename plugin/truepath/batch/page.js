// Sorting by a column and hiding of rows: both only when somebody asks for it.
const table = document.getElementById("programs");
const columns = document.getElementById("columns");
const body = table.tBodies[0];
const rows = [...body.rows];
const words = new Map(rows.map((row) => [row, row.textContent.toLowerCase()]));
const search = document.getElementById("search");
const boxes = [...document.querySelectorAll("#controls input[type=checkbox]")];

function filter() {
  const asked = search.value.toLowerCase().split(/\s+/).filter(Boolean);
  const kept = new Set(boxes.filter((box) => box.checked).map((box) => box.value));
  let shown = 0;
  for (const row of rows) {
    const text = words.get(row);
    row.hidden = !kept.has(row.dataset.status) || !asked.every((word) => text.includes(word));
    shown += row.hidden ? 0 : 1;
  }
  document.getElementById("shown").textContent = `${shown} of ${rows.length} shown`;
}

function sort(header) {
  const column = header.cellIndex;
  const up = header.getAttribute("aria-sort") !== "ascending";
  for (const other of columns.cells) other.setAttribute("aria-sort", "none");
  header.setAttribute("aria-sort", up ? "ascending" : "descending");
  const isNumber = header.dataset.kind === "number";
  const keys = new Map(rows.map((row) => [row, row.cells[column].dataset.sort]));
  const order = isNumber
    ? (a, b) => Number(keys.get(a)) - Number(keys.get(b))
    : (a, b) => keys.get(a).localeCompare(keys.get(b), "en", { numeric: true });
  rows.sort((a, b) => (up ? order(a, b) : order(b, a)));
  body.append(...rows);
}

for (const header of columns.cells) {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = header.textContent;
  button.addEventListener("click", () => sort(header));
  header.replaceChildren(button);
}
for (const input of [search, ...boxes]) input.addEventListener("input", filter);
document.getElementById("controls").hidden = false;
filter();

// What is folded away on the screen is needed on paper.
let opened = [];
window.addEventListener("beforeprint", () => {
  opened = [...document.querySelectorAll("details:not([open])")];
  for (const details of opened) details.open = true;
});
window.addEventListener("afterprint", () => {
  for (const details of opened) details.open = false;
});
