// A canvas as sharp as the screen, cleared.

export const FONT = "12px system-ui, 'DejaVu Sans', sans-serif";

export const canvas = (node, width, height) => {
  const ratio = devicePixelRatio || 1;
  if (node.width !== Math.round(width * ratio) || node.height !== Math.round(height * ratio)) {
    node.width = Math.round(width * ratio);
    node.height = Math.round(height * ratio);
  }
  const ctx = node.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.clearRect(0, 0, width, height);
  ctx.font = FONT;
  return ctx;
};
