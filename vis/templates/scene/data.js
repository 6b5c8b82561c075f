// Arrays of a scene from the text of the page: the reverse of vis/view/packing.py.

/** All arrays of a scene by name, each with its `frames`, `count`, `parts` and `values` (frame after frame). */
async function unpackArrays(text, entries) {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const raw = new Uint8Array(await new Response(stream).arrayBuffer());
  const arrays = {};
  let start = 0;
  for (const entry of entries) {
    const { frames, count, parts, bytes } = entry;
    const row = count * parts;
    const values = new { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array }[bytes](frames * row);
    for (let frame = 0; frame < frames; frame++)
      for (let part = 0; part < parts; part++)
        for (let byte = 0; byte < bytes; byte++, start += count)
          for (let i = 0, to = frame * row + part; i < count; i++, to += parts)
            values[to] |= raw[start + i] << (8 * byte);
    // A frame is stored as the difference from the one before it; typed arrays add modulo their range.
    for (let i = row; i < values.length; i++) values[i] += values[i - row];
    arrays[entry.name] = { frames, count, parts, values, at: (frame) => values.subarray((frames > 1 ? frame : 0) * row) };
  }
  return arrays;
}
