// The event log: three lines in the footer, and a page of its own.
import { h, mark, paced } from './dom.js';
import { on, store } from './store.js';
import { more } from './more.js';

const LEVELS = { info: 'idle', warning: 'warn', fault: 'fault' };

export function clock(stamp) {
  return new Date(stamp * 1000).toLocaleTimeString('en-GB');
}

function line(event) {
  return h('li', { class: event.level === 'fault' ? 'faultrow' : '' }, mark(LEVELS[event.level]), `${clock(event.stamp)} ${event.source}: ${event.text}${event.phase ? ` [${event.phase}]` : ''}`);
}

export function showLog(list) {
  more(list.parentElement, list);
  on('events', paced(() => list.replaceChildren(...store.events.slice(-3).reverse().map(line)), 150));
}

export function eventsPage(page) {
  page.className = 'page';
  const list = h('ol', { reversed: true, tabindex: '0', 'aria-label': 'All events, newest first' });
  page.append(h('h2', {}, 'Events, newest first'), list);
  const draw = paced(() => list.isConnected && list.replaceChildren(...store.events.slice(-300).reverse().map(line)), 300);
  draw();
  return { events: draw };
}
