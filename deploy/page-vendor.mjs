// Builds daemon/page/vendor/: the libraries of the page, each as one ES module, with their hashes and licences.
// `make page-vendor` runs it; it needs npm and the registry, the page itself needs neither.
import { execFileSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const PACKAGES = {
  preact: '11.2.0', '@preact/signals': '2.11.4', '@preact/signals-core': '1.14.5', htm: '3.1.1', three: '0.187.0',
};
const ESBUILD = '0.28.2';

const MODULES = {
  'preact.js': `
    export { Component, render } from 'preact';
    export { useCallback, useEffect, useLayoutEffect, useMemo, useRef, useState } from 'preact/hooks';
    export { batch, computed, effect, signal } from '@preact/signals';
    import { h } from 'preact';
    import htm from 'htm';
    export const html = htm.bind(h);`,
  'three.js': `
    export {
      BufferAttribute, BufferGeometry, CylinderGeometry, DirectionalLight, DoubleSide, Float32BufferAttribute,
      GLSL3, GridHelper, Group, HemisphereLight, LineBasicMaterial, LineDashedMaterial, LineSegments, Mesh,
      MeshBasicMaterial, MeshLambertMaterial, PerspectiveCamera, Points, Quaternion, Raycaster, Scene, ShaderMaterial,
      SphereGeometry, Vector2, Vector3, WebGLRenderer,
    } from 'three';
    export { OrbitControls } from 'three/addons/controls/OrbitControls.js';`,
};

const target = join(dirname(fileURLToPath(import.meta.url)), '..', 'daemon', 'page', 'vendor');
const work = mkdtempSync(join(tmpdir(), 'page-vendor-'));
const sha256 = (bytes) => createHash('sha256').update(bytes).digest('hex');

try {
  const wanted = { ...PACKAGES, esbuild: ESBUILD };
  writeFileSync(join(work, 'package.json'), JSON.stringify({ private: true, dependencies: wanted }));
  execFileSync('npm', ['install', '--no-audit', '--no-fund', '--silent'], { cwd: work, stdio: 'inherit' });
  const lock = JSON.parse(readFileSync(join(work, 'package-lock.json'), 'utf8')).packages;
  mkdirSync(target, { recursive: true });
  const files = {};
  for (const [name, source] of Object.entries(MODULES)) {
    writeFileSync(join(work, name), source);
    const options = ['--bundle', '--minify', '--format=esm', '--target=es2022', '--legal-comments=none'];
    execFileSync(join(work, 'node_modules', '.bin', 'esbuild'), [name, ...options, `--outfile=built/${name}`], { cwd: work });
    cpSync(join(work, 'built', name), join(target, name));
    files[name] = sha256(readFileSync(join(target, name)));
  }
  const packages = Object.entries(PACKAGES).map(([name, version]) => {
    const { license } = JSON.parse(readFileSync(join(work, 'node_modules', name, 'package.json'), 'utf8'));
    return { name, version, license, integrity: lock[`node_modules/${name}`].integrity };
  });
  const licences = packages.map(({ name, version }) => {
    const text = readFileSync(join(work, 'node_modules', name, 'LICENSE'), 'utf8').trim();
    return `${name} ${version}\n\n${text}\n`;
  });
  writeFileSync(join(target, 'LICENSES.txt'), licences.join(`\n${'-'.repeat(80)}\n\n`));
  const built = { bundler: { name: 'esbuild', version: ESBUILD }, packages, sha256: files };
  writeFileSync(join(target, 'vendored.json'), JSON.stringify(built, null, 1) + '\n');
} finally {
  rmSync(work, { recursive: true });
}
