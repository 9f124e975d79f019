// Map tiles under the track, from the server that `hums report --map` named. Without that there are none, and no request.
//
// Tiles are squares of 256 pixels in the Web Mercator projection (EPSG:3857), numbered from the north-west.

const template = document.querySelector("meta[name=tiles]")?.content;
const SIZE = 256,
  ZOOM_MAX = 19,
  // The equator in metres.
  EQUATOR = 40075017,
  RADIANS = Math.PI / 180;
const images = new Map();

const row = (lat, count) => ((1 - Math.asinh(Math.tan(lat * RADIANS)) / Math.PI) / 2) * count;
const latitude = (row, count) => Math.atan(Math.sinh(Math.PI * (1 - (2 * row) / count))) / RADIANS;

const image = (zoom, x, y, whenLoaded) => {
  const address = template.replace("{z}", zoom).replace("{x}", x).replace("{y}", y);
  if (!images.has(address)) {
    const made = new Image();
    made.onload = whenLoaded;
    made.src = address;
    images.set(address, made);
  }
  return images.get(address);
};

export const tilesFrom = template && new URL(template.replace(/[{}]/g, "")).host;

// Draws the tiles of an area in degrees. `place` gives the pixel of a longitude and a latitude, `scale` the pixels of a metre.
export const drawTiles = (ctx, { west, east, south, north }, scale, place, whenLoaded) => {
  if (!template) return;
  const wide = EQUATOR * Math.cos(((south + north) / 2) * RADIANS) * scale;
  const zoom = Math.min(Math.max(Math.round(Math.log2(wide / SIZE)), 0), ZOOM_MAX),
    count = 2 ** zoom;
  const column = (lon) => ((lon + 180) / 360) * count;
  for (let x = Math.floor(column(west)); x < column(east); x++)
    for (let y = Math.max(Math.floor(row(north, count)), 0); y < Math.min(row(south, count), count); y++) {
      // The short way round the earth: a track may cross the 180th meridian.
      const tile = image(zoom, ((x % count) + count) % count, y, whenLoaded);
      if (!tile.complete || !tile.naturalWidth) continue;
      const [left, top] = place((x / count) * 360 - 180, latitude(y, count)),
        [right, bottom] = place(((x + 1) / count) * 360 - 180, latitude(y + 1, count));
      ctx.drawImage(tile, left, top, right - left, bottom - top);
    }
};
