// The connection to hums: states and parts of the history come as server-sent events, commands go by POST. It comes back by
// itself.

const AGAIN_MS = 1000;
// A command that hums does not answer holds up those behind it no longer.
const COMMAND_MS = 5000;

// A browser has six connections to a host for all its tabs: a page that is neither seen nor `isHeard` gives up its own.
export const connect = (take, changed, isHeard) => {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  let events = null,
    again = 0,
    vehicle = null,
    failures = 0,
    waiting = [],
    sending = false;
  const address = (path, query) => `${path}?${new URLSearchParams(token ? { ...query, token } : query)}`;
  const open = () => {
    clearTimeout(again);
    events?.close();
    if (document.hidden && !isHeard()) return;
    events = new EventSource(address("events", vehicle == null ? {} : { vehicle }));
    events.onopen = () => {
      failures = 0;
      changed(true, failures);
    };
    events.onmessage = ({ data }) => take(JSON.parse(data), data);
    // A browser by itself gives up after an answer such as 503.
    events.onerror = () => {
      events.close();
      failures++;
      changed(false, failures, token != null);
      again = setTimeout(open, AGAIN_MS);
    };
  };
  open();
  document.addEventListener("visibilitychange", () => isHeard() || open());
  return {
    // One after the other, so that they arrive in this order. Of those that wait, the newest of a kind counts.
    send: async (command) => {
      waiting = [...waiting.filter(({ cmd }) => cmd !== command.cmd), command];
      if (sending) return;
      sending = true;
      while (waiting.length) {
        const request = { method: "POST", body: JSON.stringify(waiting.shift()), signal: AbortSignal.timeout(COMMAND_MS) };
        await fetch(address("command", {}), request).catch(() => {});
      }
      sending = false;
    },
    follow: (system) => {
      vehicle = system;
      open();
    },
  };
};
