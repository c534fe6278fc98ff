// Writes page/three.js: the parts of three.js that entry.js names, with its licence. Run by `make viewer`.
import { build } from "esbuild";
import { readFileSync } from "node:fs";

const three = JSON.parse(readFileSync("node_modules/three/package.json", "utf8"));
const licence = readFileSync("node_modules/three/LICENSE", "utf8").trim();
await build({
  entryPoints: ["entry.js"],
  outfile: process.argv[2],
  bundle: true,
  minify: true,
  format: "iife",
  globalName: "THREE",
  target: "es2020",
  charset: "utf8",
  legalComments: "none",
  banner: { js: `/*! three.js ${three.version}\n\n${licence}\n*/` },
});
