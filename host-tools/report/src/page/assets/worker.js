// The worker of the check in a browser: runs the program `hums-browser` once, with the dropped files as its files.
//
// The program is built for WASI (preview 1), the system interface of WebAssembly. These are the calls of it that reading needs.
// Files are read in slices, so that memory does not grow with them. There is no clock of the day, no network, no storage.

const OK = 0,
  BAD_FILE = 8,
  INVALID = 28,
  IO = 29,
  NOT_A_FOLDER = 54,
  MISSING = 44,
  IS_A_FOLDER = 31,
  READ_ONLY = 69,
  NO_SUCH_CALL = 52;
const STREAM = 2,
  FOLDER = 3,
  FILE = 4;
const SLICE_BYTES = 1 << 20;
// Between two messages of progress, in milliseconds.
const EVERY_MS = 100;

const text = new TextDecoder(),
  binary = new TextEncoder();

// The end of the program by itself.
class Exit extends Error {}

// A tree of folders (maps) and files (blobs), each with a number.
const tree = (files) => {
  let count = 1;
  const folder = () => ({ inside: new Map(), number: count++ });
  const root = folder();
  for (const { path, file } of files) {
    const parts = path.split("/");
    const name = parts.pop();
    let at = root;
    for (const part of parts) {
      if (!at.inside.get(part)?.inside) at.inside.set(part, folder());
      at = at.inside.get(part);
    }
    at.inside.set(name, { file, name: path, number: count++ });
  }
  return root;
};

// Each file's reading window, so that small reads cost no request each.
const reader = new FileReaderSync();
const bytesAt = (open, at, length) => {
  const { node } = open;
  if (!(at >= open.from && at + length <= open.from + open.window.length)) {
    const end = Math.min(at + Math.max(length, SLICE_BYTES), node.file.size);
    open.window = new Uint8Array(reader.readAsArrayBuffer(node.file.slice(at, end)));
    open.from = at;
  }
  return open.window.subarray(at - open.from, at - open.from + length);
};

// The system that the program sees; `say` sends a message to the page.
const system = (files, commandLine, say) => {
  const open = new Map([
    [0, { kind: STREAM }],
    [1, { kind: STREAM, lines: "" }],
    [2, { kind: STREAM, lines: "" }],
    [3, { kind: FOLDER, node: tree(files), at: 0 }],
  ]);
  let memory,
    next = 4,
    told = 0,
    named = null;
  const words = commandLine.map((word) => binary.encode(`${word}\0`));
  // The memory may have grown since the call before.
  const view = () => new DataView(memory.buffer);
  const bytes = (at, length) => new Uint8Array(memory.buffer, at, length);
  const string = (at, length) => text.decode(bytes(at, length));
  const find = (folder, path) => {
    let node = folder;
    for (const part of path.split("/")) {
      if (part === "" || part === ".") continue;
      if (!node.inside) return NOT_A_FOLDER;
      node = node.inside.get(part);
      if (!node) return MISSING;
    }
    return node;
  };
  const about = (node, at) => {
    bytes(at, 64).fill(0);
    view().setBigUint64(at + 8, BigInt(node?.number ?? 0), true);
    view().setUint8(at + 16, node?.inside ? FOLDER : node ? FILE : STREAM);
    view().setBigUint64(at + 24, 1n, true);
    view().setBigUint64(at + 32, BigInt(node?.file?.size ?? 0), true);
    return OK;
  };
  const pieces = (at, count) =>
    Array.from({ length: count }, (_, i) => [view().getUint32(at + 8 * i, true), view().getUint32(at + 8 * i + 4, true)]);
  const progress = (node, at) => {
    const now = performance.now();
    if (node === named && now - told < EVERY_MS) return;
    told = now;
    named = node;
    say({ kind: "progress", name: node.name, part: node.file.size ? at / node.file.size : 1 });
  };
  const read = (file, from, at, count, result) => {
    let done = 0;
    try {
      for (const [to, room] of pieces(at, count)) {
        const length = Math.min(room, Math.max(file.node.file.size - from - done, 0));
        // A window is smaller than memory may be; the rest comes with the next call.
        const part = bytesAt(file, from + done, Math.min(length, SLICE_BYTES));
        bytes(to, part.length).set(part);
        done += part.length;
        if (part.length < room) break;
      }
    } catch {
      return IO;
    }
    view().setUint32(result, done, true);
    progress(file.node, from + done);
    return OK;
  };
  const list = (at, sizes, words) => {
    let to = sizes;
    words.forEach((word, i) => {
      view().setUint32(at + 4 * i, to, true);
      bytes(to, word.length).set(word);
      to += word.length;
    });
    return OK;
  };
  const sizes = (count, length, words) => {
    view().setUint32(count, words.length, true);
    view().setUint32(
      length,
      words.reduce((sum, word) => sum + word.length, 0),
      true,
    );
    return OK;
  };
  const calls = {
    args_get: (at, to) => list(at, to, words),
    args_sizes_get: (count, length) => sizes(count, length, words),
    environ_get: () => OK,
    environ_sizes_get: (count, length) => sizes(count, length, []),
    clock_time_get: (_clock, _precision, at) => {
      view().setBigUint64(at, BigInt(Math.round(performance.now() * 1e6)), true);
      return OK;
    },
    random_get: (at, length) => {
      // At most 65,536 bytes at once.
      for (let from = 0; from < length; from += 65536) crypto.getRandomValues(bytes(at + from, Math.min(65536, length - from)));
      return OK;
    },
    sched_yield: () => OK,
    proc_exit: () => {
      throw new Exit();
    },
    fd_close: (fd) => (open.delete(fd) ? OK : BAD_FILE),
    fd_fdstat_get: (fd, at) => {
      const of = open.get(fd);
      if (!of) return BAD_FILE;
      bytes(at, 24).fill(0);
      view().setUint8(at, of.kind);
      view().setBigUint64(at + 8, 0xffffffffffffffffn, true);
      view().setBigUint64(at + 16, 0xffffffffffffffffn, true);
      return OK;
    },
    fd_fdstat_set_flags: () => OK,
    fd_filestat_get: (fd, at) => (open.has(fd) ? about(open.get(fd).node, at) : BAD_FILE),
    fd_prestat_get: (fd, at) => {
      if (fd !== 3) return BAD_FILE;
      view().setUint32(at, 0, true);
      view().setUint32(at + 4, 1, true);
      return OK;
    },
    fd_prestat_dir_name: (_fd, at) => {
      bytes(at, 1)[0] = 0x2f;
      return OK;
    },
    fd_read: (fd, at, count, result) => {
      const of = open.get(fd);
      if (of?.kind !== FILE) return of?.kind === FOLDER ? IS_A_FOLDER : BAD_FILE;
      const end = read(of, of.at, at, count, result);
      if (end === OK) of.at += view().getUint32(result, true);
      return end;
    },
    fd_pread: (fd, at, count, from, result) => {
      const of = open.get(fd);
      return of?.kind === FILE ? read(of, Number(from), at, count, result) : BAD_FILE;
    },
    fd_seek: (fd, by, from, result) => {
      const of = open.get(fd);
      if (of?.kind !== FILE) return BAD_FILE;
      const to = Number(by) + [0, of.at, of.node.file.size][from];
      if (!(to >= 0)) return INVALID;
      of.at = to;
      view().setBigUint64(result, BigInt(to), true);
      return OK;
    },
    fd_tell: (fd, result) => calls.fd_seek(fd, 0n, 1, result),
    fd_readdir: (fd, at, length, cookie, used) => {
      const of = open.get(fd);
      if (of?.kind !== FOLDER) return BAD_FILE;
      let filled = 0;
      const entries = [...of.node.inside].slice(Number(cookie));
      for (const [i, [name, node]] of entries.entries()) {
        const encoded = binary.encode(name);
        const entry = new Uint8Array(24 + encoded.length);
        const fields = new DataView(entry.buffer);
        fields.setBigUint64(0, cookie + BigInt(i + 1), true);
        fields.setBigUint64(8, BigInt(node.number), true);
        fields.setUint32(16, encoded.length, true);
        fields.setUint8(20, node.inside ? FOLDER : FILE);
        entry.set(encoded, 24);
        // An entry that is cut off says that there are more.
        const part = entry.subarray(0, length - filled);
        bytes(at + filled, part.length).set(part);
        filled += part.length;
        if (filled === length) break;
      }
      view().setUint32(used, filled, true);
      return OK;
    },
    fd_write: (fd, at, count, result) => {
      const of = open.get(fd);
      if (fd !== 1 && fd !== 2) return BAD_FILE;
      let done = 0;
      for (const [from, length] of pieces(at, count)) {
        of.decoder ??= new TextDecoder();
        of.lines += of.decoder.decode(bytes(from, length), { stream: true });
        done += length;
      }
      const end = of.lines.lastIndexOf("\n");
      if (end >= 0) {
        for (const line of of.lines.slice(0, end).split("\n")) say({ kind: fd === 1 ? "line" : "remark", line });
        of.lines = of.lines.slice(end + 1);
      }
      view().setUint32(result, done, true);
      return OK;
    },
    path_filestat_get: (fd, _flags, at, length, to) => {
      const folder = open.get(fd)?.node;
      const node = folder ? find(folder, string(at, length)) : BAD_FILE;
      return typeof node === "number" ? node : about(node, to);
    },
    path_open: (fd, _flags, at, length, how, _rights, _inherited, _fdflags, result) => {
      const folder = open.get(fd)?.node;
      const node = folder ? find(folder, string(at, length)) : BAD_FILE;
      // Flag 1 would make a file, flag 8 empty it, flag 2 is for folders.
      if (how & 9) return READ_ONLY;
      if (typeof node === "number") return node;
      if (how & 2 && !node.inside) return NOT_A_FOLDER;
      open.set(next, { kind: node.inside ? FOLDER : FILE, node, at: 0, from: 0, window: new Uint8Array() });
      view().setUint32(result, next++, true);
      return OK;
    },
    path_readlink: () => INVALID,
  };
  // Addresses beyond 2 GB arrive as negative numbers.
  const unsigned = (value) => (typeof value === "number" ? value >>> 0 : value);
  const imports = new Proxy(calls, {
    get: (known, name) => (known[name] ? (...values) => known[name](...values.map(unsigned)) : () => NO_SUCH_CALL),
  });
  const attach = (of) => {
    memory = of;
  };
  return { imports, attach };
};

// Why it ended before its end, as a sentence; `last` are Rust's own words of it.
const reason = (error, last) => {
  if (error instanceof RangeError || /^memory allocation of/.test(last[0]) || /out of memory/i.test(error.message))
    return "the memory of this page does not suffice; give fewer or smaller files, or use the program hums";
  return `the program stopped (${last.slice(0, 2).join(" ") || error.message}); the program hums may read more, and a report of this fault helps`;
};

self.onmessage = async ({ data: { module, command, files } }) => {
  const last = [];
  const say = (message) => {
    if (message.kind === "remark" && (last.length || /^(memory allocation of|thread) /.test(message.line))) last.push(message.line);
    else self.postMessage(message);
  };
  let why = null;
  try {
    const { imports, attach } = system(files, ["hums", ...command], say);
    const instance = await WebAssembly.instantiate(module, { wasi_snapshot_preview1: imports });
    attach(instance.exports.memory);
    instance.exports._start();
  } catch (error) {
    if (!(error instanceof Exit)) why = reason(error, last);
  }
  say({ kind: "end", why });
};
