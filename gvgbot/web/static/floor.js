// Walls and floor: tiles as they come, on one picture that grows with them.

const FREE = 20, WALL = 80; // percent: up to here it is painted as floor, from here on as wall

export class Floor {
  constructor(resolution, side, colours) {
    this.resolution = resolution; // m, the side of a cell
    this.side = side; // cells of a tile
    this.tiles = new Map();
    this.orders = new Map();
    this.order = 0;
    this.picture = null;
    this.setColours(colours);
  }

  setColours({ floor, wall }) {
    this.free = rgb(floor);
    this.wall = rgb(wall);
    for (const tile of this.tiles.values()) this.paint(tile);
  }

  // Take a tile as it came; it takes a moment to unpack, and then the newest is painted.
  async take({ column, row, cells }) {
    const name = `${column} ${row}`, order = ++this.order;
    this.orders.set(name, order);
    const unpacked = await inflated(cells);
    if (this.orders.get(name) !== order) return;
    const tile = { column, row, cells: new Int8Array(unpacked) };
    tile.box = this.boxOf(tile);
    this.tiles.set(name, tile);
    this.makeRoom(tile);
    this.paint(tile);
  }

  // Left, bottom, right, top, m, of what is known; null as long as nothing is.
  get box() {
    const boxes = [...this.tiles.values()].flatMap(({ box }) => (box === null ? [] : [box]));
    return boxes.length === 0 ? null : boxes.reduce(([left, bottom, right, top], box) => (
      [Math.min(left, box[0]), Math.min(bottom, box[1]), Math.max(right, box[2]), Math.max(top, box[3])]));
  }

  // The picture's upper left corner, m.
  get left() { return this.columns[0] * this.side * this.resolution; }
  get top() { return this.rows[1] * this.side * this.resolution; }

  makeRoom({ column, row }) {
    const before = this.picture;
    this.columns ??= [column, column];
    this.rows ??= [row, row];
    const [left, top] = [this.columns[0], this.rows[1]];
    this.columns = [Math.min(left, column), Math.max(this.columns[1], column + 1)];
    this.rows = [Math.min(this.rows[0], row), Math.max(top, row + 1)];
    const wide = (this.columns[1] - this.columns[0]) * this.side, high = (this.rows[1] - this.rows[0]) * this.side;
    if (before?.width === wide && before.height === high) return;
    this.picture = new OffscreenCanvas(wide, high);
    if (before !== null) this.picture.getContext("2d").drawImage(before, (left - this.columns[0]) * this.side, (this.rows[1] - top) * this.side);
  }

  paint({ column, row, cells }) {
    const side = this.side, image = new ImageData(side, side);
    for (let at = 0; at < cells.length; at++) {
      if (cells[at] < 0) continue;
      const share = Math.min(1, Math.max(0, (cells[at] - FREE) / (WALL - FREE)));
      const to = 4 * ((side - 1 - Math.floor(at / side)) * side + (at % side));
      for (let i = 0; i < 3; i++) image.data[to + i] = this.free[i] + share * (this.wall[i] - this.free[i]);
      image.data[to + 3] = 255;
    }
    this.picture.getContext("2d").putImageData(image, (column - this.columns[0]) * side, (this.rows[1] - 1 - row) * side);
  }

  // The same of a tile; where a loop has closed, nothing may be left of it.
  boxOf({ column, row, cells }) {
    const side = this.side, cell = this.resolution;
    let [left, bottom, right, top] = [side, side, 0, 0];
    for (let at = 0; at < cells.length; at++) {
      if (cells[at] < 0) continue;
      const x = at % side, y = Math.floor(at / side);
      [left, bottom, right, top] = [Math.min(left, x), Math.min(bottom, y), Math.max(right, x + 1), Math.max(top, y + 1)];
    }
    const [x, y] = [column * side, row * side];
    return right === 0 ? null : [(x + left) * cell, (y + bottom) * cell, (x + right) * cell, (y + top) * cell];
  }
}

// A stream out of a Blob takes ten times as long, which in a large building is felt. What is damaged fails where it is read.
async function inflated(bytes) {
  const { readable, writable } = new DecompressionStream("deflate"), writer = writable.getWriter();
  for (const done of [writer.write(bytes), writer.close()]) done.catch(() => {});
  return new Response(readable).arrayBuffer();
}

function rgb(colour) {
  const hex = colour.slice(1);
  return [0, 2, 4].map((i) => parseInt(hex.slice(i, i + 2), 16));
}
