// Contact work-bench: torque change per joint against its threshold, live; learning at rest; trying the detector.
import { h, setText } from './dom.js';
import { store } from './store.js';
import { field, sender } from './tab_experiment.js';

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
    return { row: h('div', { class: 'bar' }, h('span', {}, name), h('span', {}, fill, limit), value), fill, limit, value, peak: 0 };
  });
  const k = h('input', { type: 'number', min: 3, max: 50, step: 0.5, value: 6 });
  const timeout = h('input', { type: 'number', min: 1, max: 60, value: 20 });
  page.append(
    h('div', {}, h('h2', {}, 'Change of the external torques within 40 ms, Nm'), ...bars.map((bar) => bar.row),
      h('p', {}, 'Bar: the largest change of the last second. Black line: k robust standard deviations at rest. The console’s own figures; the detector learns its own.')),
    h('div', {}, h('h2', {}, 'Noise at rest'), learnt, h('div', { class: 'row' }, sender('Learn from 5 s at rest', told, () => ['contact_learn', {}])),
      h('h2', {}, 'Try the detector'), detector,
      h('div', { class: 'row' }, field('Threshold k', k), field('For, s', timeout),
        sender('Watch for contact', told, () => ['contact_arm', { mode: 'contact', k: Number(k.value), timeout: Number(timeout.value) }]),
        sender('Off', told, () => ['contact_arm', { mode: 'off' }])),
      h('p', {}, 'Only between actions and trials: thresholds do not change under way.'), told));

  const onState = (state) => {
    bars.forEach((bar, i) => {
      const rate = Math.abs(state.rate[i]);
      bar.peak = Math.max(rate, bar.peak * 0.97);
      const factor = Number(k.value) / (store.docs.status?.contact.k || 6);
      const threshold = state.threshold[i] * factor;
      const full = Math.max(1.5 * threshold, 0.05);
      bar.fill.style.width = `${Math.min(100, (100 * bar.peak) / full)}%`;
      bar.limit.style.left = `${(100 * threshold) / full}%`;
      setText(bar.value, bar.peak.toFixed(3));
    });
    setText(detector, state.margin === null ? 'The detector is not watching.' : `Watching: margin ${state.margin.toFixed(2)}; contact counts from 1.`);
  };
  const onStatus = () => {
    const contact = store.docs.status?.contact;
    if (!contact) return;
    const sigma = contact.sigma.map((value, i) => `${JOINTS[i]} ${value.toFixed(3)}`).join(', ');
    setText(learnt, contact.learning ? 'Learning; leave the arm alone …' : `${contact.learnt ? 'Learnt' : 'Not learnt yet; smallest deviation believed'}: ${sigma} Nm`);
  };
  onStatus();
  return { state: onState, docs: { status: onStatus } };
}
