// The check in a browser: logs are dropped or chosen, a worker judges them, and the reports appear below.

import { badge } from "./badge.js";
import { el } from "./elements.js";
import { plural } from "./text.js";

const root = document.documentElement;
const main = document.getElementById("main");
const textOf = (id) => document.getElementById(id).textContent;

// ---- The program: compressed, as text, inside this file. It is compiled once.
const compiled = (async () => {
  const compressed = Uint8Array.from(atob(textOf("wasm").trim()), (letter) => letter.charCodeAt(0));
  const unpacked = new Blob([compressed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return WebAssembly.compile(await new Response(unpacked).arrayBuffer());
})();
const workerAddress = URL.createObjectURL(new Blob([textOf("worker")], { type: "text/javascript" }));

// ---- The page.
const status = el("p", { role: "status", class: "dim" });
const meter = el("progress", { max: 1, hidden: true, "aria-label": "progress" });
const stop = el("button", { type: "button", hidden: true, onclick: () => interrupt({ why: "you cancelled it" }) }, "Cancel");
const choose = (label, options) => {
  const input = el("input", { type: "file", multiple: true, ...options });
  input.addEventListener("change", () => {
    const files = [...input.files].map((file) => ({ path: file.webkitRelativePath || file.name, file }));
    // Some browsers take a folder for files without a folder.
    start(files.every(({ path }) => path.includes("/")) ? [files] : files.map((file) => [file]));
    input.value = "";
  });
  return el("label", { class: "choose" }, label, input);
};
const zone = el(
  "div",
  { class: "panel drop", id: "drop" },
  el("p", {}, "Drop the logs of your flights here: .tlog, .bin, .log, .ulg, .hum, also as .gz, or the folder of a card."),
  el(
    "p",
    { class: "choices" },
    choose("Choose files", { id: "files" }),
    "webkitdirectory" in HTMLInputElement.prototype ? choose("Choose a folder", { id: "folder", webkitdirectory: true }) : null,
  ),
);
const list = el("div", { id: "logs" });
const beside = el("p", { class: "choices" });
const remarks = el("ul", { class: "dim", id: "remarks" });
const shown = el("div", { id: "shown", hidden: true });
document
  .getElementById("head")
  .append(
    el("h1", {}, "HUMS check"),
    el(
      "p",
      { class: "dim" },
      "Finds what is wrong with a flight. Nothing is uploaded: this page works without a network, and may not use one.",
    ),
  );
main.append(zone, beside, list, remarks, shown, el("p", { class: "running" }, status, meter, stop));

// ---- Saving and showing.
const save = (name, content, type) => {
  const address = URL.createObjectURL(new Blob([content], { type }));
  el("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 60000);
};
const button = (words, onclick) => el("button", { type: "button", onclick }, words);
const show = (title, srcdoc) => {
  // The report runs apart from this page, under the same policy.
  const frame = el("iframe", { title, sandbox: "allow-scripts allow-modals", srcdoc });
  frame.addEventListener("load", () => frame.setAttribute("data-ready", ""));
  shown.replaceChildren(el("h2", {}, title), frame);
  shown.hidden = false;
};
// Of several pages that were asked for, the last one is shown.
let asked = 0;
// A page is made when it is first asked for. `make` resolves to it, or to nothing if its run ended early. Returns what shows it.
const pageButtons = (host, words, title, make) => {
  let making = null;
  const page = async (use) => {
    making ??= make();
    const made = await making;
    if (made) await use(made);
    // It may be tried again.
    else making = null;
  };
  const open = () => {
    const mine = ++asked;
    return page(async ({ html }) => {
      const text = await html.text();
      if (mine === asked) show(title, text);
    });
  };
  host.append(
    button(words, () => open().then(() => shown.scrollIntoView({ behavior: "smooth" }))),
    button(`Save ${words.toLowerCase()}`, () => page(({ file, html }) => save(file, html, "text/html"))),
  );
  return open;
};

// ---- A log's verdict.
const LEVELS = ["ok", "advisory", "warning", "critical"];
const NOT_JUDGED = "Which checks were not judged, and why (with those that need a box or earlier flights)";
// The answer for each log, and for each vehicle of a log of several.
let logs = [];
// A block for each line, so that the rest of a long one stays below its beginning.
const linesOf = (text) => {
  const line = (words) => el("div", { style: `--in: ${words.search(/\S|$/)}ch` }, words.trimStart());
  return el("pre", { class: "screen" }, text.split("\n").map(line));
};
const addLog = (line, told, { screen, state, reasons }) => {
  const mark = badge();
  const level = LEVELS.includes(state) ? state : "stale";
  mark.set(level, told.error ? "not read" : state);
  // Its first line is the verdict.
  const [verdict, ...lines] = (told.error ?? screen).trimEnd().split("\n");
  const buttons = el("p", { class: "choices" });
  const node = el(
    "section",
    { class: "panel log", "data-log": told.log },
    el("h2", {}, mark.node, ` ${told.log}`),
    el("p", { class: `verdict ${level}` }, verdict),
    linesOf(lines.join("\n")),
  );
  if (reasons) node.append(el("details", {}, el("summary", {}, NOT_JUDGED), linesOf(reasons)));
  node.append(buttons);
  logs.push({ line, told, buttons, heading: node.firstChild });
  list.append(node);
};

// ---- Runs of the program, one at a time, each in a worker of its own: its memory ends with it.
// A run ends with `why` it ended early, or null, and the log that it read; itself it is null if other logs were given meanwhile.
let endRun = () => {};
let turn = 0;
const idle = (words) => {
  status.textContent = words;
  meter.hidden = stop.hidden = true;
  root.dataset.state = "done";
};
// Ends the run, and those that wait.
const interrupt = (result) => {
  turn++;
  endRun(result);
};
const early = (what, { why, name }) => `The ${what} ended early${name ? `, while reading ${name}` : ""}: ${why}.`;
// Once each: a report repeats those of the check. Why a log could not be read stands with its name.
const remark = (words) => {
  if (!/could not be read$/.test(words) && ![...remarks.children].some((item) => item.textContent === words))
    remarks.append(el("li", {}, words));
};
const run = (words, command, files, takeLine) => {
  const mine = turn;
  return compiled.then(
    (module) =>
      new Promise((resolve) => {
        // It may have been cancelled before it began.
        if (mine !== turn) return resolve(null);
        const own = new Worker(workerAddress);
        let name = null;
        const end = (result) => {
          own.terminate();
          resolve(result && { ...result, name });
        };
        endRun = end;
        status.textContent = words;
        meter.removeAttribute("value");
        meter.hidden = stop.hidden = false;
        own.onmessage = ({ data }) => {
          if (data.kind === "line") takeLine(data.line);
          else if (data.kind === "remark") remark(data.line.replace(/^hums: /, ""));
          else if (data.kind === "progress") {
            name = data.name;
            meter.value = data.part;
            status.textContent = `${words} ${name}, ${Math.round(data.part * 100)} %`;
          } else end(data);
        };
        own.onerror = ({ message }) => end({ why: `the program stopped (${message})` });
        own.postMessage({ module, command, files });
      }),
    (error) => ({ why: `this browser cannot run the program (${error.message}); use a newer one` }),
  );
};

// The page of this log; nothing if its run was cancelled, or ended early. One run after the other; `words` are shown after it.
let lastRun = Promise.resolve();
const pageOf = (command, files, log, words) => {
  const mine = turn;
  lastRun = lastRun.then(async () => {
    if (mine !== turn) return null;
    root.dataset.state = "busy";
    let made = null;
    const ended = await run("Reporting", command, files, (line) => {
      if (!line.startsWith("{")) return;
      const { page, log: of, html } = JSON.parse(line);
      // Out of the script's memory: reports are large.
      if (of === log) made = { file: page, html: new Blob([html]) };
    });
    if (!ended) return null;
    const why = ended.why ?? (made ? null : "see the remarks");
    idle(why ? early("report", { ...ended, why }) : words);
    return why ? null : made;
  });
  return lastRun;
};

// What was chosen or dropped has names of its own: two files or folders may have one name.
const named = (items) => {
  const taken = new Set();
  return items.flatMap((files) => {
    const [first] = files[0].path.split("/");
    let name = first;
    for (let number = 2; taken.has(name); number++) name = first.replace(/(\.[^.]+(\.gz)?)?$/, ` (${number})$1`);
    taken.add(name);
    return files.map(({ path, file }) => ({ path: name + path.slice(first.length), file }));
  });
};

// Of what is listed while more is given only the last is read.
let drops = 0;
// `items`: the files of each chosen or dropped file or folder; `unread`: sentences about others.
const start = async (items, unread = []) => {
  const given = named(items.filter((files) => files.length));
  // What runs goes on.
  if (given.length + unread.length === 0) return stop.hidden && idle("Nothing to read was given.");
  interrupt(null);
  drops++;
  asked++;
  root.dataset.state = "busy";
  logs = [];
  for (const node of [list, beside, remarks, shown]) node.replaceChildren();
  shown.hidden = true;
  unread.forEach(remark);
  if (given.length === 0) return idle("Nothing could be read.");
  const inputs = [...new Set(given.map(({ path }) => path.split("/")[0]))];
  let answer = {};
  const checked = await run("Checking", ["check", ...inputs], given, (line) => {
    const told = JSON.parse(line);
    if (told.screen != null) answer = told;
    else {
      addLog(line, told, answer);
      answer = {};
    }
  });
  if (!checked) return;
  const read = logs.filter(({ told }) => !told.error);
  if (logs.length > 1)
    beside.append(
      button("Save all findings", () => save("findings.jsonl", logs.map(({ line }) => `${line}\n`).join(""), "application/json")),
    );
  const failed = new Set(logs.filter(({ told }) => told.error).map(({ told }) => told.log));
  const count = new Set(read.map(({ told }) => told.log)).size;
  const counts = `${plural(count, "log")} checked${failed.size ? `, ${failed.size} not read` : ""}.`;
  const none = `No log could be read${logs.length ? "" : " in what was given"}.`;
  // Inputs with one of these logs. Segments of one log may be inputs, and only the first has its name.
  const isOf = (log, input) => log === input || log.startsWith(`${input}/`) || log.startsWith(`${input}:`);
  const begun = inputs.filter((input) => logs.some(({ told }) => isOf(told.log, input))).length;
  const end = checked.why ? `${early("check", checked)} ${begun} of ${plural(inputs.length, "input")}: ${counts}` : count ? counts : none;
  idle(end);
  const holding = (some) =>
    inputs.filter((input) => !failed.has(input) && (/\.hum$/i.test(input) || some.some(({ told }) => isOf(told.log, input))));
  const filesOf = (some) => given.filter(({ path }) => !failed.has(path) && some.includes(path.split("/")[0]));
  // All of them for each session, which is compared with others.
  const good = holding(read),
    cards = holding(read.filter(({ told }) => told.format === "hums"));
  if (read.reduce((sum, { told }) => sum + told.flights.length, 0) > 1)
    pageButtons(beside, "Flights side by side", "Flights side by side", () => pageOf(["compare", ...good], filesOf(good), null, end));
  for (const { line, told, buttons, heading } of read) {
    const isOfSeveral = read.filter((other) => other.told.log === told.log).length > 1;
    const system = isOfSeveral ? String(told.vehicle.system) : "-";
    const name = isOfSeveral ? `${told.log}, system ${system}` : told.log;
    heading.lastChild.textContent = ` ${name}`;
    const file = told.format === "hums" ? null : given.find(({ path }) => path === told.log);
    const [session, own, of] = file ? ["-", [told.log], [file]] : [told.log, cards, filesOf(cards)];
    const make = () => pageOf(["report", system, session, ...own], of, told.log, end);
    const open = pageButtons(buttons, "Report", `Report of ${name}`, make);
    const saved = `${name.replace(/[^\w.-]+/g, "_")}.json`;
    buttons.append(button("Save findings", () => save(saved, `${line}\n`, "application/json")));
    if (read.length === 1 && !checked.why) open();
  }
};

// ---- Dropping: files, and folders with all that is in them.
async function* entriesOf(folder) {
  const reader = folder.createReader();
  // It tells a part of its entries at a time.
  for (;;) {
    const part = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (part.length === 0) return;
    yield* part;
  }
}
// Adds the files of an entry, or of a handle, to `found`. Of one that cannot be read `unread` gets the name.
const collect = async (given, path, found, unread) => {
  try {
    const one = await given;
    if (one.getFile) found.push({ path, file: await one.getFile() });
    else if (one.isFile) found.push({ path, file: await new Promise((resolve, reject) => one.file(resolve, reject)) });
    else for await (const inner of one.values?.() ?? entriesOf(one)) await collect(inner, `${path}/${inner.name}`, found, unread);
  } catch (error) {
    unread.push(`${path}: was dropped, and cannot be read: ${error.message}.`);
  }
};
// Begins at once: what was dropped is known only within its event.
const dropped = (item, unread) => {
  const entry = item.webkitGetAsEntry(),
    file = item.getAsFile(),
    found = [];
  if (!entry?.isDirectory) return file ? [{ path: file.name, file }] : [];
  // A handle, where the browser has those: on a page from disk Chromium refuses to read entries.
  return collect(item.getAsFileSystemHandle?.() ?? entry, entry.name, found, unread).then(() => found);
};
// A report would take for itself what is dropped on it, and open it.
const overReport = (takes) => {
  shown.style.pointerEvents = takes ? "" : "none";
};
addEventListener("dragenter", () => overReport(false));
addEventListener("dragleave", ({ relatedTarget }) => relatedTarget || overReport(true));
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("drop", async (event) => {
  event.preventDefault();
  overReport(true);
  const unread = [];
  const items = [...event.dataTransfer.items].filter(({ kind }) => kind === "file").map((item) => dropped(item, unread));
  if (items.length === 0) return;
  if (stop.hidden) status.textContent = "Listing what was dropped.";
  root.dataset.state = "busy";
  const mine = ++drops;
  const found = await Promise.all(items);
  if (mine === drops) start(found, unread);
});

compiled.then(
  () => {
    status.textContent = "Ready.";
    root.dataset.ready = "true";
  },
  (error) => {
    status.textContent = `This browser cannot run the program (${error.message}); use a newer one.`;
  },
);
