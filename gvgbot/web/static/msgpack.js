// MessagePack bytes to values, as its specification has it; binary becomes a Uint8Array.

export function decode(buffer) {
  const view = new DataView(buffer), bytes = new Uint8Array(buffer), utf8 = new TextDecoder();
  let at = 0;

  function take(size) {
    at += size;
    if (at > bytes.length) throw new RangeError("the message ends too early");
    return at - size;
  }
  const u8 = () => view.getUint8(take(1));
  const u16 = () => view.getUint16(take(2));
  const u32 = () => view.getUint32(take(4));
  const text = (size) => { const from = take(size); return utf8.decode(bytes.subarray(from, at)); };
  const binary = (size) => { const from = take(size); return bytes.slice(from, at); };
  const list = (size) => Array.from({ length: size }, value);
  function map(size) {
    const found = {};
    for (let i = 0; i < size; i++) { const key = value(); found[key] = value(); }
    return found;
  }

  function value() {
    const tag = u8();
    if (tag < 0x80) return tag;
    if (tag < 0x90) return map(tag & 0x0f);
    if (tag < 0xa0) return list(tag & 0x0f);
    if (tag < 0xc0) return text(tag & 0x1f);
    if (tag >= 0xe0) return tag - 0x100;
    switch (tag) {
      case 0xc0: return null;
      case 0xc2: return false;
      case 0xc3: return true;
      case 0xc4: return binary(u8());
      case 0xc5: return binary(u16());
      case 0xc6: return binary(u32());
      case 0xca: return view.getFloat32(take(4));
      case 0xcb: return view.getFloat64(take(8));
      case 0xcc: return u8();
      case 0xcd: return u16();
      case 0xce: return u32();
      case 0xcf: return Number(view.getBigUint64(take(8)));
      case 0xd0: return view.getInt8(take(1));
      case 0xd1: return view.getInt16(take(2));
      case 0xd2: return view.getInt32(take(4));
      case 0xd3: return Number(view.getBigInt64(take(8)));
      case 0xd9: return text(u8());
      case 0xda: return text(u16());
      case 0xdb: return text(u32());
      case 0xdc: return list(u16());
      case 0xdd: return list(u32());
      case 0xde: return map(u16());
      case 0xdf: return map(u32());
      default: throw new TypeError(`a tag of no use here: ${tag}`);
    }
  }
  return value();
}

// Points as they travel, little-endian float32 pairs; every machine with a browser is little-endian.
export const points = (binary) => new Float32Array(binary.buffer, binary.byteOffset, binary.length >> 2);
export const poses = points; // x, y, theta, x and so on
export const millimetres = (binary) => new Uint16Array(binary.buffer, binary.byteOffset, binary.length >> 1);
