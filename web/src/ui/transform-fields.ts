import {
  AXES,
  alongNormal,
  rotation,
  scaling,
  towardPoint,
  translation,
  twisting,
} from "../edits/deformation";
import type { TransformEditor } from "../edits/transform";
import type { TransformKind, TransformState } from "../event-map";
import { isFiniteVec3, length, type Vec3 } from "../math/vec3";
import { h } from "./dom";
import { type NumberField, numberField, rangeField, vectorField } from "./fields";

/** The numbers of one kind of transform. */
export interface KindFields {
  elements: HTMLElement[];
  /** All that a region's lack makes useless. */
  inputs: HTMLInputElement[];
  show(state: TransformState): void;
  /** What a typed digit belongs to. */
  digits(state: TransformState): NumberField;
}

/** Of the diagonal: how far the slider along the normals goes either way. */
const OFFSET_REACH = 0.05;

export type AllFields = Record<TransformKind, KindFields>;

/** The fields of every kind: the same numbers that the handles make. */
export function createKindFields(editor: TransformEditor, diagonal: number, commit: () => void): AllFields {
  const onEnter = commit;
  const pivotField = (): ReturnType<typeof vectorField> => {
    const field = vectorField("Pivot", [0, 0, 0], {
      onChange: () => {
        if (isFiniteVec3(field.value)) editor.setPivot(field.value);
      },
      onEnter,
    });
    return field;
  };
  return {
    move: moveFields(editor, onEnter),
    rotate: turnFields(editor, pivotField(), onEnter),
    scale: scaleFields(editor, pivotField(), onEnter),
    twist: twistFields(editor, pivotField(), onEnter),
    normal: normalFields(editor, diagonal, onEnter),
    toward: towardFields(editor, onEnter),
  };
}

type Pivot = ReturnType<typeof vectorField>;
const inputsOf = (fields: readonly NumberField[]): HTMLInputElement[] => fields.map((field) => field.input);

function moveFields(editor: TransformEditor, onEnter: () => void): KindFields {
  const vector = vectorField("Move by", [0, 0, 0], {
    onChange: () => editor.set(translation(vector.value)),
    onEnter,
  });
  return {
    elements: [vector.element],
    inputs: inputsOf(vector.fields),
    show: ({ deformation }) =>
      vector.set(deformation?.type === "translation" ? deformation.vector : [0, 0, 0]),
    digits: ({ axis }) => vector.fields[axis ? ("xyz".indexOf(axis) as 0 | 1 | 2) : 0],
  };
}

function turnFields(editor: TransformEditor, pivot: Pivot, onEnter: () => void): KindFields {
  const turn = (): void => editor.set(rotation(pivot.value, direction.value, angle.value));
  const angle = numberField("Angle", 0, { unit: "°", onChange: turn, onEnter });
  const direction = vectorField("Axis", [0, 1, 0], { onChange: turn, onEnter });
  let held: TransformState["axis"] = null;
  return {
    elements: [angle.element, direction.element, pivot.element],
    inputs: inputsOf([angle, ...direction.fields, ...pivot.fields]),
    show({ deformation, pivot: point, axis }) {
      const rotates = deformation?.type === "rotation";
      angle.set(rotates ? deformation.angle_deg : 0);
      if (rotates) direction.set(deformation.axis.direction);
      else if (axis && axis !== held) direction.set(AXES[axis]);
      held = axis;
      pivot.set(point);
    },
    digits({ axis }) {
      if (axis) direction.set(AXES[axis]);
      return angle;
    },
  };
}

function scaleFields(editor: TransformEditor, pivot: Pivot, onEnter: () => void): KindFields {
  const set = (factors: Vec3): void => editor.set(scaling(pivot.value, factors));
  const all = numberField("All axes", 1, {
    unit: "×",
    onChange: (factor) => set([factor, factor, factor]),
    onEnter,
  });
  const factors = vectorField("Factors", [1, 1, 1], { onChange: () => set(factors.value), onEnter });
  return {
    elements: [all.element, factors.element, pivot.element],
    inputs: inputsOf([all, ...factors.fields, ...pivot.fields]),
    show({ deformation, pivot: point }) {
      const shown: Vec3 = deformation?.type === "scale" ? deformation.factors : [1, 1, 1];
      factors.set(shown);
      // No one number says three different ones.
      all.set(shown.every((factor) => factor === shown[0]) ? shown[0] : Number.NaN);
      pivot.set(point);
    },
    digits: ({ axis }) => (axis ? factors.fields["xyz".indexOf(axis) as 0 | 1 | 2] : all),
  };
}

function twistFields(editor: TransformEditor, pivot: Pivot, onEnter: () => void): KindFields {
  const angle = numberField("Angle", 0, {
    unit: "°",
    onChange: (degrees) => editor.set(twisting(pivot.value, direction.value, degrees, over.value)),
    onEnter,
  });
  const about = (): void => {
    const twist = { direction: direction.value, length: over.value };
    if (isFiniteVec3(twist.direction) && length(twist.direction) > 0 && twist.length > 0)
      editor.setTwist(twist);
  };
  const over = numberField("Over a length of", 1, { unit: "units", onChange: about, onEnter });
  const direction = vectorField("Axis", [0, 1, 0], { onChange: about, onEnter });
  return {
    elements: [
      h("div", { class: "field-row" }, angle.element, over.element),
      direction.element,
      pivot.element,
    ],
    inputs: inputsOf([angle, over, ...direction.fields, ...pivot.fields]),
    show({ deformation, twist, pivot: point }) {
      angle.set(deformation?.type === "twist" ? deformation.angle_deg : 0);
      over.set(twist.length);
      direction.set(twist.direction);
      pivot.set(point);
    },
    digits: () => angle,
  };
}

function normalFields(editor: TransformEditor, diagonal: number, onEnter: () => void): KindFields {
  const set = (distance: number): void => editor.set(alongNormal(distance));
  const distance = numberField("Distance", 0, { unit: "units", onChange: set, onEnter });
  const reach = OFFSET_REACH * diagonal;
  const slider = rangeField(
    "Carve – raise",
    { min: -1, max: 1, step: 0.01 },
    0,
    (part) => `${Number((100 * OFFSET_REACH * part).toPrecision(2))} %`,
    (part) => set(Number((part * reach).toPrecision(4))),
  );
  slider.input.title = "Of the diagonal of the bounding box";
  return {
    elements: [distance.element, slider.element],
    inputs: [distance.input, slider.input],
    show({ deformation }) {
      const now = deformation?.type === "along_normal" ? deformation.distance : 0;
      distance.set(now);
      if (document.activeElement !== slider.input) slider.set(reach > 0 ? now / reach : 0);
    },
    digits: () => distance,
  };
}

function towardFields(editor: TransformEditor, onEnter: () => void): KindFields {
  const target = vectorField("Target", [0, 0, 0], {
    onChange: () => {
      if (isFiniteVec3(target.value)) editor.setPivot(target.value);
    },
    onEnter,
  });
  const set = (percent: number): void => editor.set(towardPoint(editor.state.pivot, percent / 100));
  const amount = numberField("Amount", 0, { unit: "%", onChange: set, onEnter });
  const slider = rangeField(
    "Away – toward",
    { min: -100, max: 100, step: 1 },
    0,
    (percent) => `${percent} %`,
    set,
  );
  return {
    elements: [target.element, amount.element, slider.element],
    inputs: [...inputsOf([...target.fields, amount]), slider.input],
    show({ deformation, pivot }) {
      const now = deformation?.type === "toward_point" ? 100 * deformation.amount : 0;
      target.set(pivot);
      amount.set(now);
      if (document.activeElement !== slider.input) slider.set(now);
    },
    digits: ({ axis }) => (axis ? target.fields["xyz".indexOf(axis) as 0 | 1 | 2] : amount),
  };
}
