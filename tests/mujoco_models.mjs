// SPDX-FileCopyrightText: hapode contributors
// SPDX-License-Identifier: MIT
// node mujoco_models.mjs FOLDER: MuJoCo's own compiler, in FOLDER/node_modules/@mujoco/mujoco, for
// tests/scene_oracle_node.c. Each line of standard input is the whole path of a scene file. The
// answer is "refused REASON", or "model VERSION", lines "NAME COUNT NUMBER...", one
// "bodies COUNT" with as many names, a line each, and "end".
import fs from 'node:fs';
import path from 'node:path';
import readline from 'node:readline';
import {pathToFileURL} from 'node:url';

const module = path.resolve(process.argv[2], 'node_modules/@mujoco/mujoco/mujoco.js');
const mujoco = await (await import(pathToFileURL(module))).default();

const INTEGERS = ['body_jntnum', 'body_jntadr', 'body_geomnum', 'body_geomadr', 'jnt_type',
  'jnt_qposadr', 'jnt_dofadr', 'geom_type', 'geom_contype', 'geom_conaffinity',
  'geom_matid', 'geom_dataid', 'hfield_nrow', 'hfield_ncol', 'hfield_adr'];
const REALS = ['body_mass', 'body_ipos', 'body_iquat', 'body_inertia', 'qpos0', 'qpos_spring',
  'jnt_pos', 'jnt_axis', 'jnt_range', 'jnt_stiffness', 'dof_damping', 'dof_armature',
  'dof_frictionloss', 'geom_pos', 'geom_quat', 'geom_size', 'geom_friction', 'geom_rgba',
  'mat_rgba', 'hfield_size', 'hfield_data'];

// MuJoCo sees files of its own memory alone: what a scene names is copied there.
const copied = new Set();

// Frames stay as the file has them, and what is only seen is kept: neither changes any motion.
const NEUTRAL = /\b(?:align|alignfree|discardvisual)\s*=\s*(["'])true\1/g;

function copy(file) {
  if (copied.has(file) || !fs.statSync(file, {throwIfNoEntry: false})?.isFile()) {
    return false;
  }
  copied.add(file);
  mujoco.FS.mkdirTree(path.dirname(file));
  const bytes = fs.readFileSync(file);
  const isScene = /\.(xml|mjcf)$/i.test(file);
  mujoco.FS.writeFile(file, isScene
    ? Buffer.from(bytes.toString('latin1').replace(NEUTRAL, ''), 'latin1') : bytes);
  return true;
}

// Wherever a file may be that an element names: beside the scene, or in a folder of assets.
function copyScene(file, top, folders) {
  if (!copy(file)) {
    return;
  }
  const text = fs.readFileSync(file, 'latin1');
  for (const [, , name] of text.matchAll(/(mesh|texture|asset)dir\s*=\s*["']([^"']*)["']/g)) {
    folders.add(name);
  }
  for (const [, name] of text.matchAll(/(?:file\w*|filename)\s*=\s*["']([^"']*)["']/g)) {
    for (const folder of ['', ...folders]) {
      for (const base of [path.dirname(file), top]) {
        const found = path.resolve(base, folder, name);
        if (/\.(xml|mjcf)$/i.test(name)) {
          copyScene(found, top, folders);
        } else {
          copy(found);
          copy(path.resolve(base, folder, path.basename(name))); // as MuJoCo takes URDF's
        }
      }
    }
  }
}

// MuJoCo has URDF's bodies apart only when told, and knows no packages: their meshes are copied. It
// keeps meshes by their names, so that no name comes twice. What is only seen is taken away, and
// what hapode leaves out with a line: meshes of COLLADA, and those that are not there.
let meshes = 0;

function compileUrdf(file, text) {
  const plain = text.replace(/<!--.*?-->/gs, '')
    .replace(/<visual\b[^>]*\/>|<visual\b.*?<\/visual>/gs, '')
    .replace(/<collision\b[^>]*\/>|<collision\b.*?<\/collision>/gs, (collision) => {
      const name = collision.match(/<mesh\b[^>]*?filename\s*=\s*["']([^"']*)["']/s)?.[1];
      const found = name === undefined ? undefined : findMesh(file, name);
      if (name === undefined) {
        return collision;
      }
      if (found === undefined || !/\.(stl|obj|msh)$/i.test(name)) {
        return '';
      }
      const place = `/mesh${++meshes}${path.extname(name).toLowerCase()}`;
      mujoco.FS.writeFile(place, fs.readFileSync(found));
      copied.add(place);
      return collision.replace(name, place);
    });
  const options = '<mujoco><compiler fusestatic="false" strippath="false" balanceinertia="true"/>' +
    '</mujoco>';
  const place = '/scene.urdf';
  mujoco.FS.writeFile(place, plain.replace(/<\/robot>\s*$/, options + '</robot>'));
  copied.add(place);
  return mujoco.MjModel.mj_loadXML(place);
}

function findMesh(file, name) {
  const inPackage = name.match(/^package:\/\/([^/]*)\/(.*)$/s);
  const candidates = [];
  if (inPackage) {
    for (let at = path.dirname(file); at !== path.dirname(at); at = path.dirname(at)) {
      if (path.basename(at) === inPackage[1]) {
        candidates.push(path.join(at, inPackage[2]));
        break;
      }
    }
    candidates.push(path.resolve(path.dirname(file), inPackage[1], inPackage[2]));
  } else {
    candidates.push(path.resolve(path.dirname(file), name.replace(/^file:\/\//, '')));
  }
  return candidates.find((at) => fs.statSync(at, {throwIfNoEntry: false})?.isFile());
}

function compile(file) {
  const text = fs.statSync(file, {throwIfNoEntry: false})?.isFile()
    ? fs.readFileSync(file, 'latin1') : '';
  if (/<robot[\s>]/.test(text) && !/<mujoco[\s>]/.test(text)) {
    return compileUrdf(file, text);
  }
  for (let before = -1; before < copied.size;) { // folders that a later file names
    before = copied.size;
    const folders = compile.folders ?? new Set();
    compile.folders = folders;
    copied.delete(file); // read again
    copyScene(file, path.dirname(file), folders);
  }
  compile.folders = undefined;
  return mujoco.MjModel.mj_loadXML(file);
}

// Of each geom that is a mesh the box around it in its body: least x, y, z, then most.
function boxes(model) {
  const out = [];
  for (let g = 0; g < model.ngeom; ++g) {
    const box = [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity];
    const mesh = model.geom_type[g] === 7 ? model.geom_dataid[g] : -1;
    const [w, x, y, z] = model.geom_quat.slice(4 * g, 4 * g + 4);
    for (let v = 0; mesh >= 0 && v < model.mesh_vertnum[mesh]; ++v) {
      const from = 3 * (model.mesh_vertadr[mesh] + v);
      const [a, b, c] = model.mesh_vert.slice(from, from + 3);
      const t = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
      const turned = [a + w * t[0] + y * t[2] - z * t[1], b + w * t[1] + z * t[0] - x * t[2],
        c + w * t[2] + x * t[1] - y * t[0]];
      for (let k = 0; k < 3; ++k) {
        const at = turned[k] + model.geom_pos[3 * g + k];
        box[k] = Math.min(box[k], at);
        box[3 + k] = Math.max(box[3 + k], at);
      }
    }
    out.push(...(mesh >= 0 ? box : [0, 0, 0, 0, 0, 0]));
  }
  return out;
}

function say(model) {
  const data = new mujoco.MjData(model);
  mujoco.mj_kinematics(model, data);
  const lines = [`model ${mujoco.mj_versionString()}`];
  const put = (name, values) => lines.push([name, values.length, ...values].join(' '));
  INTEGERS.concat(REALS).forEach((name) => put(name, model[name]));
  // An array of truths cannot be had, each of them can.
  put('jnt_limited', Array.from({length: model.njnt}, (_, i) => Number(model.jnt(i).limited)));
  const weightless = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY.value;
  put('gravity', weightless ? [0, 0, 0] : model.opt.gravity);
  put('geom_box', boxes(model));
  put('xpos', data.xpos);
  put('xquat', data.xquat);
  lines.push(`bodies ${model.nbody}`);
  for (let i = 0; i < model.nbody; ++i) {
    lines.push(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY.value, i) ?? '');
  }
  data.delete();
  fs.writeSync(1, lines.join('\n') + '\nend\n');
}

for await (const file of readline.createInterface({input: process.stdin})) {
  let model;
  try {
    model = compile(file);
    say(model);
  } catch (error) {
    const why = typeof error === 'number' ? 'an exception of MuJoCo' : String(error.message ?? error);
    fs.writeSync(1, `refused ${why.replace(/\s+/g, ' ')}\n`);
  }
  model?.delete();
  copied.forEach((name) => mujoco.FS.unlink(name));
  copied.clear();
}
