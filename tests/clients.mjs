// What clients on Node.js make of files: `node clients.mjs gltf-validator|three|@niivue/niivue FILE...` prints one JSON
// for each.
// Their packages are found as require finds them, in NODE_PATH too.
import { existsSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { extname, join } from "node:path";
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

const READERS = { ".ply": "readPLY", ".stl": "readSTL", ".obj": "readOBJ", ".off": "readOFF", ".gii": "readGII" };

async function viewed(data, suffix) {
  const home = require.resolve.paths(client).map((folder) => join(folder, client)).find(existsSync);
  const { exports } = JSON.parse(readFileSync(join(home, "package.json"))); // it has no entry for require
  const { NVMeshLoaders } = await import(pathToFileURL(join(home, exports["."].import)));
  const { positions, indices, colors } = await NVMeshLoaders[READERS[suffix]](new Uint8Array(data).buffer);
  return { places: Array.from(positions), index: Array.from(indices), fractions: colors && Array.from(colors) };
}

const TOLD = { "gltf-validator": validated, three: loaded, "@niivue/niivue": viewed };

const [client, ...files] = process.argv.slice(2);
for (const file of files) {
  const data = readFileSync(file);
  console.log(JSON.stringify(await TOLD[client](data, extname(file))));
}
