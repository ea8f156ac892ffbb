// The page: tabs, keys, and the parts of the first page.
import { h, setAttribute, setText } from './dom.js';
import { connect, on, onDocs, operating, store } from './link.js';
import { armStop, showActions, showCause } from './actions.js';
import { eventsPage, showLog, showStatus } from './status.js';
import { palmShown, showView, viewKind } from './view.js';
import { showGraph } from './graph.js';
import { barsShown, showCharts, stripsShown } from './charts.js';
import { experimentPage, showSession } from './tab_experiment.js';
import { contactPage, feedbackPage, objectsPage, primitivesPage } from './tab_robot.js';
import { healthPage, helpPage, takeOver } from './tab_health.js';

const PAGES = [['Live', null], ['Machine', null], ['Experiment', experimentPage], ['Contact', contactPage], ['Objects', objectsPage], ['Primitives', primitivesPage],
  ['Feedback', feedbackPage], ['Events', eventsPage], ['Health', healthPage], ['Help', helpPage]];

const at = (id) => document.getElementById(id);
let current = {}; // listeners of the page that is shown

function open(name) {
  const [, build] = PAGES.find(([one]) => one === name);
  for (const tab of at('tabs').children) {
    const chosen = tab.textContent === name;
    setAttribute(tab, 'aria-selected', String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
  }
  at('live').hidden = Boolean(build);
  at('live').classList.toggle('machine', name === 'Machine'); // its graph alone
  setAttribute(at('live'), 'aria-label', name);
  at('page').hidden = !build;
  at('page').replaceChildren();
  setAttribute(at('page'), 'aria-label', name);
  current = build ? build(at('page')) : {};
}

function makeTabs(bar) {
  for (const [name, build] of PAGES) bar.append(h('button', { type: 'button', role: 'tab', id: `tab-${name}`, 'aria-controls': build ? 'page' : 'live', onclick: () => open(name) }, name));
  bar.addEventListener('keydown', (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const tabs = [...bar.children];
    const next = tabs[(tabs.indexOf(document.activeElement) + step + tabs.length) % tabs.length];
    next.focus();
    next.click();
  });
  on('state', (state) => current.state?.(state));
  on('events', () => current.events?.());
  on('doc', (name) => current.docs?.[name]?.());
}

function keys(buttons) {
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest('input, textarea')) return;
    const number = Number(event.key);
    if (number >= 1 && number <= buttons.length) buttons[number - 1].focus();
    else if (event.key === 'o') at('object').focus();
    else if (event.key === 'm') {
      open('Experiment');
      at('note').focus();
      event.preventDefault();
    } else if (event.key === '?') open('Help');
  });
}

function showBand() {
  const words = h('span');
  const answer = h('span', { 'aria-live': 'polite' });
  const control = takeOver(answer);
  at('role').append(words);
  at('control').append(answer, ' ', control);
  const draw = () => {
    const roles = store.docs.desk?.roles;
    setText(words, roles ? (operating() ? `you operate (${store.you})` : `you watch (${store.you}); ${roles.operator || 'nobody'} operates; to operate, press Take over`) : '');
    if (operating()) setText(answer, '');
  };
  onDocs(['desk'], draw);
  on('link', draw);
  onDocs(['model', 'real_time_factor'], () => {
    const model = store.docs.model;
    if (!model) return;
    const factor = store.docs.real_time_factor ?? 1;
    setText(at('world'), model.real ? 'REAL ROBOT' : factor < 1 ? `SIMULATION at ${factor} x real time` : 'SIMULATION');
    at('band').className = model.real ? 'real' : 'simulation';
  });
  onDocs(['busy'], () => {
    setText(at('busy'), store.docs.busy ? `▲ ${store.docs.busy}` : '');
    at('busy').hidden = !store.docs.busy;
  });
  showSession(at('session'));
}

armStop(at('stop'));
makeTabs(at('tabs'));
open('Live');
showBand();
keys(showActions(at('actions')));
showCause(at('stop-cause'));
showLog(at('log'));
showStatus(at('status'), at('now'));
showView(at('picture'));
showGraph(at('graph'));
showCharts(at('charts'));
connect();

/** For the tests: what the page shows, without a way to change anything. */
window.coglab = Object.freeze({ palm: palmShown, view: viewKind, strips: stripsShown, bars: barsShown, state: () => store.state, docs: () => store.docs, events: () => store.events });
