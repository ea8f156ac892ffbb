// The connection to the server, commands, and what the server has sent: the newest state, documents, events.
import { setText } from './dom.js';

export const store = {
  state: null, // the newest state, see RosView.frame
  stateAt: -Infinity, // ms of performance.now
  heardAt: -Infinity,
  fastest: Infinity, // ms of performance.now minus the console's clock, of the state that came fastest: the best guess of their difference
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

/** Listens to some documents by name, and is called once with those that are there. */
export function onDocs(names, listener) {
  on('doc', (name) => {
    if (names.includes(name)) listener();
  });
  listener();
}

export function tell(kind, ...values) {
  for (const listener of listeners[kind]) {
    try {
      listener(...values);
    } catch (error) {
      console.error(error); // one panel that fails takes no other along, least of all STOP
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
    tell('state', message);
  } else if (message.t === 'doc') {
    store.docs[message.name] = message.value;
    tell('doc', message.name, message.value);
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
    tell('link');
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
  tell('events');
}

export function operating() {
  return store.docs.desk?.roles.operator === store.you && store.you !== '';
}

const HEADERS = { 'Content-Type': 'application/json', 'X-CogLab-Console': '1' };
const SILENCE = 700; // ms without a word after which the page is greyed
const BEHIND = 500; // ms of age from which the page says how old it is
const RETRY = 500; // ms
const STOP_LIMIT = 2000; // ms until a STOP without an answer is told
const GIVEN_UP = 2500; // ms without a word after which a connection that says it is open is taken to be dead

let socket = null;
let openedAt = -Infinity;
let nextId = 1;
let refusal = ''; // why the console lets this page in no more
const waiting = new Map();

/** A new connection in place of the one before, which is not listened to any more. */
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
    if (message.t === 'state') mine.send(`{"t":"seen","n":${message.n}}`); // the next ones come only then
  };
  mine.onclose = () => {
    askWhy();
    setTimeout(() => mine === socket && open(), RETRY);
  };
}

/** A WebSocket is not told why it was refused; a console that was started anew knows this page no more. */
async function askWhy() {
  try {
    const response = await fetch('/page/link.js', { method: 'GET', cache: 'no-store', signal: AbortSignal.timeout(2000) });
    refusal = response.status === 401 ? (await response.json()).message : '';
  } catch {
    refusal = '';
  }
}

/** A cable that was pulled closes nothing: the browser would wait for the network's own limit, many minutes. */
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

/** STOP: over the connection that stands, and besides by a request of its own; the answer of whichever is first. */
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

/** s from the moment when what is shown left the console until now, without what the fastest message took. */
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
    tell('link');
  }
  comeBack();
}

export function connect() {
  open();
  setInterval(watch, 100);
}
