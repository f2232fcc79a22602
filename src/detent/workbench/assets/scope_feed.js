/* The feed of the scope: a WebSocket on which the page asks for a view and gets frames, as fast as it can paint them.

   A frame is binary: the length of a header (uint32, little-endian), the header (JSON), zeros up to a multiple of 8,
   and behind each other for each trace the low and the high values of its columns (float32, what they are more than the
   trace's `base`). The header has begin and width of the columns in ns, and their count. The server sends the
   next frame when the page has acknowledged the last. */

export class Feed {
  /**
   * @param {string} url
   * @param {{onFrame: (frame: Frame) => void, onNews: (news: any) => void, onFile: (file: any) => void, onState: (open: boolean) => void}} told
   */
  constructor(url, { onFrame, onNews, onFile, onState }) {
    this.url = url;
    this.onFrame = onFrame;
    this.onNews = onNews;
    this.onFile = onFile;
    this.onState = onState;
    /** @type {string[]} messages to send once there is a connection */
    this.waiting = [];
    this.wait = 500; // ms before the next attempt
    this.closed = false;
    this.socket = this.connected();
  }

  connected() {
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.wait = 500;
      this.onState(true);
      for (const text of this.waiting.splice(0)) socket.send(text);
      if (this.view) socket.send(this.view);
    };
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") this.onNews(JSON.parse(data));
      else {
        const frame = decode(data);
        if (frame.file) this.onFile(frame);
        else this.onFrame(frame);
      }
    };
    socket.onclose = () => {
      this.onState(false);
      if (!this.closed) setTimeout(() => this.closed || (this.socket = this.connected()), (this.wait = Math.min(this.wait * 1.6, 5000)));
    };
    return socket;
  }

  /**
   * Ask for a view; the last one counts.
   * @param {object} view
   */
  ask(view) {
    this.view = JSON.stringify({ view });
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(this.view);
  }

  /**
   * Ask for something else, once.
   * @param {object} message
   */
  say(message) {
    const text = JSON.stringify(message);
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(text);
    else this.waiting.push(text);
  }

  painted() {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send("");
  }

  close() {
    this.closed = true;
    this.socket.close();
  }
}

/** @param {number} length */
const filled = (length) => (length + 7) & ~7;

/**
 * The header of a frame, with the arrays of its traces; or of a file, with its bytes.
 * @param {ArrayBuffer} buffer
 */
export function decode(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let at = filled(4 + length);
  if (header.file) return { ...header, bytes: new Uint8Array(buffer, at) };
  const { count } = header;
  for (const trace of header.traces) {
    trace.low = new Float32Array(buffer, at, count);
    trace.high = new Float32Array(buffer, (at += 4 * count), count);
    at += 4 * count;
  }
  return header;
}
