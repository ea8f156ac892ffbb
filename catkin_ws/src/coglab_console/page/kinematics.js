// Poses [x, y, z, qx, qy, qz, qw] and the kinematics of the robot's description.

export const IDENTITY = [0, 0, 0, 0, 0, 0, 1];

function turn([x, y, z, w], [a, b, c]) {
  const tx = 2 * (y * c - z * b);
  const ty = 2 * (z * a - x * c);
  const tz = 2 * (x * b - y * a);
  return [a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx];
}

/** Pose b, given in the frame of a. */
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

/** Pose of each link in the root, by name. `order`: names of the moving joints, `q` their positions. */
export function linkPoses(robot, order, q) {
  const positions = Object.fromEntries(order.map((name, i) => [name, q[i] ?? 0]));
  const poses = { [robot.root]: IDENTITY };
  for (const joint of robot.joints) {
    poses[joint.child] = compose(compose(poses[joint.parent], joint.pose), motion(joint, positions[joint.name] ?? 0));
  }
  return poses;
}
