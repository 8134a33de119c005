#pragma once
// An edit part of the way: what plays between the surface at rest and the whole edit.

#include "engine/editing/edit.h"

namespace pointwright {

/// The deformation at s of its amount, which moves a sample with t as the whole one moves one with s t:
/// F(p, s t). Vectors, distances, amounts and angles are multiplied by s, factors f become 1 + s (f - 1), in
/// every step of a composition.
/// Pre:         a valid deformation, s in [0, 1]; the result is valid too
/// Promises:    s = 1 is the deformation itself, to the bit; s = 0 leaves every sample where it is, to the
///              bit; continuous between them
/// Determinism: a function of its arguments
Deformation scaled(const Deformation& deformation, double s);

/// The same with the detail's gains g as 1 + s (g - 1).
EditParams scaled(const EditParams& edit, double s);

}  // namespace pointwright
