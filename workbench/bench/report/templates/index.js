// The page says everything in its markup; this sorts and filters it, and keeps both in the address.
const table = document.querySelector("table.runs");

if (table) {
  const head = table.tHead.rows[0];
  const groups = [...table.tBodies];
  const flat = table.createTBody(); // all runs in one order, where they are not by theme
  const [words, outcome] = ["words", "outcome"].map((id) => document.getElementById(id));
  const runs = [...table.querySelectorAll("tr.run")].map((row) => {
    const cells = [...row.cells].map((cell) => cell.textContent.trim()).join(" ");
    return {
      row,
      group: row.parentElement,
      theme: row.parentElement.dataset.theme,
      problem: row.cells[0].dataset.sort,
      state: row.dataset.state,
      outcome: row.dataset.outcome,
      parameters: JSON.parse(row.dataset.parameters ?? "{}"),
      words: `${cells} ${row.dataset.words}`.toLowerCase(),
    };
  });
  let state = readState(location.hash);

  // --- columns of parameters ------------------------------------------------------------------

  const cellOf = (row, column) => row.cells[[...head.cells].findIndex((one) => one.dataset.column === column)];

  function setColumns(names) {
    const now = [...head.querySelectorAll(".parameter")].map((one) => one.textContent);
    if (now.join("\n") === names.join("\n")) return;
    table.querySelectorAll(".parameter").forEach((one) => one.remove());
    const before = head.querySelector(".parameters");
    for (const name of names) {
      const cell = document.createElement("th");
      cell.className = "parameter";
      cell.dataset.column = `p:${name}`;
      cell.scope = "col";
      cell.setAttribute("role", "columnheader");
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = name;
      cell.append(button);
      before.before(cell);
    }
    for (const { row, parameters } of runs) {
      const place = row.querySelector(".parameters");
      for (const name of names) {
        const cell = document.createElement("td");
        cell.className = "parameter";
        cell.setAttribute("role", "cell");
        cell.dataset.label = name;
        cell.dataset.sort = cell.textContent = parameters[name] ?? "";
        place.before(cell);
      }
    }
    table.classList.toggle("split", names.length > 0);
    table.querySelectorAll("tr.theme th").forEach((one) => (one.colSpan = head.cells.length));
  }

  // --- show -----------------------------------------------------------------------------------

  function sortRuns() {
    const sign = state.sort.startsWith("-") ? -1 : 1;
    const column = state.sort.replace(/^-/, "");
    const heads = [...head.cells];
    const chosen = heads.find((one) => one.dataset.column === column);
    for (const one of heads) {
      one.setAttribute("aria-sort", one !== chosen ? "none" : sign > 0 ? "ascending" : "descending");
    }
    for (const group of groups) group.hidden = Boolean(chosen);
    flat.hidden = !chosen;
    if (!chosen) {
      for (const { row, group } of runs) group.append(row);
      return;
    }
    const numeric = ["gap", "seconds"].includes(column);
    const values = new Map(runs.map(({ row }) => [row, cellOf(row, column).dataset]));
    const sorted = runs.map(({ row }) => row).sort(
      (a, b) =>
        compareValues(values.get(a).sort, values.get(b).sort, numeric, sign) ||
        compareValues(values.get(a).then ?? "", values.get(b).then ?? "", true, sign),
    );
    flat.append(...sorted);
  }

  function show() {
    [words.value, outcome.value] = [state.q, state.outcome];
    if (outcome.value !== state.outcome) state.outcome = outcome.value = "";
    const shown = runs.filter((run) => fits(run, state));
    const fitting = new Set(shown);
    for (const run of runs) run.row.hidden = !fitting.has(run);
    setColumns(parameterColumns(shown));
    sortRuns();
    for (const group of groups) {
      group.rows[0].hidden = !shown.some((run) => run.group === group);
    }
    for (const link of document.querySelectorAll(".themes a")) {
      if (link.dataset.theme === state.theme) link.setAttribute("aria-current", "true");
      else link.removeAttribute("aria-current");
      link.hash = writeState({ ...state, theme: link.dataset.theme }) || "theme=";
    }
    document.getElementById("nothing").hidden = shown.length > 0;
    const some = shown.length < runs.length;
    document.getElementById("count").textContent = some ? `${shown.length} of ${runs.length}` : "";
    document.getElementById("clear").hidden = !some;
  }

  // What is typed replaces the address, so that the way back leads out of the page at once.
  function change(part) {
    state = { ...state, ...part };
    show();
    history.replaceState(null, "", `#${writeState(state)}`);
  }

  words.addEventListener("input", () => change({ q: words.value }));
  words.form.addEventListener("submit", (event) => event.preventDefault());
  outcome.addEventListener("change", () => change({ outcome: outcome.value }));
  document.getElementById("clear").addEventListener("click", () => change({ q: "", outcome: "", theme: "" }));
  head.addEventListener("click", (event) => {
    const cell = event.target.closest("button")?.closest("th");
    if (cell) change({ sort: nextSort(state.sort, cell.dataset.column) });
  });
  addEventListener("hashchange", () => {
    state = readState(location.hash);
    show();
  });

  document.querySelectorAll(".themes, .controls, #shared").forEach((one) => (one.hidden = false));
  show();
}
