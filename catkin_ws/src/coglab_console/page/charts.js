// Strip charts of the last 20 s, drawn by Debian's dygraphs. Bars above them show the phases.
import { drawn, h, setText, svg } from './dom.js';
import { on, onDocs, store } from './link.js';

const WINDOW = 20; // s
const JOINTS = [0, 1, 3]; // A1, A2, A3 (wire joints 1, 2, 4) carry the lever of a hand-over
const COLOURS = ['#0072b2', '#d55e00', '#009e73', '#1b1f24', '#cc79a7'];
const DASHES = [null, [7, 4], [12, 3, 2, 3], [2, 3], [18, 4]]; // one per colour, because colour alone is not enough for every reader
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

const LEFT = 42; // px of the phase canvas to the left of the charts' time axis
const RIGHT = 4; // px to the right of it

let phases = []; // [from (s), label]
let latest = 0;
let bars = []; // phase bars as drawn last, px of the page

/** Planned speed (m/s) of the running motion now; 0 without a motion. */
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
  if (last && row[0] < last[0]) strip.rows.length = 0; // the clock was set back
  if (!last || row[0] > last[0]) strip.rows.push(row);
  const old = strip.rows.findIndex(([stamp]) => stamp >= state.stamp - WINDOW - 2);
  if (old > 60) strip.rows.splice(0, old);
}

/** The phase bars on a canvas of this width: { label, from (s), left, right (px) }. */
function barsIn(width) {
  const x = (stamp) => LEFT + ((stamp - latest + WINDOW) / WINDOW) * (width - LEFT - RIGHT);
  return phases.map(([from, label], i) => ({ label, from, left: Math.max(LEFT, x(from)), right: x(phases[i + 1]?.[0] ?? latest) }));
}

function drawPhases(canvas) {
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
  const context = canvas.getContext('2d');
  context.clearRect(0, 0, width, height);
  context.font = '14px "DejaVu Sans", Verdana, sans-serif';
  const found = barsIn(width);
  const box = canvas.getBoundingClientRect();
  bars = found.map((bar) => ({ ...bar, left: box.left + bar.left, right: box.left + bar.right }));
  found.forEach(({ label, left, right }, i) => {
    if (right <= left) return;
    context.fillStyle = BARS[i % BARS.length];
    context.fillRect(left, 1, right - left, height - 2);
    context.strokeStyle = '#1b1f24';
    context.strokeRect(left, 1, right - left, height - 2);
    context.save();
    context.beginPath();
    context.rect(left, 0, right - left, height);
    context.clip();
    context.fillStyle = '#1b1f24';
    context.fillText(label, left + 4, height - 7);
    context.restore();
  });
}

function rememberPhase(state) {
  const label = state.words;
  if (latest > state.stamp) phases = [];
  if (phases[phases.length - 1]?.[1] !== label) phases.push([state.stamp - (phases.length ? 0 : Math.min(state.since, WINDOW)), label]);
  while (phases.length > 1 && phases[1][0] < state.stamp - WINDOW) phases.shift();
}

/** Removes dygraphs' legend: it sets inline styles, which the page's security policy forbids. Ours is beside the chart. */
function withoutLegend() {
  window.Dygraph.PLUGINS = window.Dygraph.PLUGINS.filter((plugin) => plugin !== window.Dygraph.Plugins.Legend);
}

/** Loads dygraphs as a script, because it is not a module. */
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
    axes: { x: { drawAxis: last, axisLabelFormatter: axis, valueFormatter: axis, axisLabelWidth: 40, pixelsPerLabel: 60 }, y: { axisLabelWidth: 38, pixelsPerLabel: 17, axisLabelFormatter: (value) => String(Number(value.toPrecision(2))) } },
    dateWindow: [-WINDOW, 0],
  };
}

/** Legend entry: a sample of the line, and its name. */
function legend(name, i) {
  const line = svg('line', { x1: 0, y1: 5, x2: 22, y2: 5, stroke: COLOURS[i], 'stroke-width': 3, ...(DASHES[i] && { 'stroke-dasharray': DASHES[i].join(' ') }) });
  return h('i', {}, svg('svg', { width: 22, height: 10, 'aria-hidden': 'true' }, line), name);
}

export function showCharts(parent) {
  const canvas = h('canvas', { role: 'img', 'aria-label': 'Phases' });
  parent.append(h('div', { class: 'strip phases' }, canvas));
  const note = h('p', { hidden: true }, 'Strip charts need libjs-dygraphs: apt install libjs-dygraphs.');
  for (const [i, strip] of STRIPS.entries()) {
    strip.rows = [];
    strip.place = h('div', { role: 'img', 'aria-label': strip.name });
    const names = strip.series.map((name, k) => legend(name, strip.colours[k]));
    parent.append(h('div', { class: `strip${i === STRIPS.length - 1 ? ' last' : ''}` }, h('div', { class: 'name' }, h('b', {}, strip.name), names), strip.place));
  }
  parent.append(note);

  const redraw = drawn(() => {
    if (parent.offsetParent === null) return;
    drawPhases(canvas);
    STRIPS.forEach((strip, i) => {
      if (!strip.rows.length || !window.Dygraph) return;
      const range = { dateWindow: [latest - WINDOW, latest] };
      if (strip.chart) strip.chart.updateOptions({ file: strip.rows, ...range });
      else strip.chart = new window.Dygraph(strip.place, strip.rows, { ...optionsOf(strip, i === STRIPS.length - 1), ...range });
    });
  }, () => 250);

  new ResizeObserver(() => {
    if (parent.offsetParent !== null) for (const { chart } of STRIPS) chart?.resize();
    redraw();
  }).observe(parent);
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

/**
 * For the tests, a copy of the strips: { name, series, rows (stamp and a value per series), axis (s), edges (px of the page
 * at both ends of the axis), drawn (dash and colour per series) }. A strip that is not drawn yet lacks the last three.
 */
export function stripsShown() {
  return STRIPS.map(({ name, series, rows, chart, place }) => {
    const shown = { name, series: [...series], rows: structuredClone(rows) };
    if (!chart) return shown;
    const { left } = place.getBoundingClientRect();
    const axis = chart.xAxisRange();
    const drawn = series.map((one, i) => [chart.getOption('strokePattern', one), chart.getColors()[i]]);
    return { ...shown, axis, edges: axis.map((stamp) => left + chart.toDomXCoord(stamp)), drawn };
  });
}

/** For the tests, a copy of the phase bars as drawn last: { label, from (s), left, right (px of the page) }. */
export function barsShown() {
  return structuredClone(bars);
}
