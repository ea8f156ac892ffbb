// The picture of the cell: 3D where there is WebGL and libjs-three, otherwise 2D; cameras by button.
import { drawn, h, setAttribute, setText } from './dom.js';
import { on, onDocs, store } from './store.js';
import { viewWords } from './cell.js';
import { Scene2D } from './scene2d.js';

let scene = null;
let redraw = () => {};

/** Place of the palm as the picture shows it, m: the tests compare it with tf. */
export function palmShown() {
  return scene?.palm() ?? null;
}

export function viewKind() {
  return scene instanceof Scene2D ? '2D' : scene ? '3D' : 'none';
}

async function make(parent, wanted3d) {
  scene?.remove();
  scene = null;
  if (wanted3d && store.docs.model?.three !== false) {
    try {
      const { Scene3D } = await import('./scene3d.js');
      scene = new Scene3D(parent);
    } catch (error) {
      console.warn(`2D view: ${error.message}`);
    }
  }
  scene = scene ?? new Scene2D(parent);
  scene.changed = redraw;
  redraw();
}

export function showView(parent) {
  const words = document.getElementById('view-words');
  const bar = document.getElementById('cameras');
  redraw = drawn(() => {
    if (parent.offsetParent === null) return;
    scene?.draw();
    setText(words, viewWords());
  }, () => scene?.shortest ?? 50);
  const buttons = ['front', 'side', 'top', 'hand'].map((name) => h('button', { type: 'button', 'aria-pressed': 'false', onclick: () => look(name) }, name));
  const flat = h('button', { type: 'button', 'aria-pressed': 'false', onclick: () => toggle() }, '2D');
  bar.append(...buttons, flat);

  let camera = 'front';
  function look(name) {
    camera = name;
    scene?.look(name);
    for (const button of buttons) setAttribute(button, 'aria-pressed', String(button.textContent === name));
  }
  async function toggle() {
    await make(parent, viewKind() === '2D');
    show();
  }
  function show() {
    const is2d = viewKind() === '2D';
    setAttribute(flat, 'aria-pressed', String(is2d));
    for (const button of buttons) button.hidden = is2d;
    if (!is2d) look(camera);
  }
  let begun = false;
  onDocs(['model'], async () => {
    if (begun || !store.docs.model) return;
    begun = true;
    await make(parent, true);
    show();
  });
  on('state', redraw);
  onDocs(['path', 'objects'], redraw);
}
