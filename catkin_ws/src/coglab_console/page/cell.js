// Shapes and poses (world, m) for the 2D and the 3D view, and the kinematics.
import { store } from './link.js';

export const IDENTITY = [0, 0, 0, 0, 0, 0, 1];

function turn([x, y, z, w], [a, b, c]) {
  const tx = 2 * (y * c - z * b);
  const ty = 2 * (z * a - x * c);
  const tz = 2 * (x * b - y * a);
  return [a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx];
}

/** Pose b, given in the frame of a, in the parent frame of a. */
export function compose(a, b) {
  const [px, py, pz] = turn(a.slice(3), b);
  const [ax, ay, az, aw] = a.slice(3);
  const [bx, by, bz, bw] = b.slice(3);
  return [
    a[0] + px, a[1] + py, a[2] + pz,
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
}

function motion(joint, q) {
  if (joint.kind === 'prismatic') return [...joint.axis.map((value) => value * q), 0, 0, 0, 1];
  if (joint.kind !== 'revolute' && joint.kind !== 'continuous') return IDENTITY;
  const s = Math.sin(q / 2);
  return [0, 0, 0, joint.axis[0] * s, joint.axis[1] * s, joint.axis[2] * s, Math.cos(q / 2)];
}

/** Pose of each link in the root frame, by name. `order`: names of the moving joints; `q`: their positions. */
export function linkPoses(robot, order, q) {
  const positions = Object.fromEntries(order.map((name, i) => [name, q[i] ?? 0]));
  const poses = { [robot.root]: IDENTITY };
  for (const joint of robot.joints) {
    poses[joint.child] = compose(compose(poses[joint.parent], joint.pose), motion(joint, positions[joint.name] ?? 0));
  }
  return poses;
}

const COLOURS = { arm: '#e08a2c', joint: '#5b6670', hand: '#39434c', finger: '#6b7680', '': '#8b939b' };
const SKIN = '#d8a47f';
const SLEEVE = '#7d93a8';
const OBJECT = '#009e73';
const WOOD = '#cdb489';
const PALM = 'ih2_palm';

/** Shapes that do not move: { kind, size, pose, colour }. */
export function fixedShapes() {
  const shapes = [{ kind: 'box', size: [0.3, 0.3, 0.75], pose: [0, 0, -0.375, 0, 0, 0, 1], colour: '#9aa2aa' }];
  const board = store.state?.frames.board;
  if (board) shapes.push({ kind: 'box', size: [0.4, 0.5, 0.02], pose: compose(board, [0, 0, -0.01, 0, 0, 0, 1]), colour: WOOD });
  return shapes;
}

/** Shapes of the robot: [{ link, kind, size, pose (in the link), colour }]. */
export function robotShapes() {
  const robot = store.docs.model?.robot;
  if (!robot) return [];
  return Object.entries(robot.shapes).flatMap(([link, shapes]) => shapes.map((shape) => ({ ...shape, link, colour: COLOURS[shape.of] ?? COLOURS[''] })));
}

/** Pose of each link of the robot now. */
export function robotPoses() {
  const model = store.docs.model;
  return model?.robot && store.state ? linkPoses(model.robot, model.order, store.state.q) : {};
}

/** Position of the robot's palm in the picture, m; null if unknown. */
export function palmInScene() {
  return robotPoses()[PALM]?.slice(0, 3) ?? null;
}

/** A person's right hand in its own frame: palm centre, x toward the robot's side of the grip. */
export const HAND_SHAPES = [
  { kind: 'box', size: [0.03, 0.09, 0.1], pose: IDENTITY, colour: SKIN },
  ...[-0.034, -0.011, 0.011, 0.034].map((y) => ({ kind: 'cylinder', size: [0.009, 0.08], pose: [-0.03, y, 0.06, 0, -0.3, 0, 0.954], colour: SKIN })),
  { kind: 'cylinder', size: [0.011, 0.06], pose: [-0.03, 0.055, 0.01, 0.38, 0, 0, 0.925], colour: SKIN },
  { kind: 'cylinder', size: [0.035, 0.26], pose: [0.16, 0, -0.06, 0, 0.79, 0, 0.61], colour: SLEEVE },
];

/** Shape of the held object or of the next action's object, in its own frame (origin: middle of its underside). */
export function objectShape() {
  const id = store.docs.status?.machine.object || store.docs.desk?.object || store.docs.status?.machine.fallback;
  const row = store.docs.objects?.rows.find((one) => one.id === id);
  if (!row?.shape) return null;
  const { type, radius, height } = row.shape;
  if (type === 'cylinder') return { kind: 'cylinder', size: [radius, height], pose: [0, 0, height / 2, 0, 0, 0, 1], colour: OBJECT };
  if (type === 'sphere') return { kind: 'sphere', size: [radius], pose: [0, 0, radius, 0, 0, 0, 1], colour: OBJECT };
  return { kind: 'box', size: row.size, pose: [0, 0, row.size[2] / 2, 0, 0, 0, 1], colour: OBJECT };
}

/** Age of a frame in words, or 'not seen'. */
export function ageWords(role) {
  const age = store.state?.ages[role];
  if (age === undefined) return 'not seen';
  return age < 1 ? `${Math.round(age * 1000)} ms old` : `${age.toFixed(age < 10 ? 1 : 0)} s old`;
}

/** Path and goal to draw: { kind, points, goal }, or null. */
export function path() {
  return store.docs.path?.points.length ? store.docs.path : null;
}

export function viewWords() {
  const shown = store.docs.path;
  const model = store.docs.model;
  if (model && !model.robot) return 'No description of the robot: it is not drawn.';
  if (store.state && !store.state.live) return 'No new data from the arm; this is its last position.';
  if (!shown) return '';
  if (shown.kind === 'refused') return `▲ The next motion could not begin now: ${shown.reason}`;
  const kind = shown.kind === 'running' ? 'Path of this motion' : 'Path of the next motion, if it began now';
  return `${kind}: ${shown.motion}, ${shown.times[shown.times.length - 1].toFixed(1)} s`;
}
