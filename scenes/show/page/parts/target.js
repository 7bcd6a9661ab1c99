// What is drawn into before the canvas shows it: four samples a pixel, or, in haste, one.

const SAMPLES = 4;

class Target {
  constructor(gl) {
    this.gl = gl;
    this.kept = [SAMPLES, 0].map((samples) => ({
      samples,
      framebuffer: gl.createFramebuffer(),
      attached: [[gl.COLOR_ATTACHMENT0, gl.RGBA8], [gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT24]].map((each) => [...each, gl.createRenderbuffer()]),
    }));
  }

  // Its size in pixels, once it is the target.
  begin(hasty) {
    const gl = this.gl;
    const { width, height } = gl.canvas;
    const size = [width, height];
    const now = (this.now = this.kept[hasty ? 1 : 0]);
    gl.bindFramebuffer(gl.FRAMEBUFFER, now.framebuffer);
    if (String(size) !== String(now.size)) {
      for (const [place, format, buffer] of now.attached) {
        gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
        gl.renderbufferStorageMultisample(gl.RENDERBUFFER, now.samples, format, ...size);
        gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, buffer);
      }
      now.size = size;
    }
    return size;
  }

  show() {
    const gl = this.gl;
    const { framebuffer, size } = this.now;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, framebuffer);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    gl.disable(gl.SCISSOR_TEST);
    gl.blitFramebuffer(0, 0, ...size, 0, 0, ...size, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }
}
