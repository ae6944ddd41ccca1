// The data block: a JSON header that refers to the arrays behind it; see packing.py.

const ARRAYS = { f4: Float32Array, u4: Uint32Array };

async function inflate(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const text = new TextDecoder().decode(new Uint8Array(buffer, 4, length));
  return JSON.parse(text, (_, value) => {
    if (value === null || typeof value !== "object" || !("$array" in value)) return value;
    const [kind, offset, count] = value.$array;
    return new ARRAYS[kind](buffer, 4 + length + offset, count);
  });
}
