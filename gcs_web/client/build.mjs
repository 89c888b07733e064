// Builds the page into gcs_web/static, byte for byte the same every time.
import { copyFile, mkdir, readFile, writeFile } from "node:fs/promises";
import { build } from "esbuild";

const OUT = "../static";
const PARTS = ["@preact/signals", "@preact/signals-core", "preact", "uplot"];

await mkdir(OUT, { recursive: true });
await build({
  entryPoints: { app: "src/main.tsx", worker: "src/worker.ts" },
  bundle: true,
  minify: true,
  format: "esm",
  target: "es2023",
  jsx: "automatic",
  jsxImportSource: "preact",
  legalComments: "none",
  outdir: OUT,
});
for (const name of ["index.html", "manifest.json", "icon.svg"]) await copyFile(`src/${name}`, `${OUT}/${name}`);

const notices = PARTS.map(async (name) => {
  const licence = await readFile(`node_modules/${name}/LICENSE`, "utf8");
  const { version } = JSON.parse(await readFile(`node_modules/${name}/package.json`, "utf8"));
  return `${name} ${version}\n\n${licence.trim()}\n`;
});
await writeFile(`${OUT}/licenses.txt`, (await Promise.all(notices)).join("\n---\n\n"));
