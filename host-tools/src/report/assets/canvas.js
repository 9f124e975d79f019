// A canvas as sharp as the screen.

export const canvas = (node, height) => {
  const width = node.clientWidth || 600, ratio = devicePixelRatio || 1;
  node.width = Math.round(width * ratio);
  node.height = Math.round(height * ratio);
  node.style.height = height + "px";
  const ctx = node.getContext("2d");
  ctx.scale(ratio, ratio);
  ctx.font = "12px system-ui, 'DejaVu Sans', sans-serif";
  return [ctx, width, height];
};
