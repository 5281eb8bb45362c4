"use strict";
// A page whose figures are drawn as they come.

Page.data()
  .then(async ({ figures }) => {
    for (const node of document.querySelectorAll("[data-figure]")) {
      const { traces, layout } = figures[node.dataset.figure];
      layout.hovermode = "closest";
      layout.legend = Object.assign({ orientation: "h", x: 0, y: 1.02, yanchor: "bottom" }, layout.legend);
      await Page.draw(node, traces, layout);
    }
    document.body.dataset.ready = "yes";
  })
  .catch((problem) => Page.trouble(problem));
