// What clients on Node.js make of files: `node clients.mjs gltf-validator|three FILE...` prints one JSON for each.
// Their packages are found as require finds them, in NODE_PATH too.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { extname } from "node:path";
import { pathToFileURL } from "node:url";

const require = createRequire(import.meta.url);
globalThis.self = globalThis; // the loaders of three.js are made for browsers

async function validated(data) {
  const { issues, info } = await require("gltf-validator").validateBytes(new Uint8Array(data));
  return { messages: issues.messages, triangles: info.totalTriangleCount };
}

const PARSERS = {
  ".ply": ["PLYLoader", (loader, bytes) => loader.parse(bytes)],
  ".stl": ["STLLoader", (loader, bytes) => loader.parse(bytes)],
  ".obj": ["OBJLoader", (loader, bytes) => loader.parse(new TextDecoder().decode(bytes))],
  ".glb": ["GLTFLoader", async (loader, bytes) => (await loader.parseAsync(bytes, "")).scene],
};

async function loaded(data, suffix) {
  const [name, parse] = PARSERS[suffix];
  const file = pathToFileURL(require.resolve(`three/examples/jsm/loaders/${name}.js`));
  const three = await import(new URL("../../../build/three.module.js", file)); // the one that the loaders take
  const { [name]: Loader } = await import(file);
  const found = await parse(new Loader(), new Uint8Array(data).buffer);
  const body = found.isBufferGeometry ? new three.Mesh(found) : found.getObjectsByProperty("isMesh", true)[0];
  body.updateWorldMatrix(true, false);
  const { position, color } = body.geometry.attributes;
  const places = Array.from({ length: position.count }, (_, n) =>
    new three.Vector3().fromBufferAttribute(position, n).applyMatrix4(body.matrixWorld).toArray(),
  );
  const shown = color && Array.from({ length: color.count }, (_, n) =>
    new three.Color().fromBufferAttribute(color, n).getHex(three.SRGBColorSpace),
  );
  const { metalness, roughness } = body.material;
  const index = Array.from(body.geometry.index?.array ?? []);
  return { array: position.array.constructor.name, places, index, shown, metalness, roughness };
}

const [client, ...files] = process.argv.slice(2);
for (const file of files) {
  const data = readFileSync(file);
  console.log(JSON.stringify(client === "three" ? await loaded(data, extname(file)) : await validated(data)));
}
