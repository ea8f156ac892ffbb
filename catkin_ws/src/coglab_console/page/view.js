// The picture of the cell: 3D with WebGL and libjs-three, otherwise 2D; buttons choose the camera.
import { compose, fixedShapes, HAND_SHAPES, objectShape, palmInScene, path, robotPoses, robotShapes, viewWords } from './cell.js';
import { on, onDocs, store } from './link.js';
import { drawn, h, setAttribute, setText } from './dom.js';

const VIEWS = [
  { name: 'from the side', across: 0, up: 2, low: [-0.55, -0.35], high: [1.6, 1.2] },
  { name: 'from above', across: 0, up: 1, low: [-0.55, -0.85], high: [1.6, 0.85] },
];

/** End points of a shape's axis (world frame) and its half width, m. */
function barOf({ kind, size, pose }) {
  if (kind === 'sphere') return [pose, pose, size[0]];
  const [length, half] = kind === 'cylinder' ? [size[1], size[0]] : [size[2], Math.max(size[0], size[1]) / 2];
  return [compose(pose, [0, 0, length / 2, 0, 0, 0, 1]), compose(pose, [0, 0, -length / 2, 0, 0, 0, 1]), half];
}

export class Scene2D {
  constructor(parent) {
    this.parent = parent;
    this.canvas = document.createElement('canvas');
    this.canvas.setAttribute('role', 'img');
    this.canvas.setAttribute('aria-label', 'Arm, hands, object and path from the side and from above');
    parent.append(this.canvas);
    this.changed = () => {};
  }

  look() {}

  draw() {
    const { clientWidth: width, clientHeight: height } = this.parent;
    if (!width || !height) return;
    this.canvas.width = width;
    this.canvas.height = height;
    const context = this.canvas.getContext('2d');
    VIEWS.forEach((view, i) => {
      context.save();
      context.beginPath();
      context.rect((i * width) / 2, 0, width / 2, height);
      context.clip();
      this.drawView(context, view, (i * width) / 2, width / 2, height);
      context.restore();
    });
  }

  drawView(context, view, left, width, height) {
    const scale = Math.min(width / (view.high[0] - view.low[0]), height / (view.high[1] - view.low[1]));
    const at = (point) => [left + (point[view.across] - view.low[0]) * scale, height - (point[view.up] - view.low[1]) * scale];
    this.drawWorkspace(context, view, at);
    for (const shape of fixedShapes()) this.bar(context, shape, at, scale);
    const poses = robotPoses();
    for (const shape of robotShapes()) {
      if (poses[shape.link]) this.bar(context, { ...shape, pose: compose(poses[shape.link], shape.pose) }, at, scale);
    }
    const { hand, object } = store.state?.frames ?? {};
    if (hand) for (const shape of HAND_SHAPES) this.bar(context, { ...shape, pose: compose(hand, shape.pose) }, at, scale);
    const held = objectShape();
    if (object && held) this.bar(context, { ...held, pose: compose(object, held.pose) }, at, scale);
    this.drawPath(context, at);
    context.fillStyle = '#1b1f24';
    context.font = '14px "DejaVu Sans", Verdana, sans-serif';
    context.fillText(view.name, left + 8, 20);
  }

  drawWorkspace(context, view, at) {
    const workspace = store.docs.model?.workspace;
    if (!workspace) return;
    const [x0, y0] = at(workspace.low);
    const [x1, y1] = at(workspace.high);
    context.strokeStyle = '#56b4e9';
    context.lineWidth = 1;
    context.strokeRect(x0, y0, x1 - x0, y1 - y0);
  }

  bar(context, shape, at, scale) {
    const [a, b, half] = barOf(shape);
    const [x0, y0] = at(a);
    const [x1, y1] = at(b);
    context.lineCap = shape.kind === 'sphere' ? 'round' : 'butt';
    for (const [colour, width] of [['#1b1f24', half * 2 * scale + 2], [shape.colour, half * 2 * scale]]) {
      context.strokeStyle = colour;
      context.lineWidth = Math.max(1, width);
      context.beginPath();
      context.moveTo(x0, y0);
      if (Math.hypot(x1 - x0, y1 - y0) < 1) context.arc(x0, y0, 0.5, 0, 7);
      else context.lineTo(x1, y1);
      context.stroke();
    }
  }

  drawPath(context, at) {
    const shown = path();
    if (!shown) return;
    const running = shown.kind === 'running';
    context.strokeStyle = running ? '#0072b2' : '#56b4e9';
    context.lineWidth = running ? 5 : 2;
    context.setLineDash(running ? [] : [7, 5]);
    context.beginPath();
    for (const point of shown.points) context.lineTo(...at(point));
    context.stroke();
    context.setLineDash([]);
    context.fillStyle = '#cc79a7';
    context.strokeStyle = '#1b1f24';
    context.lineWidth = 1;
    context.beginPath();
    context.arc(...at(shown.goal), 6, 0, 7);
    context.fill();
    context.stroke();
  }

  palm() {
    return palmInScene();
  }

  remove() {
    this.canvas.remove();
  }
}

let scene = null;
let redraw = () => {};

/** Position of the palm in the picture, m; the tests compare it with tf. */
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
