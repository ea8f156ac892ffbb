// The 3D view, with Debian's three.js (r111).
import * as THREE from '/lib/three/build/three.module.js';
import { OrbitControls } from '/lib/three/examples/jsm/controls/OrbitControls.js';
import { fixedShapes, HAND_SHAPES, objectShape, path, robotPoses, robotShapes } from './cell.js';
import { store } from './link.js';

const HALF_HIGH = Math.tan((19 * Math.PI) / 180); // half the height of the picture, at a distance of 1
const NARROW = 1.5; // width / height below which the visible width stays constant, so that arm and person stay in the picture
const CAMERAS = {
  front: [[1.75, -1.55, 0.75], [0.42, 0.02, 0.24]],
  side: [[0.45, -2.2, 0.5], [0.45, 0, 0.27]],
  top: [[0.35, -0.02, 2.6], [0.35, 0, 0.2]],
  hand: null,
};

function geometryOf({ kind, size }) {
  if (kind === 'box') return new THREE.BoxBufferGeometry(...size);
  if (kind === 'sphere') return new THREE.SphereBufferGeometry(size[0], 20, 14);
  const cylinder = new THREE.CylinderBufferGeometry(size[0], size[0], size[1], 20);
  cylinder.rotateX(Math.PI / 2); // three's axis is y, the URDF's is z
  return cylinder;
}

function meshOf(shape) {
  const mesh = new THREE.Mesh(geometryOf(shape), new THREE.MeshLambertMaterial({ color: shape.colour }));
  place(mesh, shape.pose);
  return mesh;
}

function place(object, [x, y, z, qx, qy, qz, qw]) {
  object.position.set(x, y, z);
  object.quaternion.set(qx, qy, qz, qw);
}

/** True without a graphics card. Each picture then loads the robot's processor, so fewer are drawn. */
function drawsInSoftware(renderer) {
  const context = renderer.getContext();
  const known = context.getExtension('WEBGL_debug_renderer_info');
  return !known || /swiftshader|llvmpipe|software/i.test(context.getParameter(known.UNMASKED_RENDERER_WEBGL));
}

/** A 3D view in `parent`; throws without WebGL. */
export class Scene3D {
  constructor(parent) {
    this.renderer = new THREE.WebGLRenderer({ antialias: false });
    this.shortest = drawsInSoftware(this.renderer) ? 150 : 33;
    this.renderer.setClearColor('#f4f6f8');
    this.canvas = this.renderer.domElement;
    this.canvas.setAttribute('role', 'img');
    this.canvas.setAttribute('aria-label', 'Arm, hands, object and path in three dimensions');
    this.canvas.hidden = true; // black before the first picture
    parent.append(this.canvas);
    this.parent = parent;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(38, 1, 0.05, 20);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.enableKeys = false;
    this.changed = () => {};
    this.controls.addEventListener('change', () => this.changed());
    this.links = {};
    this.built = {};
    this.addLight();
    this.addFloor();
    this.hand = new THREE.Group();
    this.hand.add(...HAND_SHAPES.map(meshOf));
    this.object = new THREE.Group();
    this.goal = new THREE.Mesh(new THREE.SphereBufferGeometry(0.018, 14, 10), new THREE.MeshLambertMaterial({ color: '#cc79a7' }));
    this.line = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: '#0072b2', linewidth: 3 }));
    this.scene.add(this.hand, this.object, this.goal, this.line);
    this.look('front');
  }

  addLight() {
    const sun = new THREE.DirectionalLight('#ffffff', 0.65);
    sun.position.set(1.5, -1.2, 3);
    this.scene.add(new THREE.HemisphereLight('#ffffff', '#8a9098', 0.75), sun);
  }

  addFloor() {
    const grid = new THREE.GridHelper(4, 16, '#aab2ba', '#d3d9de');
    grid.rotation.x = Math.PI / 2;
    grid.position.z = -0.75;
    this.scene.add(grid);
  }

  look(name) {
    this.following = name === 'hand';
    const [from, to] = CAMERAS[name] ?? [[1.5, -1.1, 0.9], [0.5, 0, 0.4]];
    this.camera.position.set(...from);
    this.controls.target.set(...to);
    this.controls.update();
    this.changed();
  }

  build() {
    const model = store.docs.model;
    if (model && this.built.model !== model) {
      this.built.model = model;
      for (const link of Object.values(this.links)) this.scene.remove(link);
      this.links = {};
      for (const shape of robotShapes()) {
        this.links[shape.link] = this.links[shape.link] ?? new THREE.Group();
        this.links[shape.link].add(meshOf(shape));
      }
      for (const name of ['ih2_palm', ...Object.keys(this.links)]) {
        this.links[name] = this.links[name] ?? new THREE.Group();
        this.scene.add(this.links[name]);
      }
      this.addWorkspace(model.workspace);
    }
    const board = JSON.stringify(store.state?.frames.board ?? null);
    if (this.built.board !== board) {
      this.built.board = board;
      if (this.fixed) this.scene.remove(this.fixed);
      this.fixed = new THREE.Group();
      this.fixed.add(...fixedShapes().map(meshOf));
      this.scene.add(this.fixed);
    }
    const shape = objectShape();
    if (this.built.object !== JSON.stringify(shape)) {
      this.built.object = JSON.stringify(shape);
      this.object.remove(...this.object.children);
      if (shape) this.object.add(meshOf(shape));
    }
  }

  addWorkspace({ low, high }) {
    if (this.workspace) this.scene.remove(this.workspace);
    const box = new THREE.Box3(new THREE.Vector3(...low), new THREE.Vector3(...high));
    this.workspace = new THREE.Box3Helper(box, '#56b4e9');
    this.scene.add(this.workspace);
  }

  update() {
    this.build();
    for (const [name, pose] of Object.entries(robotPoses())) {
      if (this.links[name]) place(this.links[name], pose);
    }
    const frames = store.state?.frames ?? {};
    this.hand.visible = Boolean(frames.hand);
    if (frames.hand) place(this.hand, frames.hand);
    this.object.visible = Boolean(frames.object);
    if (frames.object) place(this.object, frames.object);
    this.drawPath();
    if (this.following && this.links.ih2_palm) {
      this.controls.target.copy(this.links.ih2_palm.position);
      this.camera.lookAt(this.controls.target);
    }
  }

  drawPath() {
    const shown = path();
    this.line.visible = this.goal.visible = Boolean(shown);
    if (!shown) return;
    this.goal.position.set(...shown.goal);
    const text = JSON.stringify(shown.points);
    if (this.built.path !== text) {
      this.built.path = text;
      this.line.geometry.dispose();
      const points = shown.points.map((point) => new THREE.Vector3(...point));
      const curve = new THREE.CatmullRomCurve3(points.length > 1 ? points : [points[0], points[0]]);
      this.scene.remove(this.line);
      const running = shown.kind === 'running';
      this.line = new THREE.Mesh(new THREE.TubeBufferGeometry(curve, 40, running ? 0.006 : 0.0035, 6), new THREE.MeshBasicMaterial({ color: running ? '#0072b2' : '#56b4e9' }));
      this.scene.add(this.line);
    }
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.parent;
    if (!width || !height) return;
    if (this.width !== width || this.height !== height) {
      this.width = width;
      this.height = height;
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.camera.fov = (2 * Math.atan(HALF_HIGH * Math.max(1, NARROW / this.camera.aspect)) * 180) / Math.PI;
      this.camera.updateProjectionMatrix();
    }
    this.update();
    this.renderer.render(this.scene, this.camera);
    this.canvas.hidden = false;
  }

  /** Position of the palm in the scene, m. */
  palm() {
    const at = new THREE.Vector3();
    if (!this.links.ih2_palm) return null;
    this.update();
    this.links.ih2_palm.updateMatrixWorld(true);
    return this.links.ih2_palm.getWorldPosition(at).toArray();
  }

  remove() {
    this.controls.dispose();
    this.renderer.dispose();
    this.canvas.remove();
  }
}
