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
    start([...input.files].map((file) => ({ path: file.webkitRelativePath || file.name, file })));
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
const save = (name, text, type) => {
  const address = URL.createObjectURL(new Blob([text], { type }));
  el("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 60000);
};
const button = (words, onclick) => el("button", { type: "button", onclick }, words);
const show = (title, html) => {
  // The report runs apart from this page, under the same policy.
  const frame = el("iframe", { title, sandbox: "allow-scripts allow-modals", srcdoc: html });
  shown.replaceChildren(el("h2", {}, title), frame);
  shown.hidden = false;
  shown.scrollIntoView({ behavior: "smooth" });
};
const pageButtons = (host, words, { page, html, title }) =>
  host.append(
    button(words, () => show(title, html)),
    button("Save it", () => save(page, html, "text/html")),
  );

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
        if (mine !== turn) return resolve(null);
        worker = new Worker(workerAddress);
        status.textContent = words;
        meter.removeAttribute("value");
        meter.hidden = stop.hidden = false;
        worker.onmessage = ({ data }) => {
          if (data.kind === "line") takeLine(data.line);
          else if (data.kind === "remark") remarks.append(el("li", {}, data.line.replace(/^hums: /, "")));
          else if (data.kind === "progress") {
            meter.value = data.part;
            status.textContent = `${words} ${data.name}, ${Math.round(data.part * 100)} %`;
          } else resolve(data.why);
        };
        worker.onerror = ({ message }) => resolve(`the program stopped (${message})`);
        worker.postMessage({ module, command, inputs, files });
      }).finally(() => worker?.terminate()),
    (error) => `this browser cannot run the program (${error.message}); use a newer one`,
  );
};

const start = async (given) => {
  if (given.length === 0) return;
  cancel("");
  const mine = turn;
  const isOld = () => mine !== turn;
  root.dataset.state = "busy";
  logs = [];
  for (const node of [list, beside, remarks, shown]) node.replaceChildren();
  shown.hidden = true;
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
  if (checked) return idle(`The check ended early: ${checked}.`);
  if (read.length === 0) return idle(`No log could be read${logs.length ? "" : " in what was given"}.`);
  // A report for each, and one of the flights side by side.
  const flights = read.reduce((sum, { told }) => sum + told.flights.length, 0);
  const failed = new Set(logs.filter(({ told }) => told.error).map(({ told }) => told.log));
  const good = inputs.filter((input) => !failed.has(input));
  const files = given.filter(({ path }) => good.includes(path.split("/")[0]));
  root.dataset.state = "checked";
  const reported = await run("Reporting", flights > 1 ? "compare" : "report", good, files, (line) => {
    if (!line.startsWith("{")) return;
    const { page, log, html } = JSON.parse(line);
    if (log != null) {
      const of = logs.find(({ told }) => told.log === log);
      if (of) pageButtons(of.buttons, "Report", { page, html, title: log });
    } else if (page !== "index.html") pageButtons(beside, "Flights side by side", { page, html, title: "Flights side by side" });
  });
  if (isOld()) return;
  idle(reported ? `The reports ended early: ${reported}.` : `${plural(new Set(logs.map(({ told }) => told.log)).size, "log")} checked.`);
};

// ---- Dropping: files, and folders with all that is in them.
const within = async (entry, path) => {
  const name = path ? `${path}/${entry.name}` : entry.name;
  if (entry.isFile) return [{ path: name, file: await new Promise((resolve, reject) => entry.file(resolve, reject)) }];
  const reader = entry.createReader();
  const all = [];
  // It tells a part of its entries at a time.
  for (;;) {
    const part = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (part.length === 0) break;
    for (const inner of part) all.push(...(await within(inner, name)));
  }
  return all;
};
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("drop", async (event) => {
  event.preventDefault();
  const entries = [...event.dataTransfer.items].map((item) => item.webkitGetAsEntry()).filter(Boolean);
  try {
    start((await Promise.all(entries.map((entry) => within(entry, "")))).flat());
  } catch (error) {
    status.textContent = `What was dropped cannot be read: ${error.message}.`;
  }
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
