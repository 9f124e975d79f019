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
const stop = el("button", { type: "button", hidden: true, onclick: () => cancel("Cancelled.") }, "Cancel");
const choose = (label, options) => {
  const input = el("input", { type: "file", multiple: true, ...options });
  input.addEventListener("change", () => {
    const files = [...input.files].map((file) => ({ path: file.webkitRelativePath || file.name, file }));
    start(options.webkitdirectory ? [files] : files.map((file) => [file]));
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
    choose("Choose a folder", { id: "folder", webkitdirectory: true }),
  ),
  el("p", { class: "running" }, status, meter, stop),
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
main.append(zone, beside, list, remarks, shown);

// ---- Saving and showing.
const save = (name, content, type) => {
  const address = URL.createObjectURL(new Blob([content], { type }));
  el("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 60000);
};
const button = (words, onclick) => el("button", { type: "button", onclick }, words);
const show = async (title, page) => {
  const html = await page.text();
  // The report runs apart from this page, under the same policy.
  const frame = el("iframe", { title, sandbox: "allow-scripts allow-modals", srcdoc: html });
  shown.replaceChildren(el("h2", {}, title), frame);
  shown.hidden = false;
  shown.scrollIntoView({ behavior: "smooth" });
};
const pageButtons = (host, words, { page, html, title }) => {
  // Out of the script's memory: reports are large, and a card may have hundreds.
  const content = new Blob([html]);
  host.append(
    button(words, () => show(title, content)),
    button("Save it", () => save(page, content, "text/html")),
  );
};

// ---- A log's verdict.
const LEVELS = { ok: "ok", advisory: "advisory", warning: "warning", critical: "critical" };
// What was said of each log, and of each vehicle of a log of several.
let logs = [];
const addLog = (line, told, screen) => {
  const mark = badge();
  const level = LEVELS[told.verdict] ?? "stale";
  mark.set(level, told.error ? "not read" : told.verdict.replaceAll("_", " "));
  const buttons = el("p", { class: "choices" });
  const node = el(
    "section",
    { class: "panel log", "data-log": told.log },
    el("h2", {}, mark.node, ` ${told.log}`),
    el("pre", { class: "screen" }, told.error ?? screen.trimEnd()),
    buttons,
  );
  if (!told.error)
    buttons.append(
      button("Save findings (JSON)", () => save(`${told.log.replace(/[^\w.-]+/g, "_")}.json`, `${line}\n`, "application/json")),
    );
  logs.push({ line, told, buttons });
  list.append(node);
};

// ---- Runs of the program, one at a time, each in a worker of its own: its memory ends with it.
// A run ends with `why` it ended early, or null, and the program's exit code.
let worker = null;
let turn = 0;
const idle = (words) => {
  worker = null;
  status.textContent = words;
  meter.hidden = stop.hidden = true;
  root.dataset.state = "done";
};
const cancel = (words) => {
  worker?.terminate();
  turn++;
  idle(words);
};
const run = (words, command, inputs, files, takeLine) => {
  const mine = turn;
  return compiled.then(
    (module) =>
      new Promise((resolve) => {
        // It may have been cancelled before it began.
        if (mine !== turn) return resolve({ why: null });
        const own = new Worker(workerAddress);
        const end = (result) => {
          own.terminate();
          resolve(result);
        };
        worker = own;
        status.textContent = words;
        meter.removeAttribute("value");
        meter.hidden = stop.hidden = false;
        own.onmessage = ({ data }) => {
          if (data.kind === "line") takeLine(data.line);
          else if (data.kind === "remark") remarks.append(el("li", {}, data.line.replace(/^hums: /, "")));
          else if (data.kind === "progress") {
            meter.value = data.part;
            status.textContent = `${words} ${data.name}, ${Math.round(data.part * 100)} %`;
          } else end(data);
        };
        own.onerror = ({ message }) => end({ why: `the program stopped (${message})` });
        own.postMessage({ module, command, inputs, files });
      }),
    (error) => ({ why: `this browser cannot run the program (${error.message}); use a newer one` }),
  );
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

// `items`: the files of each chosen or dropped file or folder; `unread`: sentences about others.
const start = async (items, unread = []) => {
  const given = named(items.filter((files) => files.length));
  if (given.length + unread.length === 0) return;
  cancel("");
  const mine = turn;
  const isOld = () => mine !== turn;
  root.dataset.state = "busy";
  logs = [];
  for (const node of [list, beside, remarks, shown]) node.replaceChildren();
  shown.hidden = true;
  for (const words of unread) remarks.append(el("li", {}, words));
  if (given.length === 0) return idle("Nothing could be read.");
  const inputs = [...new Set(given.map(({ path }) => path.split("/")[0]))];
  let screen = "";
  const checked = await run("Checking", "check", inputs, given, (line) => {
    const told = JSON.parse(line);
    if (told.screen != null) screen = told.screen;
    else addLog(line, told, screen);
  });
  if (isOld()) return;
  const read = logs.filter(({ told }) => !told.error);
  if (read.length > 1)
    beside.append(
      button("Save all findings (JSON lines)", () =>
        save("findings.jsonl", logs.map(({ line }) => `${line}\n`).join(""), "application/json"),
      ),
    );
  if (checked.why) return idle(`The check ended early: ${checked.why}.`);
  if (read.length === 0) return idle(`No log could be read${logs.length ? "" : " in what was given"}.`);
  // A report for each, and one of the flights side by side.
  const flights = read.reduce((sum, { told }) => sum + told.flights.length, 0);
  const failed = new Set(logs.filter(({ told }) => told.error).map(({ told }) => told.log));
  const good = inputs.filter((input) => !failed.has(input));
  const files = given.filter(({ path }) => !failed.has(path) && good.includes(path.split("/")[0]));
  root.dataset.state = "checked";
  const reported = await run("Reporting", flights > 1 ? "compare" : "report", good, files, (line) => {
    if (!line.startsWith("{")) return;
    const { page, log, system, html } = JSON.parse(line);
    if (log != null) {
      const own = logs.filter(({ told }) => told.log === log);
      const of = own.length === 1 ? own[0] : own.find(({ told }) => told.vehicle?.system === system);
      if (of) pageButtons(of.buttons, "Report", { page, html, title: log });
    } else if (page !== "index.html") pageButtons(beside, "Flights side by side", { page, html, title: "Flights side by side" });
  });
  if (isOld()) return;
  // Exit codes 1 and 2: an input or a request that the program refused.
  const early = reported.why ?? ([1, 2].includes(reported.code) ? "see the remarks" : null);
  idle(early ? `The reports ended early: ${early}.` : `${plural(new Set(logs.map(({ told }) => told.log)).size, "log")} checked.`);
};

// ---- Dropping: files, and folders with all that is in them.
// A folder as a handle, where the browser has those: on a page from disk Chromium refuses to read entries.
const ofHandle = async (folder, path) => {
  const all = [];
  for await (const one of folder.values()) {
    const name = `${path}/${one.name}`;
    if (one.kind === "file") all.push({ path: name, file: await one.getFile() });
    else all.push(...(await ofHandle(one, name)));
  }
  return all;
};
const ofEntry = async (entry, path) => {
  if (entry.isFile) return [{ path, file: await new Promise((resolve, reject) => entry.file(resolve, reject)) }];
  const reader = entry.createReader();
  const all = [];
  // It tells a part of its entries at a time.
  for (;;) {
    const part = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (part.length === 0) break;
    for (const inner of part) all.push(...(await ofEntry(inner, `${path}/${inner.name}`)));
  }
  return all;
};
// Begins at once: what was dropped is known only within its event.
const dropped = (item) => {
  const entry = item.webkitGetAsEntry(),
    file = item.getAsFile();
  if (!entry?.isDirectory) return file ? [{ path: file.name, file }] : [];
  const handle = item.getAsFileSystemHandle?.();
  return handle ? handle.then((folder) => ofHandle(folder, folder.name)) : ofEntry(entry, entry.name);
};
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("drop", async (event) => {
  event.preventDefault();
  const items = [...event.dataTransfer.items].filter(({ kind }) => kind === "file").map(dropped);
  cancel("Listing what was dropped.");
  const mine = turn;
  const ended = await Promise.allSettled(items);
  if (mine !== turn) return;
  const failed = ended.filter(({ status }) => status === "rejected");
  start(
    ended.filter(({ status }) => status === "fulfilled").map(({ value }) => value),
    failed.map(({ reason }) => `A folder that was dropped cannot be read: ${reason.message}.`),
  );
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
