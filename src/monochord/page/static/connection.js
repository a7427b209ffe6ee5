// The connection to the server, opened anew whenever it is lost, and the words that say so.

const RETRY = [250, 500, 1000, 2000, 4000]; // ms until the next attempt

export class Connection {
  // `path` in the page's folder; `listeners`: {opened, message, lost}
  constructor(path, listeners) {
    this.path = path;
    this.listeners = listeners;
    this.attempt = 0;
    this.open();
  }

  open() {
    const socket = new WebSocket(new URL(this.path, location.href).href.replace(/^http/, "ws"));
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => this.listeners.opened();
    socket.onmessage = ({ data }) => {
      this.attempt = 0;
      this.listeners.message(data);
    };
    socket.onclose = () => {
      const pause = RETRY[Math.min(this.attempt++, RETRY.length - 1)];
      this.listeners.lost();
      showConnection("lost", "not connected, trying again");
      setTimeout(() => this.open(), pause);
    };
  }

  // Returns whether it is sent; not where more than `most` bytes wait, as of a touch: the next one says more.
  send(message, most = Infinity) {
    const { readyState, bufferedAmount } = this.socket;
    if (readyState !== WebSocket.OPEN || bufferedAmount > most) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }
}

export function showConnection(state, words) {
  const place = document.getElementById("connection");
  if (place.dataset.state === state) return;
  place.dataset.state = state;
  place.lastElementChild.textContent = words;
  document.body.dataset.connection = state;
}
