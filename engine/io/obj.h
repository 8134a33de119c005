#pragma once
// Wavefront OBJ, as a cloud: its vertices.

#include <cstddef>
#include <span>

#include "engine/core/result.h"
#include "engine/io/cloud_io.h"

namespace pointwright {

/// The bytes are text without NUL, and the first line that is no comment starts with a word of OBJ; "v" must
/// be followed by a number.
bool looks_like_obj(std::span<const std::byte> bytes);

/// Vertices: `v x y z`, with a weight w (which must be 1 or is kept as the scalar "w"), and with colours
/// (`v x y z r g b`). Colours that are whole 255ths become 8-bit colours, whole numbers beyond 1 are taken as
/// bytes, all others stay scalars. `vn` where there is one for each vertex. Faces, lines and points are
/// counted and left out, and so is every other statement; a backslash at a line's end joins the next one.
/// Errors: kMalformedData (with the line), kTooLarge, kEmptyCloud
Result<ImportedCloud> read_obj(std::span<const std::byte> bytes, const ImportParams& params);

}  // namespace pointwright
