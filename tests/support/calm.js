// A page whose scene is there and is not drawn: by software, at rest, it takes a core and a half, of two, for nothing
// that most tests look at.  What moves there is asked of its poses.  And a page has five frames a second.
const gl = WebGL2RenderingContext;
const answers = {
  getContextAttributes: () => ({ alpha: true, depth: true, stencil: false, antialias: true }),
  getSupportedExtensions: () => [],
  getExtension: (name) => (name.startsWith('EXT_color_buffer') ? {} : null),
  isContextLost: () => false,
  getError: () => 0,
  getShaderPrecisionFormat: () => ({ rangeMin: 127, rangeMax: 127, precision: 23 }),
  getShaderParameter: () => true,
  getProgramParameter: (program, what) => ![gl.ACTIVE_UNIFORMS, gl.ACTIVE_ATTRIBUTES].includes(what) && 1,
  getShaderInfoLog: () => '',
  getProgramInfoLog: () => '',
  checkFramebufferStatus: () => gl.FRAMEBUFFER_COMPLETE,
  getParameter: (what) => ({
    [gl.VERSION]: 'WebGL 2.0',
    [gl.SHADING_LANGUAGE_VERSION]: 'WebGL GLSL ES 3.00',
    [gl.VIEWPORT]: [0, 0, 1, 1],
    [gl.SCISSOR_BOX]: [0, 0, 1, 1],
    [gl.IMPLEMENTATION_COLOR_READ_FORMAT]: gl.RGBA,
    [gl.IMPLEMENTATION_COLOR_READ_TYPE]: gl.FLOAT,
  })[what] ?? 4096,
};

function answer(name) {
  if (typeof gl[name] === 'number') return gl[name];
  return answers[name] ?? (String(name).startsWith('create') ? () => ({}) : () => null);
}

const contexts = new WeakMap();
const real = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...how) {
  if (!kind.startsWith('webgl')) return real.call(this, kind, ...how);
  if (!contexts.has(this)) {
    const own = { canvas: this, drawingBufferWidth: 1, drawingBufferHeight: 1 };
    contexts.set(this, new Proxy(own, { get: (_, name) => (name in own ? own[name] : (own[name] = answer(name))) }));
  }
  return contexts.get(this);
};

const frame = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = (then) => setTimeout(() => frame(then), 200);
window.cancelAnimationFrame = clearTimeout;

// Plotly measures each text of a figure in an element of its own at the end of the page, where each of them has the
// browser match the page's `:has()` rules anew, for 10 ms.  In a shadow root it is measured alike, and for itself.
let measuring = null;
const append = Node.prototype.appendChild;
HTMLBodyElement.prototype.appendChild = function (child) {
  if (!(child instanceof SVGSVGElement)) return append.call(this, child);
  measuring ??= append.call(this, document.createElement('div')).attachShadow({ mode: 'open' });
  measuring.replaceChildren(child);
  return child;
};
