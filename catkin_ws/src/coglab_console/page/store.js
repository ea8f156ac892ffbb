// What the page knows: the newest state, documents by name, events by number. Listeners are told of each.

export const store = {
  state: null, // the newest state, see ros_view.frame
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
