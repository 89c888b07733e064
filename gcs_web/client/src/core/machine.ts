/** How fast this machine draws, measured once before the 3D view is loaded. */

const SIDE_PX = 512;
/** Milliseconds for the measured picture: a graphics card takes 1 to 3, a processor in its place 30 and more. */
const SLOW_MS = 15;
const VERTEX = "attribute vec2 p; void main() { gl_Position = vec4(p, 0.0, 1.0); }";
const FRAGMENT = `precision highp float;
void main() {
  vec3 c = gl_FragCoord.xyz * 0.01;
  for (int i = 0; i < 64; i++) c = sin(c * 1.7 + c.zxy) + 0.3;
  gl_FragColor = vec4(c, 1.0);
}`;

/** Whether there is any 3D drawing at all here. */
export const canDraw = document.createElement("canvas").getContext("webgl") !== null;

/** Whether a picture of many sums a pixel takes long, or cannot be drawn at all. */
export function drawsSlowly(): boolean {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = SIDE_PX;
  const gl = canvas.getContext("webgl");
  if (gl === null) return true;
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]] as const) {
    const shader = gl.createShader(kind);
    if (shader === null) return true;
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.bindAttribLocation(program, 0, "p");
  gl.linkProgram(program);
  gl.useProgram(program);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 3, -1, -1, 3]), gl.STATIC_DRAW);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
  const draw = (): number => {
    const begun_ms = performance.now();
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); // waits for the picture
    return performance.now() - begun_ms;
  };
  draw(); // the first one also compiles
  const took_ms = Math.min(draw(), draw());
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return took_ms > SLOW_MS;
}
