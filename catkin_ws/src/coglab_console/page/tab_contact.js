// Contact work-bench: what the detector itself sees, per joint against its threshold, live; learning at rest; trying it.
import { h, setText } from './dom.js';
import { store } from './store.js';
import { field } from './tab_experiment.js';
import { commandButton } from './controls.js';

const JOINTS = ['A1', 'A2', 'E1', 'A3', 'A4', 'A5', 'A6'];

export function contactPage(page) {
  page.className = 'page two';
  const told = h('p', { 'aria-live': 'polite' });
  const learnt = h('p');
  const detector = h('p');
  const bars = JOINTS.map((name) => {
    const fill = h('i');
    const limit = h('b');
    const value = h('span');
    const label = h('span', {}, name);
    return { name: label, row: h('div', { class: 'bar' }, label, h('span', {}, fill, limit), value), fill, limit, value, peak: 0 };
  });
  const title = h('span', {}, 'Change of the external torques, Nm');
  const k = h('input', { type: 'number', min: 3, max: 50, step: 0.5, value: 6 });
  const timeout = h('input', { type: 'number', min: 1, max: 60, value: 20 });
  page.append(
    h('div', {}, h('h2', {}, title), ...bars.map((bar) => bar.row),
      h('p', {}, 'What the contact detector sees and compares. Bar: the largest change of the last second. Black line: its threshold, k robust standard deviations at rest; with a mark: the joint counts now.')),
    h('div', {}, h('h2', {}, 'Noise at rest'), learnt, h('div', { class: 'row' }, commandButton('Learn anew at rest', { name: 'contact_learn', told, held: true, request: () => ['contact_learn', {}] })),
      h('h2', {}, 'Try the detector'), detector,
      h('div', { class: 'row' }, field('Threshold k', k), field('For, s', timeout),
        commandButton('Watch for contact', { name: 'contact_arm', told, held: true, request: () => ['contact_arm', { mode: 'contact', k: Number(k.value), timeout: Number(timeout.value) }] }),
        commandButton('Off', { name: 'contact_arm', told, request: () => ['contact_arm', { mode: 'off' }] })), told));

  const onState = (state) => {
    bars.forEach((bar, i) => {
      const rate = Math.abs(state.rate[i] ?? 0);
      bar.peak = Math.max(rate, bar.peak * 0.97);
      const threshold = state.threshold[i] ?? 0;
      setText(bar.name, `${JOINTS[i]} ${state.watched[i] ? '●' : '○'}`);
      const full = Math.max(1.5 * threshold, 0.05);
      bar.fill.style.width = `${Math.min(100, (100 * bar.peak) / full)}%`;
      bar.limit.style.left = `${(100 * threshold) / full}%`;
      setText(bar.value, i in state.rate ? bar.peak.toFixed(3) : '–');
    });
    const { alive, state: stands, mode } = store.docs.status?.contact ?? {};
    setText(detector, !alive ? 'The detector says nothing: it is not there, or no torques come.'
      : state.margin !== null ? `Watching for ${mode}: margin ${state.margin.toFixed(2)}; it counts from 1.`
        : stands === 'waiting' ? `Armed for ${mode}; waits until the arm stands still and enough was learnt.` : 'The detector is off.');
    onStatus(); // the deviations are those of the newest thresholds
  };
  const onStatus = () => {
    const contact = store.docs.status?.contact;
    if (!contact) return;
    const sigma = (store.state?.threshold ?? []).map((value, i) => `${JOINTS[i]} ${(value / contact.k).toFixed(3)}`).join(', ');
    setText(title, `Change of the external torques within ${Math.round(contact.window * 1000)} ms, Nm`);
    setText(learnt, `${contact.learnt ? 'Learnt' : 'Learning; leave the arm alone'}: ${contact.samples} samples at rest; standard deviations ${sigma} Nm; k ${contact.k}`);
  };
  onStatus();
  return { state: onState, docs: { status: onStatus } };
}
