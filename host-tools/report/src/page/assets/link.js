// The connection to hums: states and parts of the history come, commands go. It comes back by itself.

const AGAIN_MS = 1000;

export const connect = (take, changed) => {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  const address = `ws://${location.host}/ws${token ? `?token=${encodeURIComponent(token)}` : ""}`;
  let socket = null,
    vehicle = null,
    failures = 0;
  const open = () => {
    socket = new WebSocket(address);
    socket.onopen = () => {
      failures = 0;
      changed(true, failures);
      if (vehicle != null) send({ cmd: "vehicle", system: vehicle });
    };
    socket.onmessage = (event) => take(JSON.parse(event.data), event.data);
    socket.onclose = () => {
      failures++;
      changed(false, failures, token != null);
      setTimeout(open, AGAIN_MS);
    };
  };
  const send = (command) => {
    if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(command));
  };
  open();
  return {
    send,
    follow: (system) => {
      vehicle = system;
      send({ cmd: "vehicle", system });
    },
  };
};
