// Faults of the page now: scroll bars, STOP hidden, controls without a name, too small or
// disabled without a reason, pale text.
const problems = [];
const root = document.scrollingElement;
if (root.scrollHeight > root.clientHeight || root.scrollWidth > root.clientWidth) problems.push('the page scrolls');
if (!document.getElementById('live').hidden) {
  for (const element of document.querySelectorAll('#live, #live *')) {
    const style = getComputedStyle(element);
    const scrolls = ['auto', 'scroll'];
    if ((scrolls.includes(style.overflowY) && element.scrollHeight > element.clientHeight) || (scrolls.includes(style.overflowX) && element.scrollWidth > element.clientWidth)) problems.push(`${element.tagName} ${element.id} scrolls`);
  }
}

const stop = document.getElementById('stop').getBoundingClientRect();
if (stop.width < 180 || stop.height < 56 || stop.left < 0 || stop.top < 0 || stop.right > innerWidth || stop.bottom > innerHeight) problems.push(`STOP is at ${JSON.stringify(stop)}`);
const over = document.elementFromPoint(stop.left + stop.width / 2, stop.top + stop.height / 2);
if (!document.getElementById('stop').contains(over)) problems.push(`${over.tagName} lies over STOP`);

const seen = (element) => element.checkVisibility({ checkOpacity: false }) && element.getClientRects().length > 0;
const nameOf = (element) => element.getAttribute('aria-label') || (element.matches('.more') && element.textContent.trim()) || (element.labels?.length && element.labels[0].textContent.trim()) || (['BUTTON', 'SUMMARY', 'A'].includes(element.tagName) && element.textContent.trim());
const ids = new Set();
for (const element of document.querySelectorAll('[id]')) {
  if (ids.has(element.id)) problems.push(`two elements are named ${element.id}`);
  ids.add(element.id);
}
for (const element of document.querySelectorAll('button, input, select, textarea, summary, a, [tabindex]')) {
  if (!seen(element)) continue;
  if (!nameOf(element)) problems.push(`${element.outerHTML.slice(0, 120)} has no name`);
}
for (const element of document.querySelectorAll('button, input, select, textarea, summary')) {
  const box = element.getBoundingClientRect();
  if (seen(element) && box.height < 43.5) problems.push(`${element.outerHTML.slice(0, 90)} is ${box.height} px high`);
}

for (const element of document.querySelectorAll('[aria-disabled=true]')) {
  const why = document.getElementById(element.getAttribute('aria-describedby'));
  if (seen(element) && !(why && seen(why) && why.textContent.trim())) problems.push(`${nameOf(element)} does not say why it is disabled`);
}
for (const why of document.querySelectorAll('#actions .why')) {
  if (seen(why) && why.scrollHeight > why.clientHeight + 1) problems.push(`"${why.textContent}" is cut off`);
}

// What has no room must be seen in full with the focus on it.
const status = document.getElementById('status');
if (seen(status) && status.scrollHeight > status.clientHeight + 1) problems.push('the column of the status is cut off');
for (const place of document.querySelectorAll('#now dd, #status dd, #graph p.last, .crumbs, #log-place, #log')) {
  const words = place.querySelector('.all') ?? place;
  const cut = () => [words, ...words.querySelectorAll('li')].some((one) => one.scrollHeight > one.clientHeight + 1 || one.scrollWidth > one.clientWidth + 1);
  if (!seen(place) || place.matches('.all') || !cut()) continue;
  const before = document.activeElement;
  place.focus();
  const [box, around] = [words, place.closest('#status, #graph') ?? document.body].map((one) => one.getBoundingClientRect());
  const inside = box.top >= around.top && box.bottom <= around.bottom && box.left >= around.left && box.right <= around.right;
  if (document.activeElement !== place || cut() || !inside) problems.push(`"${words.textContent}" is cut off`);
  // The focus goes back to where it was, and Tab on from there.
  if (before === document.body) before.tabIndex = -1;
  before.focus();
  if (before === document.body) before.removeAttribute('tabindex');
}
const graph = document.querySelector('#graph svg');
if (graph?.querySelector('text') && seen(graph)) {
  const height = 11 * (graph.getScreenCTM()?.a ?? 1);
  if (height < 13.9) problems.push(`letters of the graph are ${height.toFixed(1)} px high`);
}

function channels(text) {
  const [r, g, b, a = '1'] = text.match(/[\d.]+/g) ?? ['0', '0', '0', '0'];
  return [Number(r), Number(g), Number(b), Number(a)];
}
function luminance([r, g, b]) {
  const [x, y, z] = [r, g, b].map((value) => (value / 255 <= 0.03928 ? value / 255 / 12.92 : ((value / 255 + 0.055) / 1.055) ** 2.4));
  return 0.2126 * x + 0.7152 * y + 0.0722 * z;
}
function ground(element) {
  let shown = [255, 255, 255, 0];
  for (let at = element; at; at = at.parentElement) {
    const [r, g, b, a] = channels(getComputedStyle(at).backgroundColor);
    if (a > 0.8) { shown = [r, g, b, 1]; break; }
  }
  return shown[3] ? shown : [255, 255, 255, 1];
}
let texts = 0;
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
  const node = walker.currentNode;
  const element = node.parentElement;
  if (!node.textContent.trim() || !seen(element) || element.closest('svg, script, [aria-hidden]')) continue;
  texts += 1;
  const style = getComputedStyle(element);
  const [light, dark] = [luminance(channels(style.color)), luminance(ground(element))].sort((a, b) => b - a);
  const ratio = (light + 0.05) / (dark + 0.05);
  if (ratio < 4.5) problems.push(`"${node.textContent.trim().slice(0, 30)}" has a contrast of ${ratio.toFixed(2)}`);
  if (parseFloat(style.fontSize) < 14) problems.push(`"${node.textContent.trim().slice(0, 30)}" is ${style.fontSize} high`);
}
return { problems, texts };
