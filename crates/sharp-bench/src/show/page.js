'use strict';
const data = JSON.parse(document.getElementById('data').textContent);
const { map, robot, legs, options, drives, weak, runs } = data;
const byId = id => document.getElementById(id);
const canvas = byId('map'), context = canvas.getContext('2d'), tip = byId('tip');
const OUTCOMES = {
  reached: ['reached the goal', '✓'], collided: ['touched a wall', '×'],
  timed_out: ['ran out of time', '◷'], lost: ['lost the way', '?'],
};

// The world as it lies in the picture: cells, y downwards.
const [originX, originY, originYaw] = map.origin;
const cos = Math.cos(originYaw), sin = Math.sin(originYaw);
function cells([x, y]) {
  const dx = x - originX, dy = y - originY;
  return [(cos * dx + sin * dy) / map.resolution_m, map.height - (cos * dy - sin * dx) / map.resolution_m];
}
function world([u, v]) {
  const a = u * map.resolution_m, b = (map.height - v) * map.resolution_m;
  return [originX + cos * a - sin * b, originY + sin * a + cos * b];
}

// What is drawn, in cells.
const guides = legs.map(leg => leg.guide.map(cells));
const tracks = drives.map(drive => drive.moments.map(([time, x, y, yaw]) => [time, ...cells([x, y]), originYaw - yaw]));
const outline = robot.outline.map(([x, y]) => [x / map.resolution_m, -y / map.resolution_m]);
const arrows = options.map(option => {
  const from = cells(option.from), to = cells(option.to), [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  // Bent to its right, so that the way there and the way back stay apart.
  const bend = [(from[0] + to[0]) / 2 - 0.12 * dy, (from[1] + to[1]) / 2 + 0.12 * dx];
  const points = [];
  for (let i = 0; i <= 16; i++) {
    const s = i / 16, r = 1 - s;
    points.push([0, 1].map(k => r * r * from[k] + 2 * r * s * bend[k] + s * s * to[k]));
  }
  return points;
});
const regions = new Path2D(map.regions);
const planned = new Map(legs.map((leg, index) => [leg.option, index]));
byId('frame').style.setProperty('--aspect', map.known[3] / map.known[2]);
const lastTime = Math.max(1, ...drives.map(drive => drive.time_s));

const layers = {};
for (const [name, label, on] of [
  ['cells', 'Cells of states', true], ['regions', 'Critical regions', false], ['options', 'Options', false],
  ['guides', 'Guides of the plan', true], ['drives', 'Drives', true], ['robots', 'Robots', true],
  ['weak', 'Weak places', true], ['numbers', 'Numbers of states', false],
]) {
  layers[name] = on;
  const row = document.createElement('label'), box = document.createElement('input');
  Object.assign(box, { type: 'checkbox', checked: on, id: 'layer-' + name });
  box.onchange = () => { layers[name] = box.checked; draw(); };
  row.append(box, label);
  byId('layers').append(row);
}

// Colours come from the style sheet, so that light and dark are decided in one place.
let color = {};
const images = {};
function paint() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ['outside', 'floor', 'wall', 'state', 'region', 'option', 'guide', 'halo', 'start', 'goal', 'ink', 'accent',
    ...Object.keys(OUTCOMES)]) color[name] = style.getPropertyValue('--' + name).trim();
  if (images.walls) {
    const walls = document.createElement('canvas');
    [walls.width, walls.height] = [images.walls.width, images.walls.height];
    const brush = walls.getContext('2d');
    brush.drawImage(images.walls, 0, 0);
    brush.globalCompositeOperation = 'source-in';
    brush.fillStyle = color.wall;
    brush.fillRect(0, 0, walls.width, walls.height);
    images.painted = walls;
  }
  draw();
}
for (const name of ['walls', 'cells']) {
  const image = new Image();
  image.onload = () => { images[name] = image; paint(); };
  image.src = map[name];
}
const dark = matchMedia('(prefers-color-scheme: dark)');
function theme(name) { document.documentElement.dataset.theme = name; paint(); }
dark.onchange = () => theme(dark.matches ? 'dark' : 'light');
byId('theme').onclick = () => theme(document.documentElement.dataset.theme === 'dark' ? 'light' : 'dark');

// The window: its middle in cells, and pixels a cell.
const view = { x: 0, y: 0, scale: 1, width: 0, height: 0, fitted: true };
function fit() {
  const [left, top, width, height] = map.known;
  view.scale = Math.min(view.width / width, view.height / height) * 0.98;
  [view.x, view.y] = [left + width / 2, top + height / 2];
  view.fitted = true;
}
function resize() {
  const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
  [view.width, view.height] = [box.width, box.height];
  [canvas.width, canvas.height] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
  if (view.fitted) fit();
  // At once: a canvas that gets another size is empty.
  drawNow();
}
const toScreen = ([u, v]) => [(u - view.x) * view.scale + view.width / 2, (v - view.y) * view.scale + view.height / 2];
const toCells = ([px, py]) => [(px - view.width / 2) / view.scale + view.x, (py - view.height / 2) / view.scale + view.y];
function zoom(factor, [px, py] = [view.width / 2, view.height / 2]) {
  const [u, v] = toCells([px, py]);
  const least = 0.5 * Math.min(view.width / map.width, view.height / map.height, 1);
  view.scale = Math.min(Math.max(view.scale * factor, least), 400 * map.resolution_m);
  const [u2, v2] = toCells([px, py]);
  view.x += u - u2; view.y += v - v2;
  view.fitted = false;
  draw();
}
function lookAt(place, metres) {
  [view.x, view.y] = place;
  view.scale = Math.max(view.scale, Math.min(view.width, view.height) * map.resolution_m / metres);
  view.fitted = false;
}
function lookAtAll(points) {
  const us = points.map(p => p[0]), vs = points.map(p => p[1]);
  const low = [Math.min(...us), Math.min(...vs)], high = [Math.max(...us), Math.max(...vs)];
  const middle = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
  const inside = points.every(p => { const [x, y] = toScreen(p); return x > 0 && y > 0 && x < view.width && y < view.height; });
  if (!inside) { [view.x, view.y] = middle; view.fitted = false; }
}

let time = 0, chosen = null, hovered = null;
const same = (a, b) => a && b && a.kind === b.kind && a.index === b.index;
const marked = (kind, index) => [chosen, hovered].some(it => it && it.kind === kind && it.index === index);

/// The pose of a drive at a time: between two moments on the straight way.
function poseAt(track, at) {
  let low = 0, high = track.length - 1;
  if (at >= track[high][0]) return track[high];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (track[middle][0] <= at) low = middle; else high = middle;
  }
  const a = track[low], b = track[high], s = (at - a[0]) / (b[0] - a[0]);
  let turn = (b[3] - a[3]) % (2 * Math.PI);
  if (turn > Math.PI) turn -= 2 * Math.PI;
  if (turn < -Math.PI) turn += 2 * Math.PI;
  return [at, a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2]), a[3] + s * turn];
}

let due = false;
function draw() {
  if (due) return;
  due = true;
  requestAnimationFrame(() => { due = false; drawNow(); });
}
function line(points, width, stroke, dash = []) {
  context.beginPath();
  points.forEach(([u, v], i) => i ? context.lineTo(u, v) : context.moveTo(u, v));
  context.setLineDash(dash.map(length => length / view.scale));
  context.lineWidth = width / view.scale;
  context.strokeStyle = stroke;
  context.stroke();
  context.setLineDash([]);
}
function head(points, stroke) {
  const [b, a] = [points[points.length - 1], points[points.length - 3]];
  const angle = Math.atan2(b[1] - a[1], b[0] - a[0]), size = 7 / view.scale;
  context.beginPath();
  context.moveTo(...b);
  for (const side of [2.7, -2.7]) context.lineTo(b[0] + size * Math.cos(angle + side), b[1] + size * Math.sin(angle + side));
  context.fillStyle = stroke;
  context.fill();
}
function disc([u, v], radius, fill, stroke, width = 1.5) {
  context.beginPath();
  context.arc(u, v, radius / view.scale, 0, 7);
  context.fillStyle = fill;
  context.fill();
  if (stroke) { context.lineWidth = width / view.scale; context.strokeStyle = stroke; context.stroke(); }
}
function mark([u, v], kind, size) {
  const r = size / view.scale;
  for (const [width, stroke] of [[5.5, color.halo], [2.6, color[kind]]]) {
    context.beginPath();
    if (kind === 'collided') {
      context.moveTo(u - r, v - r); context.lineTo(u + r, v + r);
      context.moveTo(u - r, v + r); context.lineTo(u + r, v - r);
    } else {
      context.arc(u, v, r, 0, 7);
      context.moveTo(u, v - 0.6 * r); context.lineTo(u, v); context.lineTo(u + 0.5 * r, v);
    }
    context.lineWidth = width / view.scale;
    context.strokeStyle = stroke;
    context.stroke();
  }
}
function drawNow() {
  if (!color.floor || !view.width) return;
  const ratio = canvas.width / view.width, k = view.scale * ratio;
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.fillStyle = color.outside;
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.setTransform(k, 0, 0, k, canvas.width / 2 - view.x * k, canvas.height / 2 - view.y * k);
  context.lineJoin = context.lineCap = 'round';
  context.imageSmoothingEnabled = k * map.pixel_cells < 1;
  context.fillStyle = color.floor;
  context.fillRect(0, 0, map.width, map.height);
  const picture = (image, alpha) => {
    if (!image) return;
    context.globalAlpha = alpha;
    context.drawImage(image, 0, 0, image.width * map.pixel_cells, image.height * map.pixel_cells);
    context.globalAlpha = 1;
  };
  if (layers.cells) picture(images.cells, Number(color.state));
  if (layers.regions) {
    context.globalAlpha = 0.25; context.fillStyle = color.region; context.fill(regions, 'evenodd');
    context.globalAlpha = 1; context.lineWidth = 1.6 / view.scale; context.strokeStyle = color.region; context.stroke(regions);
  }
  picture(images.painted, 1);
  if (layers.options) drawOptions();
  if (chosen && chosen.kind === 'option' || hovered && hovered.kind === 'option') drawMarkedOptions();
  if (layers.drives) drawTracks();
  if (layers.guides) drawGuides();
  drawEnds();
  if (layers.drives || layers.robots) drawFailures();
  if (layers.robots) drawRobots();
  if (layers.weak) drawWeak();
  if (layers.numbers) drawNumbers();
  drawScale();
}
function drawOptions() {
  context.globalAlpha = options.length > 150 ? 0.45 : 0.7;
  for (const points of arrows) { line(points, 1, color.option); head(points, color.option); }
  context.globalAlpha = 1;
}
function drawMarkedOptions() {
  arrows.forEach((points, index) => {
    if (!marked('option', index)) return;
    line(points, 6, color.halo); line(points, 3, color.accent); head(points, color.accent);
  });
}
function drawTracks() {
  const one = chosen && chosen.kind === 'drive';
  // Failures lie on top: they are few, and what one looks for.
  for (const failed of [false, true]) drives.forEach((drive, index) => {
    if ((drive.end !== 'reached') !== failed) return;
    const is = marked('drive', index);
    context.globalAlpha = is ? 1 : one ? 0.15 : failed ? 0.9 : 0.6;
    line(tracks[index].map(([, u, v]) => [u, v]), is ? 3 : 1.6, color[drive.end]);
  });
  context.globalAlpha = 1;
}
function drawGuides() {
  guides.forEach((guide, index) => {
    const is = marked('leg', index);
    context.globalAlpha = is ? 1 : 0.6;
    line(guide, is ? 9 : 4.6, color.halo);
    context.globalAlpha = 1;
    line(guide, is ? 5.5 : 2.4, is ? color.accent : color.guide, is ? [] : [9, 6]);
    if (index) disc(guide[0], is ? 6 : 4.5, color.halo, color.guide, 2);
  });
}
function drawEnds() {
  const [x, y, yaw] = data.start, [u, v] = cells([x, y]), turn = originYaw - yaw, r = 20 / view.scale;
  const nose = [[u, v], [u + r * Math.cos(turn), v + r * Math.sin(turn)]];
  line(nose, 6, color.ink); line(nose, 3, color.halo);
  disc([u, v], 8, color.start, color.ink);
  data.goals.forEach((goal, index) => {
    const [u, v] = cells(goal);
    context.beginPath();
    context.arc(u, v, robot.goal_tolerance_m / map.resolution_m, 0, 7);
    context.lineWidth = 1.5 / view.scale; context.strokeStyle = color.ink; context.stroke();
    context.beginPath();
    for (let i = 0; i < 10; i++) {
      const radius = (i % 2 ? 5.5 : 13) / view.scale, angle = Math.PI * i / 5;
      context.lineTo(u + radius * Math.sin(angle), v - radius * Math.cos(angle));
    }
    context.closePath();
    context.fillStyle = color.goal; context.fill();
    context.lineWidth = 1.5 / view.scale; context.strokeStyle = color.ink; context.stroke();
    if (data.goals.length > 1) text(String(index + 1), [u, v + 24 / view.scale]);
  });
}
function drawFailures() {
  drives.forEach((drive, index) => {
    const track = tracks[index], last = track[track.length - 1];
    if (drive.end !== 'reached') mark([last[1], last[2]], drive.end, marked('drive', index) ? 9 : 6);
  });
}
function drawRobots() {
  const one = chosen && chosen.kind === 'drive';
  drives.forEach((drive, index) => {
    if (one && !marked('drive', index)) return;
    const [, u, v, turn] = poseAt(tracks[index], time), c = Math.cos(turn), s = Math.sin(turn);
    const at = ([x, y]) => [u + c * x - s * y, v + s * x + c * y];
    context.beginPath();
    outline.forEach((corner, i) => i ? context.lineTo(...at(corner)) : context.moveTo(...at(corner)));
    context.closePath();
    const over = time >= drive.time_s;
    context.fillStyle = color[over ? drive.end : 'guide'];
    context.globalAlpha = one ? 0.5 : 0.16; context.fill();
    context.globalAlpha = 0.9;
    context.lineWidth = (marked('drive', index) ? 2.4 : 1.1) / view.scale;
    context.strokeStyle = color[over ? drive.end : 'ink'];
    context.stroke();
    const front = Math.max(...outline.map(corner => corner[0]));
    context.beginPath(); context.moveTo(u, v); context.lineTo(...at([front, 0])); context.stroke();
    context.globalAlpha = 1;
  });
}
function drawWeak() {
  weak.forEach((place, index) => {
    if (!place.at) return;
    context.beginPath();
    context.arc(...cells(place.at), (marked('weak', index) ? 22 : 15) / view.scale, 0, 7);
    for (const [width, stroke] of [[5, color.halo], [2.4, place.failed ? color.collided : color.timed_out]]) {
      context.setLineDash(place.failed ? [] : [4 / view.scale, 5 / view.scale]);
      context.lineWidth = width / view.scale; context.strokeStyle = stroke; context.stroke();
    }
    context.setLineDash([]);
  });
}
function text(words, [u, v]) {
  const [x, y] = toScreen([u, v]), ratio = canvas.width / view.width;
  context.save();
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.font = '600 12px system-ui, sans-serif';
  context.textAlign = 'center'; context.textBaseline = 'middle';
  context.lineWidth = 3; context.strokeStyle = color.halo; context.strokeText(words, x, y);
  context.fillStyle = color.ink; context.fillText(words, x, y);
  context.restore();
}
function drawNumbers() { for (const state of data.states) text(String(state.state), cells(state.at)); }
function drawScale() {
  const metre = view.scale / map.resolution_m, most = 140 / metre, power = 10 ** Math.floor(Math.log10(most));
  const length = [5, 2, 1].map(step => step * power).find(step => step <= most);
  byId('scale').style.width = length * metre + 'px';
  byId('scale').textContent = length >= 1 ? length + ' m' : Math.round(100 * length) + ' cm';
}

// Numbers in words.
const percent = share => (100 * share).toFixed(1) + '\u00a0%';
const seconds = value => value === undefined || value === null ? 'unknown time' : value.toFixed(1) + ' s';
function legLines(leg) {
  const { on_arrival } = leg;
  // Composed odds have no runs of legs.
  return [`${leg.length_m.toFixed(1)} m in ${seconds(leg.time_s)}, cost ${leg.cost_s === null ? 'infinite' : seconds(leg.cost_s)}`,
    ...leg.basis === 'composed' ? [] : [`succeeds ${on_arrival.successes} of ${on_arrival.episodes} on arrival (at least ${percent(on_arrival.lower95)})`],
    `policy: ${leg.policy}${leg.reused ? ', from the library' : ''}`,
    `tightest: ${leg.tightest.beside_m.toFixed(2)} m beside the robot`];
}
function optionLines(option) {
  const it = option.learnt;
  if (!it) return [data.library ? 'not learnt yet, not in the plan' : 'not in the plan'];
  return [`${it.length_m.toFixed(1)} m in ${seconds(it.time_s)}, cost ${it.cost_s === null ? 'infinite' : seconds(it.cost_s)}`,
    `succeeds ${it.successes} of ${it.episodes}`, `policy: ${it.policy}`, 'in the library, not in the plan'];
}
function driveLines(drive) {
  return [`${OUTCOMES[drive.end][0]} after ${seconds(drive.time_s)} and ${drive.path_m.toFixed(1)} m`,
    ...drive.recoveries ? [`${drive.recoveries} new plan${drive.recoveries > 1 ? 's' : ''} on the way`] : []];
}
function words(it) {
  if (it.kind === 'leg') return [legs[it.index].option, ...legLines(legs[it.index])];
  if (it.kind === 'option') return [options[it.index].option, ...optionLines(options[it.index])];
  if (it.kind === 'drive') return ['Drive ' + drives[it.index].episode, ...driveLines(drives[it.index])];
  return ['Weak place', weak[it.index].words];
}

// What is under the pointer.
function distance([px, py], points) {
  let least = Infinity;
  for (let i = 1; i < points.length; i++) {
    const [ax, ay] = toScreen(points[i - 1]), [bx, by] = toScreen(points[i]);
    const dx = bx - ax, dy = by - ay, long = dx * dx + dy * dy;
    const s = long ? Math.min(1, Math.max(0, ((px - ax) * dx + (py - ay) * dy) / long)) : 0;
    least = Math.min(least, Math.hypot(px - ax - s * dx, py - ay - s * dy));
  }
  return least;
}
function under(at, reach) {
  let found = null, least = reach;
  const look = (kind, index, far) => { if (far < least) { least = far; found = { kind, index }; } };
  if (layers.weak) weak.forEach((place, index) => {
    if (!place.at) return;
    const [x, y] = toScreen(cells(place.at));
    if (place.failed) look('weak', index, Math.hypot(at[0] - x, at[1] - y) - 6);
  });
  if (found) return found;
  if (layers.robots) drives.forEach((drive, index) => {
    const [, u, v] = poseAt(tracks[index], time), [x, y] = toScreen([u, v]);
    look('drive', index, Math.hypot(at[0] - x, at[1] - y));
  });
  if (found && time > 0) return found;
  found = null; least = reach;
  if (layers.guides) guides.forEach((guide, index) => look('leg', index, distance(at, guide)));
  if (found) return found;
  if (layers.options) arrows.forEach((points, index) => {
    // What the plan uses has its numbers at its guide.
    const leg = planned.get(options[index].option);
    look(leg === undefined ? 'option' : 'leg', leg === undefined ? index : leg, distance(at, points));
  });
  if (!found && layers.drives) tracks.forEach((track, index) => look('drive', index, distance(at, track.map(p => [p[1], p[2]]))));
  return found;
}
function showTip(it, [px, py]) {
  tip.hidden = !it;
  if (!it) return;
  const [title, ...lines] = words(it);
  const name = document.createElement('b');
  name.textContent = title;
  tip.replaceChildren(name, ...lines.flatMap((text, i) => i ? [document.createElement('br'), text] : [text]));
  const left = Math.min(Math.max(8, px + 14), Math.max(8, view.width - tip.offsetWidth - 8));
  let top = py + 16;
  if (top + tip.offsetHeight > view.height - 8) top = py - tip.offsetHeight - 14;
  tip.style.left = left + 'px';
  tip.style.top = Math.max(8, top) + 'px';
}
function choose(it) {
  chosen = same(chosen, it) ? null : it;
  hovered = null;
  for (const node of document.querySelectorAll('[data-kind]')) {
    const is = Boolean(chosen) && node.dataset.kind === chosen.kind && Number(node.dataset.index) === chosen.index;
    node.classList.toggle('on', is);
    node.setAttribute('aria-pressed', is);
  }
  if (!chosen) tip.hidden = true;
  const drive = chosen && chosen.kind === 'drive' ? drives[chosen.index] : null;
  byId('outcomes').textContent = drive ? `Drive ${drive.episode} ${driveLines(drive).join(', ')}.` : counts;
  draw();
}

// Pointer, wheel and fingers.
const fingers = new Map();
let moved = 0;
const where = event => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
canvas.onpointerdown = event => {
  canvas.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, where(event));
  if (fingers.size === 1) moved = 0;
};
canvas.onpointermove = event => {
  const at = where(event), before = fingers.get(event.pointerId);
  if (!before) {
    const it = under(at, 10);
    if (it !== hovered && !same(it, hovered)) { hovered = it; draw(); }
    showTip(it, at);
    canvas.style.cursor = it ? 'pointer' : 'grab';
    return;
  }
  const step = [at[0] - before[0], at[1] - before[1]];
  moved += Math.hypot(...step);
  if (fingers.size === 2) {
    const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
    const factor = Math.hypot(at[0] - other[0], at[1] - other[1]) / Math.max(1, Math.hypot(before[0] - other[0], before[1] - other[1]));
    fingers.set(event.pointerId, at);
    zoom(factor, other);
  } else {
    fingers.set(event.pointerId, at);
    if (moved < 5) return;
    view.x -= step[0] / view.scale; view.y -= step[1] / view.scale;
    view.fitted = false;
    tip.hidden = true;
    draw();
  }
};
canvas.onpointerup = event => {
  const at = where(event);
  if (fingers.size === 1 && moved < 5) {
    const it = under(at, event.pointerType === 'mouse' ? 10 : 24);
    if (it || chosen) choose(it || chosen);
    showTip(chosen, at);
  }
  fingers.delete(event.pointerId);
};
canvas.onpointercancel = event => fingers.delete(event.pointerId);
canvas.onpointerleave = () => { hovered = null; if (!chosen) tip.hidden = true; draw(); };
canvas.addEventListener('wheel', event => {
  event.preventDefault();
  tip.hidden = true;
  zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), where(event));
}, { passive: false });
for (const button of document.querySelectorAll('[data-zoom]')) button.onclick = () => {
  const factor = Number(button.dataset.zoom);
  if (factor) zoom(factor); else { fit(); draw(); }
};

// Keys.
canvas.onkeydown = event => {
  const far = 60 / view.scale, ways = { ArrowLeft: [-far, 0], ArrowRight: [far, 0], ArrowUp: [0, -far], ArrowDown: [0, far] };
  const way = ways[event.key];
  if (way) { view.x += way[0]; view.y += way[1]; view.fitted = false; draw(); }
  else if (event.key === '+' || event.key === '=') zoom(1.3);
  else if (event.key === '-') zoom(1 / 1.3);
  else if (event.key === '0') { fit(); draw(); }
  else if (event.key === ' ') play();
  else return;
  event.preventDefault();
};
document.addEventListener('keydown', event => { if (event.key === 'Escape' && chosen) choose(chosen); });

// Time.
const slider = byId('time');
slider.max = lastTime.toFixed(1);
let playing = false, shownAt = 0;
function setTime(seconds) {
  time = Math.min(Math.max(seconds, 0), lastTime);
  slider.value = time;
  byId('clock').textContent = time.toFixed(1) + ' s';
  draw();
}
function play() {
  playing = !playing;
  byId('play').textContent = playing ? '❚❚' : '▶';
  byId('play').setAttribute('aria-label', playing ? 'Pause' : 'Play');
  if (!playing) return;
  if (time >= lastTime) setTime(0);
  shownAt = performance.now();
  requestAnimationFrame(step);
}
function step(now) {
  if (!playing) return;
  setTime(time + Math.max(0, now - shownAt) / 1000 * Number(byId('speed').value));
  shownAt = now;
  if (time >= lastTime) play(); else requestAnimationFrame(step);
}
byId('play').onclick = play;
slider.oninput = () => setTime(Number(slider.value));

// The panel.
function entry(list, kind, index, title, lines, look) {
  const row = document.createElement('li'), button = document.createElement(look ? 'button' : 'div');
  if (look) {
    button.type = 'button';
    Object.assign(button.dataset, { kind, index });
    button.setAttribute('aria-pressed', false);
    const over = on => { hovered = on ? { kind, index } : null; draw(); };
    button.onmouseenter = () => over(true);
    button.onmouseleave = button.onblur = () => over(false);
    button.onfocus = () => over(true);
    button.onclick = () => { choose({ kind, index }); if (chosen) look(); draw(); };
  }
  if (title) { const name = document.createElement('b'); name.textContent = title; button.append(name); }
  for (const line of lines) { const span = document.createElement('span'); span.textContent = line; button.append(span); }
  row.append(button);
  byId(list).append(row);
  return button;
}
legs.forEach((leg, index) => {
  const to = data.goals.length > 1 ? `, to goal ${leg.goal + 1}` : '';
  entry('legs', 'leg', index, `${index + 1}. ${leg.option}${to}`, legLines(leg), () => lookAtAll(guides[index]));
});
weak.forEach((place, index) => {
  const look = place.at ? () => lookAt(cells(place.at), 6) : place.leg !== undefined ? () => lookAtAll(guides[place.leg]) : null;
  const button = entry('weak', 'weak', index, null, [place.words], look);
  if (place.failed) button.firstChild.classList.add('failed');
});
drives.forEach((drive, index) => {
  const button = document.createElement('button'), [said, sign] = OUTCOMES[drive.end];
  Object.assign(button, { type: 'button', textContent: `${drive.episode} ${sign}`, title: driveLines(drive).join(', ') });
  button.setAttribute('aria-label', `Drive ${drive.episode} ${said}`);
  button.setAttribute('aria-pressed', false);
  Object.assign(button.dataset, { kind: 'drive', index });
  button.style.borderBottomColor = `var(--${drive.end})`;
  button.onclick = () => choose({ kind: 'drive', index });
  byId('drives').append(button);
});
const counts = `${runs.reached} of ${runs.episodes} reached the goal` +
  ['collided', 'timed_out', 'lost'].filter(end => runs[end]).map(end => `, ${runs[end]} ${OUTCOMES[end][0]}`).join('') +
  (drives.length < runs.episodes ? '. Shown: the first 20' + (drives.length > 20 ? ' and those that failed' : '') : '') + '.';
byId('outcomes').textContent = counts;
const basis = data.predicted.basis === 'composed' ? 'composed of what the library knows' : `counted on ${data.predicted.episodes} runs`;
byId('odds').textContent = `Predicted success ${percent(data.predicted.success)} (at least ${percent(data.predicted.lower95)}, ` +
  `${basis}), ${data.predicted.sim_time_s.toFixed(1)} s of driving, ` +
  `${options.length} options between ${data.states.length} states.`;

new ResizeObserver(resize).observe(canvas);
theme(dark.matches ? 'dark' : 'light');
setTime(0);
// An address that ends in #t=12&choose=leg.2&layers=options,guides opens so.
const wish = new URLSearchParams(location.hash.slice(1));
if (wish.get('layers')) for (const name of Object.keys(layers)) {
  layers[name] = byId('layer-' + name).checked = wish.get('layers').split(',').includes(name);
}
if (wish.get('t')) setTime(Number(wish.get('t')));
if (wish.get('theme')) theme(wish.get('theme'));
const [kind, index] = (wish.get('choose') || '').split('.');
if (kind && document.querySelector(`[data-kind="${kind}"][data-index="${index}"]`)) choose({ kind, index: Number(index) });
