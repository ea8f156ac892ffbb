// The connection to the server, the commands, and the received data: newest state, documents, events.
import { setText } from './dom.js';

export const store = {
  state: null, // the newest state, see RosView.frame
  stateAt: -Infinity, // ms of performance.now
  heardAt: -Infinity,
  fastest: Infinity, // ms, smallest difference of performance.now and the console's clock at a received state: best estimate of the clock offset
  docs: {},
  events: [],
  seq: 0,
  epoch: '',
  you: '',
  lost: true,
};

const listeners = { state: [], doc: [], events: [], link: [] };
const KEPT = 1000;

/** on('state' | 'events' | 'link', f) or on('doc', f): f(name, value). */
export function on(kind, listener) {
  listeners[kind].push(listener);
}

/** Calls the listener now, and at each change of the named documents. */
export function onDocs(names, listener) {
  on('doc', (name) => {
    if (names.includes(name)) listener();
  });
  listener();
}

export function notify(kind, ...values) {
  for (const listener of listeners[kind]) {
    try {
      listener(...values);
    } catch (error) {
      console.error(error); // a failing panel must not stop the others, least of all STOP
    }
  }
}

/** One message of the server. */
export function take(message) {
  store.heardAt = performance.now();
  if (message.t === 'state') {
    store.state = message;
    store.stateAt = store.heardAt;
    store.fastest = Math.min(store.fastest, store.heardAt - message.at);
    notify('state', message);
  } else if (message.t === 'doc') {
    store.docs[message.name] = message.value;
    notify('doc', message.name, message.value);
  } else if (message.t === 'events') {
    takeEvents(message);
  } else if (message.t === 'you') {
    if (message.epoch !== store.epoch) {
      store.events = [];
      store.seq = 0;
    }
    store.fastest = Infinity;
    store.epoch = message.epoch;
    store.you = message.name;
    notify('link');
  }
}

function takeEvents(message) {
  if (message.lost) {
    store.events.push({ seq: 0, stamp: Date.now() / 1000, level: 'warning', source: 'console', text: `${message.lost} older events are not kept any more` });
  }
  for (const event of message.events) {
    if (event.seq <= store.seq) continue;
    store.events.push(event);
    store.seq = event.seq;
  }
  store.events.splice(0, Math.max(0, store.events.length - KEPT));
  notify('events');
}

export function operating() {
  return store.docs.desk?.roles.operator === store.you && store.you !== '';
}

const HEADERS = { 'Content-Type': 'application/json', 'X-CogLab-Console': '1' };
const SILENCE = 700; // ms without a state after which the page turns grey
const BEHIND = 500; // ms, age of the state from which the page shows the age
const RETRY = 500; // ms
const STOP_LIMIT = 2000; // ms after which a STOP without an answer is reported
const GIVEN_UP = 2500; // ms without a message after which an open connection counts as dead

let socket = null;
let openedAt = -Infinity;
let nextId = 1;
let refusal = ''; // reason why the console no longer accepts this page
const waiting = new Map();

/** Opens a new connection. Messages of the one before are ignored. */
function open() {
  const mine = new WebSocket(`ws://${location.host}/ws`);
  socket = mine;
  openedAt = performance.now();
  mine.onopen = () => {
    if (mine !== socket) return;
    refusal = '';
    mine.send(JSON.stringify({ seq: store.seq, epoch: store.epoch }));
  };
  mine.onmessage = (event) => {
    if (mine !== socket) return;
    const message = JSON.parse(event.data);
    if (message.t === 'answer') answered(message);
    else take(message);
    if (message.t === 'state') mine.send(`{"t":"seen","n":${message.n}}`); // the server sends further states only after this
  };
  mine.onclose = () => {
    askWhy();
    setTimeout(() => mine === socket && open(), RETRY);
  };
}

/** Requests the reason of a refusal by HTTP, because a WebSocket does not get it. A restarted console does not know this page. */
async function askWhy() {
  try {
    const response = await fetch('/page/link.js', { method: 'GET', cache: 'no-store', signal: AbortSignal.timeout(2000) });
    refusal = response.status === 401 ? (await response.json()).message : '';
  } catch {
    refusal = '';
  }
}

/** Replaces a dead connection. With a pulled cable the browser would wait for the network's own limit, many minutes. */
function comeBack() {
  if (performance.now() - Math.max(store.heardAt, openedAt) < GIVEN_UP) return;
  const dead = socket;
  open();
  dead?.close();
}

function answered(message) {
  waiting.get(message.id)?.(message);
  waiting.delete(message.id);
}

/** Sends a frame to the server; false without a connection. `onAnswer` is called at most once. */
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

/** Sends a command of the closed list. Returns its answer { success, message, data }. */
export function command(name, args = {}) {
  return post('/api/command', { name, arguments: args });
}

/** Sends STOP over the open connection and as a separate request. Returns the first answer. */
export function stop() {
  const sent = new Promise((resolve, reject) => {
    if (!send({ t: 'stop' }, resolve)) reject(new Error('no connection'));
  });
  const posted = post('/api/stop', {}).then((answer) => (answer.success ? answer : Promise.reject(new Error(answer.message))));
  const late = new Promise((resolve) => {
    setTimeout(() => resolve({ success: false, message: `no answer for ${STOP_LIMIT / 1000} s` }), STOP_LIMIT);
  });
  const first = Promise.any([sent, posted]).catch((error) => ({ success: false, message: error.errors[1].message }));
  return Promise.race([first, late]);
}

/** Age (s) of the shown state since it left the console, less the travel time of the fastest message. */
export function behind() {
  return (performance.now() - store.state?.at - store.fastest) / 1000;
}

function watch() {
  const silent = performance.now() - store.stateAt;
  const lost = silent > SILENCE;
  const band = document.getElementById('lost');
  const age = 1000 * behind();
  document.body.classList.toggle('lost', lost);
  band.hidden = !lost && !(age > BEHIND);
  const since = Number.isFinite(silent) ? ` for ${Math.round(silent / 1000)} s` : '';
  if (lost) setText(band, `NOT LIVE${since}${refusal && `: ${refusal}`}`);
  else if (age > BEHIND) setText(band, `${(age / 1000).toFixed(1)} s behind`);
  if (lost !== store.lost) {
    store.lost = lost;
    notify('link');
  }
  comeBack();
}

export function connect() {
  open();
  setInterval(watch, 100);
}
