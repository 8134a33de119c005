import type { SessionDocument } from "./api/types";
import type { Notices, Questions } from "./event-map";
import type { Events } from "./events";
import { add, subtract, type Vec3 } from "./math/vec3";

export type Bus = Events<Notices, Questions>;

/** The server's truth about the session, as the viewer last heard it. */
export class SessionStore {
  private document_: SessionDocument;
  private readonly bus_: Bus;

  constructor(bus: Bus, document: SessionDocument) {
    this.bus_ = bus;
    this.document_ = document;
  }

  get document(): SessionDocument {
    return this.document_;
  }

  get id(): string {
    return this.document_.id;
  }

  /** Takes a newer document; an older one that a slow answer brings is left aside. */
  update(document: SessionDocument): void {
    if (document.revision < this.document_.revision) return;
    this.document_ = document;
    this.bus_.fire("session.changed", document);
  }

  /** Scene coordinates are model coordinates less the session's origin: small enough for the GPU's floats. */
  toScene(point: Vec3): Vec3 {
    return subtract(point, this.document_.origin);
  }

  toModel(point: Vec3): Vec3 {
    return add(point, this.document_.origin);
  }
}
