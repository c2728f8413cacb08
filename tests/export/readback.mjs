// Reads glTF files with the Khronos validator and with three.js, which play them: writes for every file the number of errors,
// and of binary files the positions that three.js shows at each key time and halfway to the next.
import { readFileSync, writeFileSync } from 'node:fs';
import validator from 'gltf-validator';
import { AnimationMixer, Vector3 } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

const read = {};
for (const file of process.argv.slice(3)) {
  const bytes = new Uint8Array(readFileSync(file));
  const { issues } = await validator.validateBytes(bytes);
  const told = issues.messages.filter((message) => message.severity < 2);
  read[file] = { errors: issues.numErrors, warnings: issues.numWarnings, told };
  if (!file.endsWith('.glb')) continue;
  const gltf = await new GLTFLoader().parseAsync(bytes.buffer, '');
  const meshes = [];
  gltf.scene.traverse((object) => { if (object.geometry) meshes.push(object); });
  const mixer = new AnimationMixer(gltf.scene);
  gltf.animations.forEach((animation) => mixer.clipAction(animation).play());
  const place = new Vector3();
  const shown = (time) => {
    mixer.setTime(time);
    // All primitives share their vertices.
    const mesh = meshes[0];
    const count = mesh.geometry.attributes.position.count;
    return Array.from({ length: count }, (_, vertex) => mesh.getVertexPosition(vertex, place).toArray());
  };
  const times = Array.from(gltf.animations[0].tracks[0].times);
  read[file].times = times;
  // The clip starts anew at its end.
  read[file].frames = times.map((time, n) => shown(n === times.length - 1 ? time * (1 - 1e-12) : time));
  read[file].between = times.slice(1).map((time, n) => shown((times[n] + time) / 2));
  read[file].materials = meshes.map((mesh) => mesh.material.name);
  read[file].uvs = meshes[0].geometry.attributes.uv?.count ?? 0;
}
writeFileSync(process.argv[2], JSON.stringify(read));
