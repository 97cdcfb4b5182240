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
    this.box = null; // left, bottom, right, top, m, of what is known
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
    this.tiles.set(name, tile);
    this.makeRoom(tile);
    this.paint(tile);
    this.widen(tile);
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

  widen({ column, row, cells }) {
    const side = this.side, cell = this.resolution;
    for (let at = 0; at < cells.length; at++) {
      if (cells[at] < 0) continue;
      const x = (column * side + (at % side)) * cell, y = (row * side + Math.floor(at / side)) * cell;
      const [left, bottom, right, top] = this.box ?? [x, y, x, y];
      this.box = [Math.min(left, x), Math.min(bottom, y), Math.max(right, x + cell), Math.max(top, y + cell)];
    }
  }
}

async function inflated(bytes) {
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}

function rgb(colour) {
  const hex = colour.slice(1);
  return [0, 2, 4].map((i) => parseInt(hex.slice(i, i + 2), 16));
}
