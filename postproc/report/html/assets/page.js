"use strict";
// What every page needs: its data, elements made without markup, numbers told.

const Page = {
  // Run plotly.js, which stands in the page compressed: the page's policy knows it.
  async library() {
    const node = document.getElementById("library");
    const script = document.createElement("script");
    script.textContent = await Page.inflate(node.textContent);
    node.textContent = "";
    document.body.append(script);
  },

  // Read the data that stand in the page, once what draws them is there.
  async data() {
    await Page.library();
    const node = document.getElementById("data");
    const text = node.type === "application/gzip"
      ? await Page.inflate(node.textContent) : node.textContent;
    node.textContent = "";
    return JSON.parse(text);
  },

  async inflate(base64) {
    const raw = atob(base64);
    const bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    const stream = new Blob([bytes]).stream();
    return new Response(stream.pipeThrough(new DecompressionStream("gzip"))).text();
  },

  // Make an element; children are elements or texts, never markup.
  element(tag, properties = {}, ...children) {
    const node = document.createElement(tag);
    for (const [key, value] of Object.entries(properties)) {
      if (key in node) node[key] = value; else node.setAttribute(key, value);
    }
    node.append(...children);
    return node;
  },

  number(value, digits) {
    if (value === null || !Number.isFinite(value)) return "–";
    return value.toFixed(digits).replace(/^-(?=[0.]*$)/, "").replace("-", "−");
  },

  // No button that would send the figure to a server.
  config: {
    displaylogo: false, responsive: true, showSendToCloud: false, plotlyServerURL: "",
    typesetMath: false,
    modeBarButtonsToRemove: ["select2d", "lasso2d", "zoomIn2d", "zoomOut2d", "autoScale2d", "resetCameraLastSave3d"],
  },

  layout(more) {
    const font = { family: "system-ui, sans-serif", size: 12, color: "#222" };
    return Object.assign({
      font, paper_bgcolor: "#fff", plot_bgcolor: "#fff",
      margin: { l: 60, r: 16, t: 30, b: 48 },
    }, more);
  },

  // Draw, and say in words where a browser cannot.
  draw(node, traces, layout) {
    return Plotly.react(node, traces, Page.layout(layout), Page.config);
  },

  // Printers do not see what WebGL drew: copy it into plain canvases for them.
  copyForPrint() {
    Page.forgetCopies();
    for (const node of document.querySelectorAll(".js-plotly-plot")) {
      const scene = node._fullLayout && node._fullLayout.scene && node._fullLayout.scene._scene;
      if (!scene || !scene.glplot) continue;
      scene.glplot.redraw();
      const drawn = scene.glplot.canvas, copy = document.createElement("canvas");
      copy.width = drawn.width;
      copy.height = drawn.height;
      copy.getContext("2d").drawImage(drawn, 0, 0);
      copy.style.cssText = drawn.style.cssText;
      copy.className = "printed";
      drawn.after(copy);
    }
  },

  // Figures wider than a sheet are drawn anew in its width, views in space made smaller.
  fitForPrint() {
    for (const node of document.querySelectorAll(".js-plotly-plot")) {
      if (node.clientWidth <= Page.SHEET) continue;
      if (node.querySelector("canvas")) node.style.zoom = String(Page.SHEET / node.clientWidth);
      else Plotly.relayout(node, { autosize: false, width: Page.SHEET });
    }
  },

  forgetFit() {
    for (const node of document.querySelectorAll(".js-plotly-plot")) {
      node.style.zoom = "";
      if (node.layout.width) Plotly.relayout(node, { autosize: true, width: null });
    }
  },

  forgetCopies() {
    for (const copy of document.querySelectorAll("canvas.printed")) copy.remove();
  },

  trouble(problem) {
    const node = document.getElementById("trouble");
    node.hidden = false;
    node.textContent = `This page could not show everything: ${problem}`;
  },
};

Page.COLOURS = {  // Okabe and Ito: told apart with any kind of colour vision
  blue: "#0072b2", vermillion: "#d55e00", orange: "#e69f00", green: "#009e73",
  purple: "#cc79a7", grey: "#767676", black: "#222222",
};

Page.SHEET = 700;  // px that the width of a sheet holds

window.addEventListener("beforeprint", () => { Page.copyForPrint(); Page.fitForPrint(); });
window.addEventListener("afterprint", () => { Page.forgetCopies(); Page.forgetFit(); });
