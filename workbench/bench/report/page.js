"use strict";
// Everything the page says is in its markup; this sorts, filters, opens and enlarges.
const table = document.querySelector("table.runs");

if (table) {
  const body = table.tBodies[0];
  const heads = [...table.tHead.rows[0].cells];
  const rows = [...body.rows];
  const section = (row) => document.getElementById(row.dataset.run);

  // --- sort -----------------------------------------------------------------------------------

  const order = new Intl.Collator("en", { numeric: true });
  const asNumber = (text) => (/^-?(\d|inf)/.test(text) ? Number(text.replace("inf", "Infinity")) : NaN);

  // What has no value, or none that is a number, comes last whichever way the rest is sorted.
  function compare(a, b, numeric, sign) {
    if (numeric) [a, b] = [asNumber(a), asNumber(b)];
    const [noA, noB] = numeric ? [isNaN(a), isNaN(b)] : [a === "", b === ""];
    if (noA || noB) return noA - noB;
    return sign * (numeric ? (a > b) - (a < b) : order.compare(a, b));
  }

  function sort(column, sign) {
    const cell = (row) => row.cells[column].dataset;
    const numeric = /gap|seconds/.test(heads[column].className);
    const sorted = rows.slice().sort(
      (a, b) =>
        compare(cell(a).sort, cell(b).sort, numeric, sign) ||
        compare(cell(a).then ?? "", cell(b).then ?? "", true, sign),
    );
    body.append(...sorted);
    heads.forEach((head, i) =>
      head.setAttribute("aria-sort", i !== column ? "none" : sign > 0 ? "ascending" : "descending"),
    );
  }

  heads.forEach((head, column) =>
    head.querySelector("button").addEventListener("click", () =>
      sort(column, head.getAttribute("aria-sort") === "ascending" ? -1 : 1),
    ),
  );

  // --- filter ---------------------------------------------------------------------------------

  const words = document.getElementById("words");
  const outcome = document.getElementById("outcome");
  const texts = new Map(
    rows.map((row) => {
      const cells = [...row.cells].map((cell) => cell.textContent.trim());
      return [row, [...cells, row.dataset.words].join(" ").toLowerCase()];
    }),
  );

  function fits(row) {
    const wanted = outcome.value;
    const state = row.dataset.state;
    if (wanted === "holds" && state !== "holds") return false;
    if (wanted === "open" && state === "holds") return false;
    if (wanted.startsWith("=") && wanted.slice(1) !== row.dataset.outcome) return false;
    return words.value.toLowerCase().split(/\s+/).every((word) => texts.get(row).includes(word));
  }

  function filter() {
    let shown = 0;
    for (const row of rows) {
      const fit = fits(row);
      row.hidden = section(row).hidden = !fit;
      shown += fit;
    }
    document.getElementById("nothing").hidden = shown > 0;
    document.getElementById("count").textContent =
      shown === rows.length ? "" : `${shown} of ${rows.length}`;
    label();
  }

  words.form.hidden = false;
  words.form.addEventListener("submit", (event) => event.preventDefault());
  words.addEventListener("input", filter);
  outcome.addEventListener("change", filter);

  // --- open -----------------------------------------------------------------------------------

  function mount(details) {
    for (const template of details.querySelectorAll("template")) {
      template.replaceWith(template.content);
    }
  }

  const all = document.getElementById("all");
  const shown = () => rows.map(section).filter((details) => !details.hidden);
  const allOpen = () => shown().length > 0 && shown().every((details) => details.open);
  const label = () => (all.textContent = allOpen() ? "close all" : "open all");

  all.addEventListener("click", () => {
    const open = !allOpen();
    for (const details of shown()) details.open = open;
  });

  document.addEventListener(
    "toggle",
    (event) => {
      if (!event.target.matches("details.run")) return;
      if (event.target.open) mount(event.target);
      label();
    },
    true, // this event does not bubble
  );

  function visit() {
    let id = location.hash.slice(1);
    try {
      id = decodeURIComponent(id);
    } catch {
      // not encoded by this page: taken as it is
    }
    const details = document.getElementById(id);
    if (!details?.matches("details.run")) return;
    if (details.hidden) {
      words.value = outcome.value = "";
      filter();
    }
    details.open = true;
    mount(details); // before scrolling: the figures take room
    details.scrollIntoView();
    details.querySelector("summary").focus({ preventScroll: true });
  }

  addEventListener("hashchange", visit);
  document.addEventListener("click", (event) => {
    const link = event.target.closest("a[href^='#']");
    if (link && link.hash === location.hash) visit(); // the browser sees no change
  });

  all.hidden = false;
  filter(); // a reloaded page keeps what was typed
  visit();

  // --- enlarge --------------------------------------------------------------------------------

  const large = document.getElementById("large");
  const sheet = large.querySelector(".sheet");
  let figures = [];
  let at = 0;

  function show(index) {
    at = (index + figures.length) % figures.length;
    const image = figures[at].cloneNode();
    sheet.replaceChildren(image);
    large.querySelector("p").textContent = image.alt;
  }

  document.addEventListener("click", (event) => {
    const button = event.target.closest("button.enlarge");
    if (!button) return;
    figures = [...button.closest(".figures").querySelectorAll("img")];
    show(figures.indexOf(button.querySelector("img")));
    large.showModal();
  });
  large.addEventListener("click", () => large.close());
  large.addEventListener("close", () => sheet.replaceChildren());
  large.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (step) show(at + step);
  });
}
