#pragma once
// Draco (https://google.github.io/draco/spec/) by way of libdraco. The decoder is fit for hostile bytes only
// behind draco_gate() and inside a process that may die.

#include <cstddef>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/cloud_io.h"
#include "engine/io/columns.h"

namespace pointwright {

/// Keys of our own in the file's metadata.
inline constexpr const char* kDracoOriginKey = "pointwright.origin";  ///< 3 float64: positions are around it
inline constexpr const char* kDracoDoubleKey = "pointwright.position_is_double";  ///< int32: 1
inline constexpr const char* kDracoNameKey = "name";              ///< of an attribute: the scalar's name
inline constexpr const char* kDracoTypeKey = "pointwright.type";  ///< "int32" or "uint32" kept as float64

/// A point cloud, or a mesh for its vertices (without its faces). Positions in any numeric type; generic
/// attributes become scalars, one a component, by the name in their metadata or "generic_<id>".
/// Errors: those of draco_gate(); kMalformedData; kUnsupportedFormat; kTooLarge where memory runs out
Result<ImportedCloud> read_draco(std::span<const std::byte> bytes, const ImportParams& params);

/// Sequential encoding: keeps the order, and with position_bits 0 every bit. Positions are float32 around the
/// origin, which stands in the metadata; where exact positions are kept, float32 or float64 in model space,
/// whichever holds them. Quantised positions are entropy-coded where that saves more than a sixth of the
/// file: in an incoherent order it hardly does, and is slow to decode.
/// Errors: kInvalidArgument where libdraco refuses
Result<std::vector<std::byte>> write_draco(const ExportView& view, int position_bits);

}  // namespace pointwright
