/**
 * A stand-in for the daemon, enough to work on the viewer without one:
 *   npx vite-node test/mock/server.ts PORT [MESH.ply(.gz)]
 */
import { createReadStream, existsSync, statSync } from "node:fs";
import { createServer, type IncomingMessage, type ServerResponse } from "node:http";
import { extname, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import type { EditBody, RegionName, RegionOperation } from "../../src/api/types";
import { encodeStreamRecord } from "../../src/protocol/frame-tools";
import { MockSession } from "./session";
import { bumpySphere, plyVertices } from "./shapes";

const POLICY =
  "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; worker-src 'self' blob:";
const TYPES: Record<string, string> = {
  ".html": "text/html; charset=utf-8",
  ".js": "text/javascript; charset=utf-8",
  ".css": "text/css; charset=utf-8",
};

const [port = "8080", mesh] = process.argv.slice(2);
const shape = mesh ? plyVertices(mesh) : bumpySphere(60_000);
const session = new MockSession("mocksession00000000001", mesh ? "Dragon" : "Bumpy sphere", shape);
const streams = new Set<ServerResponse>();
const dist = fileURLToPath(new URL("../../dist", import.meta.url));

const created = new Date().toISOString();
const cloud = {
  id: "mockcloud0000000000001",
  name: `${session.name}.ply`,
  bytes: 24 * shape.count,
  created,
  sample_count: shape.count,
  bounds: session.document().bounds,
  origin: session.origin,
  diagonal: session.document().diagonal,
  report: {
    format: "ply",
    encoding: "ascii",
    declared_count: shape.count,
    dropped_non_finite: 0,
    duplicate_count: 0,
    from_mesh: true,
    position_is_double: false,
    attributes: [],
    skipped: ["confidence"],
  },
};

function broadcast(frame: Uint8Array): void {
  for (const stream of streams) stream.write(encodeStreamRecord(1, frame));
}

function json(
  response: ServerResponse,
  status: number,
  body: unknown,
  headers: Record<string, string> = {},
): void {
  const type = status < 400 ? "application/json; charset=utf-8" : "application/problem+json";
  response.writeHead(status, { "Content-Type": type, ...headers });
  response.end(JSON.stringify(body));
}

async function bodyOf(request: IncomingMessage): Promise<unknown> {
  const chunks: Buffer[] = [];
  for await (const chunk of request) chunks.push(chunk as Buffer);
  return chunks.length > 0 ? JSON.parse(Buffer.concat(chunks).toString()) : null;
}

async function handleSession(
  request: IncomingMessage,
  response: ServerResponse,
  rest: string[],
  query: URLSearchParams,
): Promise<void> {
  const [what, region, operations] = rest;
  const method = request.method ?? "GET";
  if (what === "stream") {
    response.writeHead(200, { "Content-Type": "application/octet-stream" });
    response.write(encodeStreamRecord(1, session.frame(null, 0)));
    streams.add(response);
    request.on("close", () => streams.delete(response));
    return;
  }
  if (what === "samples") {
    response.writeHead(200, { "Content-Type": "application/octet-stream" });
    const s = Number(query.get("s") ?? 1);
    response.end(query.get("format") === "frame" ? session.frame(null, 0, s) : "ply\n");
    return;
  }
  if (what === "recipe" && method === "GET")
    return json(response, 200, { recipe: 1, edits: session.edits.slice(0, session.head) });
  const body = method === "GET" ? null : await bodyOf(request);
  if (what === "regions" && operations === "operations") {
    const changed = session.paint(region as RegionName, body as RegionOperation);
    broadcast(session.frame(null, 0));
    return json(response, 200, { ...session.document(), changed });
  }
  if (what === "regions" && method === "GET")
    return json(response, 200, { operations: session.operations[region as RegionName] });
  if (what === "regions" && method === "PUT") {
    session.put(region as RegionName, (body as { operations: RegionOperation[] }).operations);
    broadcast(session.frame(null, 0));
    return json(response, 200, session.document());
  }
  if (what === "recipe") {
    for (const { edit } of (body as { recipe: { edits: { edit: EditBody }[] } }).recipe.edits)
      session.commit(edit);
    broadcast(session.frame(null, 0));
  }
  if (what === "regions" && method === "DELETE") {
    session.clear(region as RegionName);
    broadcast(session.frame(null, 0));
    return json(response, 200, session.document());
  }
  if (what === "preview") {
    const { sequence, deformation } = (body ?? {}) as EditBody & { sequence?: number };
    broadcast(session.frame(method === "PUT" ? deformation : null, sequence ?? 0));
    response.writeHead(204).end();
    return;
  }
  if (what === "edits" && method === "POST") {
    const record = session.commit(body as EditBody);
    broadcast(session.frame(null, 0));
    return json(response, 201, record);
  }
  if (what === "edits") return json(response, 200, { head: session.head, edits: session.edits });
  if (what === "head") {
    session.head = (body as { edit: number }).edit;
    session.revision += 1;
    broadcast(session.frame(null, 0));
  }
  json(response, 200, session.document());
}

createServer((request, response) => {
  const url = new URL(request.url ?? "/", "http://localhost");
  const parts = url.pathname.split("/").filter(Boolean);
  response.setHeader("Content-Security-Policy", POLICY);
  if (parts[0] !== "v1") {
    const file = resolve(dist, parts.length > 0 ? parts.join("/") : "index.html");
    if (!file.startsWith(dist) || !existsSync(file) || !statSync(file).isFile())
      return void response.writeHead(404).end();
    response.writeHead(200, { "Content-Type": TYPES[extname(file)] ?? "application/octet-stream" });
    return void createReadStream(file).pipe(response);
  }
  if (parts[1] === "sessions" && parts[2] === session.id)
    return void handleSession(request, response, parts.slice(3), url.searchParams);
  if (parts[1] === "images" && request.method === "POST") {
    request.resume();
    const image = {
      id: "mockimage0000000000001",
      width: 256,
      height: 128,
      channels: ["red", "green", "blue", "alpha"],
      bytes: 1024,
    };
    return json(response, 201, image);
  }
  if (parts[1] === "clouds" && request.method === "GET") return json(response, 200, { clouds: [cloud] });
  if (parts[1] === "sessions" && request.method === "GET")
    return json(response, 200, { sessions: [session.document()] });
  if (parts[1] === "sessions" && request.method === "POST") return json(response, 202, session.document());
  json(response, 422, {
    type: "/problems/malformed-cloud",
    title: "The cloud is malformed",
    status: 422,
    detail: "The mock reads no files.",
    request_id: "mock",
  });
}).listen(Number(port), "127.0.0.1", () => console.log(`mock on ${port}`));
