// Strip charts on one time axis (the last 20 s), drawn by Debian's dygraphs; phases as bars above them.
import { drawn, h, setText } from './dom.js';
import { on, onDocs, store } from './store.js';

const WINDOW = 20; // s
const JOINTS = [0, 1, 3]; // A1, A2, A3 (wire joints 1, 2, 4) carry the lever of a hand-over
const COLOURS = ['#0072b2', '#d55e00', '#009e73', '#1b1f24', '#cc79a7'];
const DASHES = [null, [7, 4], null, [2, 3], null];
const BARS = ['#56b4e9', '#cfd6dc', '#f0e442', '#b9c2ca'];

const STRIPS = [
  { name: 'Speed, m/s', series: ['palm', 'planned'], colours: [0, 1], of: (s, plan) => [s.speed, plan] },
  { name: 'Torque change, Nm', series: ['A1', 'A2', 'A3', 'limit'], colours: [0, 2, 4, 3], of: (s) => [...JOINTS.map((j) => (j in s.rate ? Math.abs(s.rate[j]) : null)), limit(s)] },
  { name: 'FRI, ms', series: ['latency', 'answer'], colours: [0, 1], of: (s) => [s.fri, s.answer] },
  { name: 'Finger current, counts', series: ['thumb', 'abd.', 'index', 'mid.', 'ring'], colours: [0, 1, 2, 4, 3], of: (s) => [1, 0, 2, 3, 4].map((motor) => s.current[motor] ?? null) },
];

/** The smallest threshold of the joints that the detector watches. */
function limit(state) {
  const counted = state.threshold.filter((_, j) => state.watched[j]);
  return counted.length ? Math.min(...counted) : null;
}

let phases = []; // [from (s), label]
let latest = 0;

/** Speed of the newest path of the motion under way now; 0 without one. */
function planned(state) {
  const shown = store.docs.path;
  if (shown?.kind !== 'running') return 0;
  const { points, times } = shown;
  const i = times.findIndex((time) => time > Math.max(0, state.stamp - shown.stamp));
  if (i < 1) return 0;
  return Math.hypot(...points[i].map((value, k) => value - points[i - 1][k])) / (times[i] - times[i - 1]);
}

function remember(strip, state) {
  const row = [state.stamp, ...strip.of(state, planned(state))];
  const last = strip.rows[strip.rows.length - 1];
  if (last && row[0] < last[0]) strip.rows.length = 0; // another clock
  if (!last || row[0] > last[0]) strip.rows.push(row);
  const old = strip.rows.findIndex(([stamp]) => stamp >= state.stamp - WINDOW - 2);
  if (old > 60) strip.rows.splice(0, old);
}

function drawPhases(canvas) {
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
  const context = canvas.getContext('2d');
  context.clearRect(0, 0, width, height);
  context.font = '14px "DejaVu Sans", Verdana, sans-serif';
  const left = 42; // where the charts' time axis begins
  const x = (stamp) => left + ((stamp - latest + WINDOW) / WINDOW) * (width - left - 4);
  phases.forEach(([from, label], i) => {
    const a = Math.max(left, x(from));
    const b = x(phases[i + 1]?.[0] ?? latest);
    if (b <= left || b <= a) return;
    context.fillStyle = BARS[i % BARS.length];
    context.fillRect(a, 1, b - a, height - 2);
    context.strokeStyle = '#1b1f24';
    context.strokeRect(a, 1, b - a, height - 2);
    context.save();
    context.beginPath();
    context.rect(a, 0, b - a, height);
    context.clip();
    context.fillStyle = '#1b1f24';
    context.fillText(label, a + 4, height - 7);
    context.restore();
  });
}

function rememberPhase(state) {
  const label = state.words;
  if (latest > state.stamp) phases = [];
  if (phases[phases.length - 1]?.[1] !== label) phases.push([state.stamp - (phases.length ? 0 : Math.min(state.since, WINDOW)), label]);
  while (phases.length > 1 && phases[1][0] < state.stamp - WINDOW) phases.shift();
}

/** Its legend sets a style in markup, which the page's policy forbids; ours is beside the chart. */
function withoutLegend() {
  window.Dygraph.PLUGINS = window.Dygraph.PLUGINS.filter((plugin) => plugin !== window.Dygraph.Plugins.Legend);
}

/** dygraphs as a script of its own: it is no module. */
function load() {
  return new Promise((resolve, reject) => {
    document.head.append(h('link', { rel: 'stylesheet', href: '/lib/dygraphs/dygraph.css' }));
    document.head.append(h('script', { src: '/lib/dygraphs/dygraph.js', onload: () => resolve(withoutLegend()), onerror: () => reject(new Error('not served')) }));
  });
}

function optionsOf(strip, last) {
  const axis = (value) => `${(value - latest).toFixed(0)} s`;
  return {
    labels: ['t', ...strip.series],
    colors: strip.colours.map((i) => COLOURS[i]),
    series: Object.fromEntries(strip.series.map((name, i) => [name, { strokePattern: DASHES[strip.colours[i]] }])),
    legend: 'never',
    animatedZooms: false,
    interactionModel: {},
    connectSeparatedPoints: false,
    strokeWidth: 1.5,
    includeZero: true,
    drawGrid: true,
    gridLineColor: '#dde2e6',
    axisLineColor: '#8b939b',
    axes: { x: { drawAxis: last, axisLabelFormatter: axis, valueFormatter: axis, axisLabelWidth: 40, pixelsPerLabel: 90 }, y: { axisLabelWidth: 38, pixelsPerLabel: 17, axisLabelFormatter: (value) => String(Number(value.toPrecision(2))) } },
    dateWindow: [-WINDOW, 0],
  };
}

export function showCharts(parent) {
  const bars = h('canvas', { role: 'img', 'aria-label': 'Phases' });
  parent.append(h('div', { class: 'strip phases' }, h('div', { class: 'name' }, 'Phase'), bars));
  const note = h('p', { hidden: true }, 'Strip charts need libjs-dygraphs: apt install libjs-dygraphs.');
  for (const [i, strip] of STRIPS.entries()) {
    strip.rows = [];
    strip.place = h('div', { role: 'img', 'aria-label': strip.name });
    const names = strip.series.map((name, k) => h('i', { class: `c${strip.colours[k]}` }, name));
    parent.append(h('div', { class: `strip${i === STRIPS.length - 1 ? ' last' : ''}` }, h('div', { class: 'name' }, strip.name, h('br'), names), strip.place));
  }
  parent.append(note);

  const redraw = drawn(() => {
    if (parent.offsetParent === null) return;
    drawPhases(bars);
    STRIPS.forEach((strip, i) => {
      if (!strip.rows.length || !window.Dygraph) return;
      const range = { dateWindow: [latest - WINDOW, latest] };
      if (strip.chart) strip.chart.updateOptions({ file: strip.rows, ...range });
      else strip.chart = new window.Dygraph(strip.place, strip.rows, { ...optionsOf(strip, i === STRIPS.length - 1), ...range });
    });
  }, () => 250);

  on('state', (state) => {
    rememberPhase(state);
    latest = state.stamp;
    for (const strip of STRIPS) remember(strip, state);
    redraw();
  });
  let begun = false;
  onDocs(['model'], () => {
    const model = store.docs.model;
    if (!model || begun) return;
    begun = true;
    note.hidden = model.charts;
    if (model.charts) load().then(redraw, (error) => {
      note.hidden = false;
      setText(note, `Strip charts cannot be drawn: dygraphs ${error.message}`);
    });
  });
}
