// Reads an MCAP file with Foxglove's own packages and prints, per topic, counts and a digest of payloads and values.
import { createHash } from "node:crypto";
import { open } from "node:fs/promises";
import { McapIndexedReader } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";
import { FileHandleReadable } from "@mcap/nodejs";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";

function values(value, out) {
  if (ArrayBuffer.isView(value) || Array.isArray(value)) for (const item of value) values(item, out);
  else if (typeof value === "object" && value !== null) for (const item of Object.values(value)) values(item, out);
  else if (typeof value === "boolean") out.push(value ? "1" : "0");
  else if (typeof value === "number" && !Number.isInteger(value)) {
    const bytes = new DataView(new ArrayBuffer(8));
    bytes.setFloat64(0, value);
    out.push(bytes.getBigUint64(0).toString(16));
  } else out.push(String(value));
  return out;
}

const file = await open(process.argv[2], "r");
const decompressHandlers = await loadDecompressHandlers();
const reader = await McapIndexedReader.Initialize({ readable: new FileHandleReadable(file), decompressHandlers });
const topics = {};
const readers = new Map();
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  if (!readers.has(channel.id)) {
    const definition = parse(new TextDecoder().decode(schema.data), { ros2: true });
    readers.set(channel.id, new MessageReader(definition));
    topics[channel.topic] = { type: schema.name, count: 0, payload: createHash("sha256"), values: createHash("sha256"), times: createHash("sha256") };
  }
  const topic = topics[channel.topic];
  topic.count += 1;
  topic.payload.update(message.data);
  topic.times.update(`${message.logTime},${message.publishTime},${message.sequence};`);
  topic.values.update(values(readers.get(channel.id).readMessage(message.data), []).join(",") + ";");
}
for (const topic of Object.values(topics))
  for (const key of ["payload", "values", "times"]) topic[key] = topic[key].digest("hex");
const metadata = [];
for await (const record of reader.readMetadata()) metadata.push(record.name);
const attachments = [];
for await (const record of reader.readAttachments()) attachments.push(record.name);
await file.close();
console.log(JSON.stringify({ topics, metadata, attachments, profile: reader.header.profile }));
