import { readFileSync } from "node:fs";
import { Ajv2020 } from "ajv/dist/2020.js";
import openapiTS, { astToString, COMMENT_HEADER } from "openapi-typescript";
import { describe, expect, it } from "vitest";
import { parse } from "yaml";
import { exampleNames, goldenJson, goldenText } from "./golden";

interface Media {
  schema?: { $ref?: string };
  examples?: Record<string, { $ref: string }>;
}
type Tree = { [key: string]: Tree } & { [key: string]: unknown };

const text = goldenText("openapi.yaml");
const document = parse(text) as {
  openapi: string;
  paths: Record<string, Record<string, Tree>>;
  components: { schemas: Record<string, Tree>; examples: Record<string, { value: unknown }> };
};

/** Validates against one of the document's schemas. OpenAPI 3.1 schemas are JSON Schema 2020-12. */
function validator(schema: string): (value: unknown) => string[] {
  const ajv = new Ajv2020({ strict: false, allErrors: true });
  ajv.addSchema({ $id: "openapi", ...document });
  const validate = ajv.getSchema(`openapi#/components/schemas/${schema}`);
  if (!validate) throw new Error(`no schema ${schema}`);
  return (value) => {
    validate(value);
    return (validate.errors ?? []).map((error) => `${error.instancePath} ${error.message}`);
  };
}

/** Every media type of the document that has a schema or examples. */
function mediaTypes(): Media[] {
  const found: Media[] = [];
  const visit = (node: unknown): void => {
    if (typeof node !== "object" || node === null) return;
    const { content } = node as { content?: Record<string, Media> };
    if (content) found.push(...Object.values(content));
    Object.values(node).forEach(visit);
  };
  visit(document.paths);
  visit((document.components as Record<string, unknown>)["responses"]);
  return found;
}

/** Which schema an example must pass, where the document itself does not show it beside a schema. */
const schemaOfExample: Record<string, string> = {
  "session-failed": "Session",
  "event-session": "SessionEvent",
  "event-progress": "ProgressEvent",
  "event-heartbeat": "HeartbeatEvent",
  "event-presence": "PresenceEvent",
  "event-end": "EndEvent",
  "job-event": "JobEvent",
};
for (const media of mediaTypes()) {
  for (const name of Object.keys(media.examples ?? {})) {
    const schema = media.schema?.$ref?.replace("#/components/schemas/", "");
    if (schema) schemaOfExample[name] = schema;
  }
}

describe("openapi.yaml", () => {
  it("is OpenAPI 3.1 and has no reference into nothing", () => {
    expect(document.openapi).toMatch(/^3\.1\./);
    for (const [, reference] of text.matchAll(/\$ref: '?#([^'}\s]+)/g)) {
      const target = (reference as string)
        .split("/")
        .slice(1)
        .reduce<unknown>((node, key) => (node as Tree | undefined)?.[key], document);
      expect(target, reference).toBeDefined();
    }
  });

  it("names every operation once, with what it answers to a client that errs", () => {
    const names = new Set<string>();
    for (const [path, operations] of Object.entries(document.paths)) {
      for (const [method, operation] of Object.entries(operations)) {
        if (method === "parameters") continue;
        const name = operation["operationId"] as unknown as string;
        expect(names.has(name), `${method} ${path}`).toBe(false);
        names.add(name);
        expect(Object.keys(operation["responses"] ?? {}), `${method} ${path}`).toContain("default");
        const body = operation["requestBody"];
        if (body && name !== "uploadCloud") {
          for (const status of ["400", "413", "415", "422"]) {
            expect(Object.keys(operation["responses"] ?? {}), `${method} ${path}`).toContain(status);
          }
        }
      }
    }
  });

  it.each(exampleNames())("holds the example %s as the file has it, and it passes its schema", (name) => {
    const example = goldenJson<unknown>(`examples/${name}.json`);
    expect(document.components.examples[name]?.value).toEqual(example);
    const schema = schemaOfExample[name];
    expect(schema, name).toBeDefined();
    expect(validator(schema as string)(example)).toEqual([]);
    if (name.startsWith("event-")) expect(validator("StreamEvent")(example)).toEqual([]);
  });

  it("has no example without a file", () => {
    expect(Object.keys(document.components.examples).sort()).toEqual(exampleNames().sort());
  });

  it.each([
    ["PaintOperation", { mode: "add", shape: { type: "sphere", center: [0, 0], radius: 1 } }],
    ["PaintOperation", { mode: "add", shape: { type: "sphere", center: [0, 0, 0], radius: 0 } }],
    ["PaintOperation", { mode: "add", shape: { type: "all" }, colour: 1 }],
    ["Edit", { level: 0, deformation: { type: "translation", vector: [0, 0, 0] }, sequence: 1 }],
    ["Edit", { level: 1.5, deformation: { type: "translation", vector: [0, 0, 0] } }],
    ["Preview", { level: 0, deformation: { type: "translation", vector: [0, 0, 0] } }],
    ["Head", { edit: -1 }],
    ["CreateSession", { cloud: "short" }],
    ["SessionEvent", { event: "session" }],
  ])("has schemas that refuse: %s %j", (schema, value) => {
    expect(validator(schema)(value)).not.toEqual([]);
  });

  it("is what the viewer's types were generated from (npm run types)", async () => {
    const ast = await openapiTS(new URL("../../../protocol/openapi.yaml", import.meta.url));
    const types = readFileSync(new URL("../../src/protocol/openapi.d.ts", import.meta.url), "utf8");
    expect(types === `${COMMENT_HEADER}${astToString(ast)}`).toBe(true);
  }, 60_000);
});
