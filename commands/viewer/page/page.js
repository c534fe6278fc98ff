// The page of `armtempo view`: arms, paths and nearest points in space, charts beside them, one clock for all.
// Everything comes with the page, as JSON of `armtempo.commands.viewer`; arrays are base64 of little-endian numbers.
"use strict";
(() => {
const data = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const MOST_VIEWS = 4, SPEEDS = [1, 2, 5, 10, 20], SHOWN_FOR = 7; // [s] that the first play lasts, about
const JOINTS = { light: ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a4b9e", "#8c6d31"],
                 dark: ["#4aa3df", "#ff8a3d", "#2fc79a", "#e39ac4", "#f5bd3d", "#8fd0f5", "#b38ad6", "#c4a55a"] };

window.addEventListener("error", (event) => {
  const note = $("fault") || document.body.appendChild(Object.assign(document.createElement("div"), { id: "fault" }));
  note.textContent = `The page has failed: ${event.message}`;
});

// ---- numbers

function unpack(packed) {
  const text = atob(packed.base64), bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  const types = { f4: Float32Array, u4: Uint32Array, u1: Uint8Array };
  const values = new types[packed.type](bytes.buffer);
  return { values, rows: packed.shape[0], width: packed.shape.slice(1).reduce((a, b) => a * b, 1) };
}
const arrays = new Map();
function array(packed) { // each is unpacked once
  if (!arrays.has(packed)) arrays.set(packed, unpack(packed));
  return arrays.get(packed);
}
const column = (run, name) => array(run.columns[name]);
const endOf = (run) => { const time = column(run, "time").values; return time[time.length - 1]; };

function place(run, t) { // row before t, and how far it is to the next one
  const time = column(run, "time").values, last = time.length - 1;
  if (last === 0 || t >= time[last]) return { row: last, next: last, share: 0 };
  let low = 0, high = last;
  while (high - low > 1) { const middle = (low + high) >> 1; if (time[middle] <= t) low = middle; else high = middle; }
  return { row: low, next: high, share: Math.max(0, (t - time[low]) / (time[high] - time[low])) };
}
function value(run, name, index, at) {
  const { values, width } = column(run, name);
  const a = values[at.row * width + index], b = values[at.next * width + index];
  return a + at.share * (b - a);
}
const nearestRow = (at) => (at.share < 0.5 ? at.row : at.next);

// ---- state

const state = { t: 0, playing: false, slow: 1, shown: [], focus: 0, theme: "light", chosen: false };
const runs = () => state.shown.map((name) => data.runs.find((run) => run.policy === name));
const focused = () => runs()[state.focus];
const duration = () => Math.max(...runs().map(endOf));
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const toned = (color) => (state.theme === "dark" ? color.dark : color.light);

function readAddress() {
  const asked = new URLSearchParams(location.hash.slice(1));
  const names = (asked.get("policy") || "").split(",").filter((name) => data.runs.some((run) => run.policy === name));
  if (names.length) state.shown = names.slice(0, MOST_VIEWS);
  if (asked.has("t")) state.t = Number(asked.get("t")) || 0;
  if (SPEEDS.includes(Number(asked.get("slow")))) state.slow = Number(asked.get("slow"));
  if (["dark", "light"].includes(asked.get("theme"))) [state.theme, state.chosen] = [asked.get("theme"), true];
  state.t = Math.min(Math.max(state.t, 0), duration());
}
function writeAddress() {
  const text = `#t=${state.t.toFixed(4).replace(/\.?0+$/, "")}&policy=${state.shown.map(encodeURIComponent).join(",")}${state.chosen ? `&theme=${state.theme}` : ""}`;
  try { history.replaceState(null, "", text); } catch (error) { /* some places allow no change of the address */ }
}

// ---- the scene

const scene = (() => {
  const stage = $("stage"), canvas = $("scene");
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
  } catch (error) {
    const note = document.createElement("div");
    note.className = "absent";
    note.textContent = "This browser shows no WebGL: the arms cannot be drawn. The charts work.";
    stage.append(note);
    return { draw() {}, reset() {}, paint() {}, relabel() {} };
  }
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = THREE.PCFShadowMap;
  renderer.setScissorTest(true);
  const world = new THREE.Scene(), { low, high, flat } = data.scene;
  const size = Math.hypot(...high.map((h, k) => h - low[k])), centre = low.map((l, k) => (l + high[k]) / 2);
  const camera = new THREE.PerspectiveCamera(32, 1, size / 100, size * 20);
  camera.up.set(0, 0, 1);
  const controls = new THREE.OrbitControls(camera, canvas);
  controls.maxPolarAngle = Math.PI * 0.495;

  const sky = new THREE.HemisphereLight(0xffffff, 0x8890a0, 1.7);
  const sun = new THREE.DirectionalLight(0xffffff, 2.0);
  sky.position.set(0, 0, 1);
  sun.position.set(centre[0] + 0.5 * size, centre[1] - 0.8 * size, centre[2] + 1.6 * size);
  sun.target.position.set(...centre);
  sun.castShadow = true;
  sun.shadow.mapSize.set(2048, 2048);
  Object.assign(sun.shadow.camera, { left: -size, right: size, top: size, bottom: -size, near: size / 10, far: 5 * size });
  sun.shadow.radius = 4;
  sun.shadow.bias = -0.0005;
  sun.shadow.normalBias = size / 400;
  world.add(sky, sun, sun.target);

  // The floor: squares of 0.1 m or 0.5 m, fading outwards is left to the fog.
  const floor = low[2] - 0.004 * size, step = size > 2.5 ? 0.5 : 0.1, reach = Math.ceil((1.6 * size) / step) * step;
  const middle = [Math.round(centre[0] / step) * step, Math.round(centre[1] / step) * step], lines = [];
  for (let k = -reach; k <= reach + step / 2; k += step) {
    lines.push(middle[0] + k, middle[1] - reach, floor, middle[0] + k, middle[1] + reach, floor);
    lines.push(middle[0] - reach, middle[1] + k, floor, middle[0] + reach, middle[1] + k, floor);
  }
  const squares = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ transparent: true, opacity: 0.55 }));
  squares.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(lines), 3));
  const shade = new THREE.Mesh(new THREE.PlaneGeometry(2 * reach, 2 * reach), new THREE.ShadowMaterial({ opacity: 0.22 }));
  shade.position.set(middle[0], middle[1], floor - 0.0005 * size);
  shade.receiveShadow = true;
  world.add(squares, shade);

  const solid = (color, more) => new THREE.MeshStandardMaterial({ color, roughness: 0.55, metalness: 0.05, ...more });
  const meshes = new Map();
  function geometry(shape) {
    const [a, b, c] = shape.size;
    if (shape.kind === "box") return new THREE.BoxGeometry(a, b, c);
    if (shape.kind === "sphere") return new THREE.SphereGeometry(a, 32, 20);
    if (shape.kind === "capsule") return new THREE.CapsuleGeometry(a, b, 12, 32).rotateX(Math.PI / 2);
    if (shape.kind === "cylinder") return new THREE.CylinderGeometry(a, a, b, 40).rotateX(Math.PI / 2);
    if (!meshes.has(shape.mesh)) { // hulls: arms of one kind share them
      const mesh = data.scene.meshes[shape.mesh], made = new THREE.BufferGeometry();
      made.setAttribute("position", new THREE.BufferAttribute(array(mesh.vertices).values, 3));
      made.setIndex(new THREE.BufferAttribute(array(mesh.faces).values, 1));
      const flatly = made.toNonIndexed();
      flatly.computeVertexNormals();
      meshes.set(shape.mesh, flatly);
    }
    return meshes.get(shape.mesh);
  }
  function body(shape, material) {
    const mesh = new THREE.Mesh(geometry(shape), material);
    mesh.matrixAutoUpdate = false;
    mesh.matrix.set(...shape.pose, 0, 0, 0, 1);
    mesh.castShadow = mesh.receiveShadow = true;
    return mesh;
  }

  const stone = solid("#9aa2ab", { roughness: 0.9 });
  for (const shape of data.scene.obstacles) world.add(body(shape, stone));

  function stand(arm, material) { // a base without a shape of its own gets a foot
    const [x, y, z] = [arm.base[3], arm.base[7], arm.base[11]], tall = Math.max(z - floor, 0) + 0.006 * size;
    const foot = new THREE.Mesh(new THREE.CylinderGeometry(0.018 * size, 0.024 * size, tall, 40).rotateX(Math.PI / 2), material);
    foot.position.set(x, y, floor + tall / 2);
    foot.castShadow = foot.receiveShadow = true;
    world.add(foot);
  }

  const axis = new THREE.Vector3(), turn = new THREE.Matrix4(), here = new THREE.Matrix4();
  const arms = data.scene.arms.map((arm) => {
    const material = solid("#ffffff"), frames = [...arm.joints, null].map(() => new THREE.Group());
    for (const frame of frames) { frame.matrixAutoUpdate = false; world.add(frame); }
    frames[0].matrix.set(...arm.base, 0, 0, 0, 1);
    const links = arm.joints.map((joint) => ({
      ...joint, placed: new THREE.Matrix4().set(...joint.placement, 0, 0, 0, 1),
    }));
    for (const shape of arm.shapes) frames[shape.link + 1].add(body(shape, material));
    const tip = new THREE.Mesh(new THREE.SphereGeometry(0.007 * size, 20, 14), solid("#ffffff", { roughness: 0.3 }));
    tip.position.set(arm.tip[0], arm.tip[1], arm.tip[2]);
    frames[frames.length - 1].add(tip);
    if (!arm.shapes.some((shape) => shape.link < 0)) stand(arm, material);
    const label = document.createElement("span");
    return { arm, material, frames, links, tip, label };
  });
  function pose(k, run, at) { // forward kinematics: the page has the joints, not the links
    const { frames, links } = arms[k], name = `q${k}`;
    here.copy(frames[0].matrix);
    links.forEach((link, j) => {
      const q = value(run, name, j, at);
      axis.set(...link.axis);
      if (link.slides) turn.makeTranslation(q * axis.x, q * axis.y, q * axis.z);
      else turn.makeRotationAxis(axis, q);
      here.multiply(link.placed).multiply(turn);
      frames[j + 1].matrix.copy(here);
    });
    frames.forEach((frame) => { frame.matrixWorldNeedsUpdate = true; });
  }

  // Paths: a pale tube, and the travelled part of it in full colour.
  const SIDES = 8;
  const tubes = new Map();
  function tube(packed) {
    if (!tubes.has(packed)) {
      const { values, rows } = array(packed), points = [];
      for (let k = 0; k < rows; k++) {
        const point = new THREE.Vector3(values[3 * k], values[3 * k + 1], values[3 * k + 2]);
        if (!points.length || point.distanceTo(points[points.length - 1]) > 1e-6) points.push(point);
      }
      tubes.set(packed, points.length > 1 ? { points, whole: tubeAlong(points, 0.0030), done: tubeAlong(points, 0.0042) } : null);
    }
    return tubes.get(packed);
  }
  function tubeAlong(points, thick) { // TubeGeometry spaces by length: this keeps the given points
    const curve = new THREE.CatmullRomCurve3(points);
    curve.getPointAt = curve.getPoint;
    curve.getTangentAt = curve.getTangent;
    return new THREE.TubeGeometry(curve, 2 * (points.length - 1), thick * size, SIDES, false);
  }
  const ways = data.scene.arms.map(() => {
    const whole = new THREE.Mesh(undefined, new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.35 }));
    const done = new THREE.Mesh(undefined, new THREE.MeshBasicMaterial());
    world.add(whole, done);
    return { whole, done };
  });
  function way(k, run, at) {
    const { whole, done } = ways[k], made = tube(data.paths[run.paths[k]]);
    whole.visible = done.visible = made !== null;
    if (!made) return;
    whole.geometry = made.whole;
    done.geometry = made.done;
    const share = Math.min(Math.max(value(run, "progress", k, at), 0), 1);
    made.done.setDrawRange(0, Math.round(share * 2 * (made.points.length - 1)) * SIDES * 6);
  }

  // Nearest points: two balls and a rod between them.
  const warm = new THREE.MeshBasicMaterial(), rod = new THREE.Mesh(new THREE.CylinderGeometry(1, 1, 1, 12), warm);
  const balls = [0, 1].map(() => new THREE.Mesh(new THREE.SphereGeometry(0.0065 * size, 16, 12), warm));
  const both = [new THREE.Vector3(), new THREE.Vector3()], between = new THREE.Vector3();
  const frame = data.scene.follows ? [0, 1, 2].map((k) => {
    const made = new THREE.Mesh(new THREE.CylinderGeometry(0.006 * size, 0.006 * size, 0.12 * size, 12),
      new THREE.MeshBasicMaterial({ color: ["#d62839", "#2a9d3f", "#2667d6"][k] }));
    made.matrixAutoUpdate = false;
    world.add(made);
    return made;
  }) : [];
  world.add(rod, ...balls);
  function nearest(run, at) {
    const row = nearestRow(at), values = run.columns.nearest === undefined ? [NaN] : column(run, "nearest").values;
    const told = Number.isFinite(values[6 * row]); // not where arms touch, nor of one arm
    rod.visible = balls[0].visible = balls[1].visible = told;
    if (!told) return false;
    both.forEach((point, k) => point.fromArray(values, 6 * row + 3 * k));
    between.subVectors(both[1], both[0]);
    rod.position.addVectors(both[0], both[1]).multiplyScalar(0.5);
    rod.scale.set(0.0028 * size, between.length(), 0.0028 * size);
    rod.quaternion.setFromUnitVectors(axis.set(0, 1, 0), between.normalize());
    balls.forEach((ball, k) => ball.position.copy(both[k]));
    return true;
  }
  function target(run, at) { // the axes of a pose that is followed: x red, y green, z blue
    if (!frame.length) return;
    const row = nearestRow(at), { values } = column(run, "target"), o = 12 * row, half = 0.06 * size;
    const R = [0, 1, 2].map((c) => [0, 1, 2].map((r) => values[o + 4 * r + c])), p = [3, 7, 11].map((i) => values[o + i]);
    frame.forEach((made, k) => {
      const y = R[k], x = R[(k + 1) % 3], z = R[(k + 2) % 3]; // a cylinder lies along its y
      made.matrix.set(x[0], y[0], z[0], p[0] + half * y[0], x[1], y[1], z[1], p[1] + half * y[1], x[2], y[2], z[2], p[2] + half * y[2], 0, 0, 0, 1);
      made.matrixWorldNeedsUpdate = true;
    });
  }

  // Views: one for each policy on show, all seen from the same place.
  let moved = false, boxes = [];
  controls.addEventListener("start", () => { moved = true; });
  controls.addEventListener("change", () => clock.ask());
  canvas.addEventListener("pointerdown", (event) => {
    const x = event.offsetX, y = event.offsetY;
    const k = boxes.findIndex((box) => x >= box.x && x < box.x + box.w && y >= box.y && y < box.y + box.h);
    if (k >= 0 && k !== state.focus) { state.focus = k; refresh(); }
  });
  // The first view: from above where everything is flat, else from the side.
  const tilt = flat ? 0.62 : 1.12, turned = flat ? 0 : 0.6, dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const back = [Math.sin(tilt) * Math.sin(turned), -Math.sin(tilt) * Math.cos(turned), Math.cos(tilt)];
  const right = [Math.cos(turned), Math.sin(turned), 0];
  const up = [-Math.cos(tilt) * Math.sin(turned), Math.cos(tilt) * Math.cos(turned), Math.sin(tilt)];
  const ends = [...Array(array(data.scene.reach).rows).keys()].map((k) => [0, 1, 2].map((i) => array(data.scene.reach).values[3 * k + i] - centre[i]));
  const seen = [right, up].map((d) => [Math.min(...ends.map((p) => dot(p, d))), Math.max(...ends.map((p) => dot(p, d)))]);
  const extent = () => seen.map(([a, b]) => b - a);
  function reset() { // as near as shows everything that the arms reach
    const width = boxes.length ? boxes[0].w / boxes[0].h : 1, tan = Math.tan((camera.fov * Math.PI) / 360) * 0.86;
    const mid = seen.map(([a, b]) => (a + b) / 2), aim = [0, 1, 2].map((i) => mid[0] * right[i] + mid[1] * up[i]);
    let distance = size / 4;
    for (const p of ends) {
      const q = p.map((x, i) => x - aim[i]);
      distance = Math.max(distance, dot(q, back) + Math.max(Math.abs(dot(q, up)) / tan, Math.abs(dot(q, right)) / (tan * width)));
    }
    controls.target.set(...aim.map((x, i) => x + centre[i]));
    camera.position.set(...back.map((x, i) => controls.target.getComponent(i) + distance * x));
    camera.aspect = width;
    camera.updateProjectionMatrix();
    controls.update();
    moved = false;
  }
  function paint() {
    world.background = new THREE.Color(css("--scene"));
    squares.material.color.set(css("--floor"));
    shade.material.opacity = state.theme === "dark" ? 0.5 : 0.2;
    sky.intensity = state.theme === "dark" ? 1.15 : 1.7;
    arms.forEach(({ arm, material, label }, k) => {
      const color = toned(arm.color);
      material.color.set(color);
      ways[k].whole.material.color.set(color);
      ways[k].done.material.color.set(color);
      label.style.color = color;
    });
  }

  let width = 0, height = 0, labels = [];
  function layout() { // in as many columns as show the arms largest
    const n = state.shown.length, largest = (columns) => {
      const shown = extent(), w = width / columns, h = height / Math.ceil(n / columns);
      return Math.min(w / shown[0], h / shown[1]);
    };
    const columns = [...Array(n).keys()].map((k) => k + 1).reduce((a, b) => (largest(b) > largest(a) ? b : a));
    const w = width / columns, h = height / Math.ceil(n / columns);
    boxes = state.shown.map((_, k) => ({ x: (k % columns) * w, y: Math.floor(k / columns) * h, w, h }));
  }
  function relabel() {
    $("labels").replaceChildren();
    labels = runs().map((run, k) => {
      const view = document.createElement("div"), name = document.createElement("div"), said = document.createElement("div");
      view.className = "view" + (k === state.focus && state.shown.length > 1 ? " focus" : "");
      name.className = "name";
      name.style.setProperty("--own", toned(run.color));
      name.append(document.createElement("i"), run.policy);
      said.className = "said";
      const near = document.createElement("span");
      near.className = "near";
      const who = arms.length > 1 ? arms.map(({ arm }) => {
        const label = document.createElement("span");
        label.className = "who";
        label.textContent = arm.name;
        label.style.color = toned(arm.color);
        return label;
      }) : [];
      view.append(name, said, near, ...who);
      $("labels").append(view);
      return { view, said, near, who };
    });
    width = 0; // lay out anew
  }
  const point = new THREE.Vector3();
  function put(label, at, box) { // a word at a place in space
    point.copy(at).project(camera);
    label.style.left = `${Math.min(Math.max(((point.x + 1) / 2) * box.w, 30), box.w - 30)}px`;
    label.style.top = `${((1 - point.y) / 2) * box.h}px`;
    return point;
  }
  function draw() {
    if (width !== stage.clientWidth || height !== stage.clientHeight) {
      width = stage.clientWidth;
      height = stage.clientHeight;
      renderer.setSize(width, height, false);
      layout();
      if (moved) { camera.aspect = boxes[0].w / boxes[0].h; camera.updateProjectionMatrix(); } else reset();
    }
    runs().forEach((run, k) => {
      const box = boxes[k], at = place(run, state.t), { view, said, near, who } = labels[k];
      arms.forEach((_, i) => { pose(i, run, at); way(i, run, at); });
      target(run, at);
      const close = nearest(run, at), clear = close ? column(run, "clearance").values[nearestRow(at)] : Infinity;
      warm.color.set(css(clear < data.scene.d_min ? "--limit" : "--ink"));
      renderer.setViewport(box.x, height - box.y - box.h, box.w, box.h);
      renderer.setScissor(box.x, height - box.y - box.h, box.w, box.h);
      renderer.render(world, camera);
      Object.assign(view.style, { left: `${box.x}px`, top: `${box.y}px`, width: `${box.w}px`, height: `${box.h}px` });
      said.replaceChildren(run.headline && `${run.headline}\n`);
      if (run.mishap && state.t >= endOf(run) - 1e-9) said.append(Object.assign(document.createElement("b"), { textContent: run.mishap }));
      else if (run.arrived !== null && state.t >= run.arrived) said.append("arrived");
      near.hidden = !close;
      if (close) {
        near.textContent = `${(1e3 * clear).toFixed(1)} mm`;
        near.classList.toggle("bad", clear < data.scene.d_min);
        put(near, rod.position, box);
        near.style.top = `${parseFloat(near.style.top) - 18}px`;
      }
      who.forEach((label, i) => {
        put(label, axis.setFromMatrixPosition(arms[i].frames[0].matrix), box);
        label.style.top = `${Math.min(parseFloat(label.style.top) + 20, box.h - 10)}px`;
      });
    });
  }
  return { draw, reset() { reset(); clock.ask(); }, paint, relabel };
})();

// ---- charts

function ticks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw)), share = raw / power;
  const step = power * (share < 1.5 ? 1 : share < 3.5 ? 2 : share < 7.5 ? 5 : 10), found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return { found, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}
const written = (x, digits) => (Math.abs(x) >= 1e4 || (x !== 0 && Math.abs(x) < 1e-3) ? x.toExponential(1) : x.toFixed(digits).replace("-", "−"));

class Chart {
  constructor(panel, number) {
    this.panel = panel;
    this.box = document.createElement("article");
    this.box.className = `chart ${panel.type}${panel.regions ? " square" : ""}`;
    this.box.id = `chart${number}`;
    const head = document.createElement("h2");
    this.now = document.createElement("output");
    this.legend = document.createElement("div");
    this.legend.className = "legend";
    this.canvas = document.createElement("canvas");
    head.append(Object.assign(document.createElement("span"), { textContent: panel.title, title: panel.title }), this.now);
    this.box.append(head, this.legend, this.canvas);
    this.still = document.createElement("canvas");
    head.addEventListener("click", () => { this.box.classList.toggle("wide"); this.fresh = false; clock.ask(); });
    if (panel.type === "time") {
      const go = (event) => {
        if (!(event.buttons & 1)) return;
        const { left } = this.canvas.getBoundingClientRect();
        clock.go(((event.clientX - left - this.area.x) / this.area.w) * duration());
      };
      this.canvas.addEventListener("pointerdown", (event) => { this.canvas.setPointerCapture(event.pointerId); go(event); });
      this.canvas.addEventListener("pointermove", go);
    }
    $("charts").append(this.box);
  }

  colorOf(line, run) {
    if (line.arm !== null) return toned(data.scene.arms[line.arm].color);
    if (line.joint !== null) return JOINTS[state.theme][line.joint % JOINTS[state.theme].length];
    return toned(run.color);
  }

  drawn() { // what is drawn: line, run and whether it is on show; others' lines first, then those on show, the focus last
    const all = [];
    for (const line of this.panel.lines) {
      if (this.panel.others) for (const run of data.runs) if (!state.shown.includes(run.policy)) all.push({ line, run, weight: 0 });
      if (this.panel.others) runs().forEach((run, k) => { if (k !== state.focus) all.push({ line, run, weight: 1 }); });
      all.push({ line, run: focused(), weight: 2 });
    }
    return all.filter(({ line, run }) => run.columns[line.column] !== undefined).sort((a, b) => a.weight - b.weight);
  }

  curves() { return [...(this.panel.curves || []), ...((focused().curves || {})[this.panel.title] || [])]; }

  span() { // of the y axis
    const { panel } = this;
    let [low, high] = [panel.low, panel.high];
    if (low === null || high === null) {
      let [least, most] = [Infinity, -Infinity];
      const take = (y) => { if (Number.isFinite(y) && !(panel.log && y <= 0)) { least = Math.min(least, y); most = Math.max(most, y); } };
      for (const { line, run, weight } of this.drawn()) {
        if (weight === 0 && panel.capped) continue;
        const { values, rows, width } = column(run, line.column);
        for (let k = 0; k < rows; k++) take(line.scale * values[k * width + line.index]);
      }
      for (const mark of panel.marks) take(mark.at);
      if (!Number.isFinite(least)) [least, most] = [0, 1];
      if (panel.log) [least, most] = [Math.max(least, panel.floor) / 1.6, Math.max(most, 2 * panel.floor) * 1.6];
      else { const more = 0.07 * (most - least || Math.abs(most) || 1); [least, most] = [least - more, most + more]; }
      low = low === null ? least : low;
      high = high === null ? most : high;
    }
    return [low, high];
  }

  paint() { // everything that does not move
    const { panel } = this, ratio = Math.min(devicePixelRatio, 2), w = this.canvas.clientWidth, h = this.canvas.clientHeight;
    this.canvas.width = this.still.width = Math.round(w * ratio);
    this.canvas.height = this.still.height = Math.round(h * ratio);
    const c = this.still.getContext("2d");
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.font = "11px system-ui, 'Segoe UI', Roboto, Arial, sans-serif";
    const x = panel.type === "time" ? [0, duration() || 1] : [panel.x.low, panel.x.high], y = this.span();
    let area = { x: 52, y: 8, w: w - 52 - 10, h: h - 8 - 34 };
    if (panel.equal) { // lengths of both paths in one scale
      const scale = Math.min(area.w / (x[1] - x[0]), area.h / (y[1] - y[0]));
      const wide = scale * (x[1] - x[0]), tall = scale * (y[1] - y[0]);
      area = { x: area.x + (area.w - wide) / 2, y: area.y, w: wide, h: tall };
    }
    this.area = area;
    const log = Math.log10, rise = panel.log ? (v) => (log(Math.max(v, y[0])) - log(y[0])) / (log(y[1]) - log(y[0])) : (v) => (v - y[0]) / (y[1] - y[0]);
    this.X = (v) => area.x + (area.w * (v - x[0])) / (x[1] - x[0]);
    this.Y = (v) => area.y + area.h * (1 - rise(v));
    this.axes(c, x, y);
    c.save();
    c.beginPath();
    c.rect(area.x - 1, area.y - 1, area.w + 2, area.h + 2);
    c.clip();
    this.grounds(c, x, y);
    for (const { line, run, weight } of this.drawn()) this.line(c, line, run, weight);
    c.restore();
    this.words(c);
    this.key();
    this.fresh = true;
  }

  axes(c, x, y) {
    const { panel, area } = this, across = ticks(x[0], x[1], Math.max(3, area.w / 75));
    c.strokeStyle = css("--faint");
    c.fillStyle = css("--muted");
    c.lineWidth = 1;
    c.textAlign = "center";
    c.textBaseline = "top";
    for (const v of across.found) {
      c.beginPath(); c.moveTo(this.X(v), area.y); c.lineTo(this.X(v), area.y + area.h); c.stroke();
      c.fillText(written(v, across.digits), this.X(v), area.y + area.h + 4);
    }
    const upward = panel.log ? { found: [], digits: 0 } : ticks(y[0], y[1], Math.max(3, area.h / 34));
    if (panel.log) for (let k = Math.ceil(Math.log10(y[0])), every = Math.ceil((Math.log10(y[1]) - Math.log10(y[0])) / 6); k <= Math.log10(y[1]); k += every) upward.found.push(10 ** k);
    c.textAlign = "right";
    c.textBaseline = "middle";
    for (const v of upward.found) {
      c.beginPath(); c.moveTo(area.x, this.Y(v)); c.lineTo(area.x + area.w, this.Y(v)); c.stroke();
      c.fillText(panel.log ? `10${[..."" + Math.round(Math.log10(v))].map((d) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[d] || "⁻").join("")}` : written(v, upward.digits), area.x - 5, this.Y(v));
    }
    c.textAlign = "center";
    c.textBaseline = "bottom";
    c.fillText(panel.type === "time" ? "time [s]" : panel.x.label, area.x + area.w / 2, area.y + area.h + 33);
    c.save();
    c.translate(9, area.y + area.h / 2);
    c.rotate(-Math.PI / 2);
    c.textBaseline = "middle";
    c.fillText(panel.label, 0, 0);
    c.restore();
  }

  grounds(c, x, y) { // what lies below the lines: collision region, forbidden bands, limits
    const { panel, area } = this;
    c.fillStyle = css("--forbidden");
    if (panel.regions) { // where two arms are too close: rectangles, in one path so that no seams show
      const { values, rows } = array(panel.regions);
      c.beginPath();
      for (let k = 0; k < rows; k++) {
        const [a, b, foot, top] = values.subarray(4 * k, 4 * k + 4);
        c.rect(this.X(a), this.Y(top), this.X(b) - this.X(a) + 0.4, this.Y(foot) - this.Y(top));
      }
      c.fill();
    }
    for (const band of panel.bands) {
      const top = band.high === null ? area.y : this.Y(Math.min(band.high, y[1])), foot = this.Y(Math.max(band.low, y[0]));
      if (foot > top) c.fillRect(area.x, top, area.w, foot - top);
    }
    for (const mark of panel.marks) this.stroke(c, [[x[0], mark.at], [x[1], mark.at]], css("--limit"), 1.2, [5, 3]);
    for (const curve of this.curves()) {
      const { values, rows } = array(curve.points), points = [];
      for (let k = 0; k < rows; k++) points.push([values[2 * k], Math.min(values[2 * k + 1], 4 * y[1])]);
      const limit = curve.limit;
      if (limit) {
        c.beginPath();
        points.forEach(([a, b], k) => (k ? c.lineTo(this.X(a), this.Y(b)) : c.moveTo(this.X(a), this.Y(b))));
        c.lineTo(this.X(x[1]), -1e4); c.lineTo(this.X(x[0]), -1e4); c.closePath();
        c.globalAlpha = 0.75; c.fillStyle = css("--forbidden"); c.fill(); c.globalAlpha = 1;
      }
      this.stroke(c, points, limit ? css("--limit") : css("--muted"), limit ? 1.3 : 1.2, limit ? [] : [4, 3]);
    }
  }

  stroke(c, points, color, width, dash) {
    c.beginPath();
    c.strokeStyle = color;
    c.lineWidth = width;
    c.lineJoin = "round";
    c.setLineDash(dash);
    let pen = false;
    for (const [a, b] of points) {
      if (!Number.isFinite(b)) { pen = false; continue; }
      if (pen) c.lineTo(this.X(a), this.Y(b)); else c.moveTo(this.X(a), this.Y(b));
      pen = true;
    }
    c.stroke();
    c.setLineDash([]);
  }

  line(c, line, run, weight) {
    const { values, rows, width } = column(run, line.column), points = [];
    const across = this.panel.type === "time" ? { ...column(run, "time"), index: 0 } : { ...column(run, this.panel.x.column), index: this.panel.x.index };
    for (let k = 0; k < rows; k++) {
      const a = across.values[k * across.width + across.index], b = line.scale * values[k * width + line.index];
      if (line.steps && k) points.push([points[points.length - 1][0], b]); // torques act from the row before on
      points.push([a, b]);
    }
    c.globalAlpha = [0.3, 0.75, 1][weight];
    this.stroke(c, points, this.colorOf(line, run), weight === 2 ? 2 : 1.3, line.dashed ? [4, 3] : []);
    c.globalAlpha = 1;
  }

  words(c) {
    const { area, panel } = this;
    c.fillStyle = css("--forbidden-ink");
    c.textAlign = "right";
    for (const { label, at, below } of [...panel.marks, ...panel.bands.map((band) => ({ label: band.label, at: band.high === null ? band.low : band.high, below: true }))]) {
      if (!label) continue;
      const y = this.Y(at);
      const under = (below && area.y + area.h - y > 15) || y - area.y < 13;
      c.textBaseline = under ? "top" : "bottom";
      c.fillText(label, area.x + area.w - 3, under ? y + 2 : y - 2);
    }
  }

  key() {
    this.legend.replaceChildren();
    const add = (text, color, dash) => {
      const entry = document.createElement("span"), stroke = document.createElement("i");
      stroke.style.setProperty("--own", color);
      if (dash) stroke.className = "dash";
      entry.append(stroke, text);
      this.legend.append(entry);
    };
    for (const line of this.panel.lines) if (line.label) add(line.label, this.colorOf(line, focused()), line.dashed);
    for (const curve of this.curves()) if (curve.label) add(curve.label, curve.limit ? css("--limit") : css("--muted"), !curve.limit);
    this.legend.hidden = !this.legend.childElementCount;
  }

  draw() {
    if (!this.fresh || this.seen !== `${this.canvas.clientWidth} ${this.canvas.clientHeight}`) { this.seen = `${this.canvas.clientWidth} ${this.canvas.clientHeight}`; this.paint(); }
    const c = this.canvas.getContext("2d"), { panel, area } = this, ratio = Math.min(devicePixelRatio, 2);
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, this.canvas.width, this.canvas.height);
    c.drawImage(this.still, 0, 0);
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    const t = state.t;
    if (panel.type === "time") this.stroke(c, [[t, -1e30], [t, 1e30]].map(([a]) => a).map((a, k) => [a, k ? this.span()[1] : this.span()[0]]), css("--ink"), 1, []);
    for (const { line, run, weight } of this.drawn()) {
      if (weight === 0) continue;
      const at = place(run, t), a = panel.type === "time" ? Math.min(t, endOf(run)) : value(run, panel.x.column, panel.x.index, at);
      const b = line.scale * (line.steps ? column(run, line.column).values[at.next * column(run, line.column).width + line.index] : value(run, line.column, line.index, at));
      if (!Number.isFinite(b)) continue;
      const x = this.X(a), y = this.Y(b);
      if (y < area.y - 6 || y > area.y + area.h + 6) continue;
      if (panel.type === "plane" && weight === 2) {
        c.globalAlpha = 0.5;
        c.lineWidth = 1; c.strokeStyle = css("--muted");
        c.beginPath(); c.moveTo(area.x, y); c.lineTo(x, y); c.lineTo(x, area.y + area.h); c.stroke();
        c.globalAlpha = 1;
      }
      c.beginPath();
      c.arc(x, y, panel.type === "plane" ? (weight === 2 ? 5.5 : 4) : 3, 0, 2 * Math.PI);
      c.fillStyle = this.colorOf(line, run); c.strokeStyle = css("--panel"); c.lineWidth = 1.5;
      c.fill(); c.stroke();
    }
    this.tell();
  }

  tell() { // what the focus has now, in words
    const { panel } = this, run = focused(), at = place(run, state.t), row = nearestRow(at), said = [];
    for (const line of panel.lines) {
      if (run.columns[line.column] === undefined) continue;
      const { values, width } = column(run, line.column);
      said.push(line.scale * values[row * width + line.index]);
    }
    if (!said.length) { this.now.textContent = ""; return; }
    let y = said[0];
    if (panel.largest) for (const one of said) if (Math.abs(one) > Math.abs(y)) y = one;
    const text = Number.isFinite(y) ? panel.log ? y.toExponential(1) : y.toFixed(panel.digits).replace("-", "−") : "–";
    if (panel.type === "plane") {
      const { values, width } = column(run, panel.x.column);
      this.now.textContent = `${values[row * width + panel.x.index].toFixed(3)}, ${text}`;
    } else this.now.textContent = Number.isFinite(y) ? `${text}${panel.unit ? " " + panel.unit : ""}` : text;
    this.now.classList.toggle("bad", panel.bands.some((band) => band.high !== null && y < band.high && y >= band.low && band.bad));
  }
}

// ---- clock and controls

const charts = data.panels.map((panel, k) => new Chart(panel, k));

const clock = {
  asked: false, last: null,
  ask() { if (!this.asked) { this.asked = true; requestAnimationFrame((now) => this.frame(now)); } },
  frame(now) {
    this.asked = false;
    if (state.playing) {
      if (this.last !== null) state.t += Math.min(now - this.last, 100) / 1e3 / state.slow;
      this.last = now;
      if (state.t >= duration()) { state.t = duration(); this.play(false); } else this.ask();
    }
    show();
  },
  go(t) { state.t = Math.min(Math.max(t, 0), duration()); this.ask(); this.note(); },
  note() { clearTimeout(this.noting); this.noting = setTimeout(writeAddress, 200); },
  play(on) {
    if (on && state.t >= duration() - 1e-9) state.t = 0;
    state.playing = on;
    this.last = null;
    $("play").textContent = on ? "❚❚" : "▶";
    if (!on) this.note();
    this.ask();
  },
  step(rows) { // by frames of the focus
    const time = column(focused(), "time").values, at = place(focused(), state.t), end = time.length - 1;
    const row = rows < 0 && at.share > 1e-6 ? at.row + 1 : at.row;
    this.play(false);
    this.go(time[Math.min(Math.max(row + rows, 0), end)]);
  },
};

function show() {
  $("clock").textContent = `${state.t.toFixed(3)} s`;
  $("time").value = state.t;
  scene.draw();
  for (const chart of charts) chart.draw();
}

function refresh() { // another choice of policies, or another theme
  document.documentElement.dataset.theme = state.theme;
  state.focus = Math.min(state.focus, state.shown.length - 1);
  state.t = Math.min(state.t, duration());
  $("time").max = duration();
  $("end").textContent = `${duration().toFixed(3)} s`;
  for (const pill of $("policies").children) pill.setAttribute("aria-pressed", state.shown.includes(pill.dataset.policy));
  scene.relabel();
  scene.paint();
  for (const chart of charts) chart.fresh = false;
  pills();
  clock.ask();
}

function choose(name, beside) {
  if (!beside) [state.shown, state.focus] = [[name], 0];
  else if (!state.shown.includes(name)) {
    if (state.shown.length === MOST_VIEWS) state.shown.shift();
    state.focus = state.shown.push(name) - 1;
  } else if (state.shown.length > 1) {
    state.shown = state.shown.filter((one) => one !== name);
    state.focus = 0;
  }
  clock.note();
  refresh();
}

function pills() {
  const made = (run, brief) => {
    const pill = document.createElement("button"), said = document.createElement("small");
    pill.className = "policy";
    pill.dataset.policy = run.policy;
    pill.style.setProperty("--own", toned(run.color));
    said.textContent = run.mishap || brief;
    if (run.mishap) said.className = "bad";
    pill.append(document.createElement("i"), run.policy, said);
    return pill;
  };
  $("policies").replaceChildren(...data.runs.map((run, k) => {
    const pill = made(run, run.brief);
    pill.setAttribute("aria-pressed", state.shown.includes(run.policy));
    pill.title = `Show ${run.policy}${k < 9 ? ` (${k + 1})` : ""}; with shift beside the others`;
    pill.addEventListener("click", (event) => choose(run.policy, event.shiftKey || event.ctrlKey || event.metaKey));
    return pill;
  }), ...data.waiting.map((run) => { // live pages only: whoever has not run yet does when asked
    const pill = made(run, "");
    pill.classList.add("waiting");
    pill.title = run.mishap ? run.why : `Run ${run.policy}; with shift beside the others`;
    pill.disabled = Boolean(run.mishap);
    pill.addEventListener("click", (event) => fetchRun(pill, run, event.shiftKey || event.ctrlKey || event.metaKey));
    return pill;
  }));
}

async function fetchRun(pill, run, beside) { // the server keeps what has run: the page comes again with it
  const said = pill.lastElementChild;
  pill.disabled = true;
  said.textContent = "running …";
  try {
    const answer = await fetch("run", { method: "POST", body: run.policy });
    if (!answer.ok) throw new Error(await answer.text());
  } catch (error) {
    said.textContent = "failed";
    said.className = "bad";
    pill.title = error.message;
    return;
  }
  state.shown = beside ? [...state.shown, run.policy].slice(-MOST_VIEWS) : [run.policy];
  writeAddress();
  location.reload();
}

document.title = `${data.title} · armtempo`;
$("title").textContent = data.title;
$("subtitle").textContent = data.subtitle;
$("about").textContent = `${data.summary} (${data.caption}) Made by armtempo ${data.armtempo}; drawn by three.js.`;
for (const slow of SPEEDS) $("speed").append(new Option(slow === 1 ? "1/1" : `1/${slow}`, slow));
state.theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
state.shown = [data.first];
state.slow = SPEEDS.reduce((a, b) => (Math.abs(Math.log(b * duration() / SHOWN_FOR)) < Math.abs(Math.log(a * duration() / SHOWN_FOR)) ? b : a));
readAddress();
$("speed").value = state.slow;
$("play").addEventListener("click", () => clock.play(!state.playing));
$("time").addEventListener("input", () => { state.playing && clock.play(false); clock.go(Number($("time").value)); });
$("speed").addEventListener("change", () => { state.slow = Number($("speed").value); });
$("theme").addEventListener("click", () => { state.theme = state.theme === "dark" ? "light" : "dark"; state.chosen = true; clock.note(); refresh(); });
$("help").addEventListener("click", () => $("keys").showModal());
addEventListener("hashchange", () => { readAddress(); refresh(); });
const resized = new ResizeObserver(show); // at once: a frame later everything would be seen stretched
for (const box of [$("stage"), $("charts")]) resized.observe(box);
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || $("keys").open) return;
  const digit = /^Digit([1-9])$/.exec(event.code), many = event.shiftKey ? 10 : 1;
  const keys = {
    " ": () => clock.play(!state.playing), ArrowLeft: () => clock.step(-many), ArrowRight: () => clock.step(many),
    Home: () => clock.go(0), End: () => clock.go(duration()), d: () => $("theme").click(), r: () => scene.reset(),
    f: () => { state.focus = (state.focus + 1) % state.shown.length; refresh(); }, "?": () => $("help").click(),
    ",": () => slower(1), ".": () => slower(-1),
  };
  const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (digit && data.runs[digit[1] - 1]) choose(data.runs[digit[1] - 1].policy, event.shiftKey);
  else if (act) act();
  else return;
  event.preventDefault();
});
function slower(by) {
  const k = Math.min(Math.max(SPEEDS.indexOf(state.slow) + by, 0), SPEEDS.length - 1);
  state.slow = SPEEDS[k];
  $("speed").value = state.slow;
}
refresh();
show();
document.documentElement.dataset.ready = "yes";
})();
