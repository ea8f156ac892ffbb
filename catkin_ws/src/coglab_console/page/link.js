// The connection to the server: one WebSocket that comes back by itself, and commands by POST.
import { store, take, tell } from './store.js';

const HEADERS = { 'Content-Type': 'application/json', 'X-CogLab-Console': '1' };
const SILENCE = 700; // ms without a word after which the page is greyed
const RETRY = 500; // ms

let socket = null;
let nextId = 1;
const waiting = new Map();

function open() {
  socket = new WebSocket(`ws://${location.host}/ws`);
  socket.onopen = () => socket.send(JSON.stringify({ seq: store.seq, epoch: store.epoch }));
  socket.onmessage = (event) => {
    const message = JSON.parse(event.data);
    if (message.t === 'answer') answered(message);
    else take(message);
  };
  socket.onclose = () => setTimeout(open, RETRY);
}

function answered(message) {
  waiting.get(message.id)?.(message);
  waiting.delete(message.id);
}

/** A frame to the server; false where there is no connection. `onAnswer` is called at most once. */
export function send(frame, onAnswer) {
  if (socket?.readyState !== WebSocket.OPEN) return false;
  const id = nextId++;
  if (onAnswer) {
    waiting.set(id, onAnswer);
    if (waiting.size > 200) waiting.delete(waiting.keys().next().value);
  }
  socket.send(JSON.stringify({ ...frame, id }));
  return true;
}

async function post(address, body) {
  try {
    const response = await fetch(address, { method: 'POST', headers: HEADERS, body: JSON.stringify(body), signal: AbortSignal.timeout(9000) });
    return await response.json();
  } catch (error) {
    return { success: false, message: `the console did not answer: ${error.message}` };
  }
}

/** A command of the closed list; its answer { success, message, data }. */
export function command(name, args = {}) {
  return post('/api/command', { name, arguments: args });
}

/** STOP: over the connection that stands, and besides by a request of its own. */
export function stop() {
  const sent = send({ t: 'stop' });
  const posted = post('/api/stop', {});
  return sent ? Promise.resolve({ success: true, message: 'STOP was sent' }) : posted;
}

function watch() {
  const silent = performance.now() - store.stateAt;
  const lost = silent > SILENCE;
  const band = document.getElementById('lost');
  document.body.classList.toggle('lost', lost);
  band.hidden = !lost;
  if (lost) band.textContent = Number.isFinite(silent) ? `NOT LIVE for ${Math.round(silent / 1000)} s` : 'NOT LIVE';
  if (lost !== store.lost) {
    store.lost = lost;
    tell('link');
  }
}

export function connect() {
  open();
  setInterval(watch, 100);
}
