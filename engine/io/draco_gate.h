#pragma once
// What a Draco file claims, read by hand before the library sees a byte of it: the library allocates what a
// header asks for, and 23 bytes can ask for gigabytes.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "engine/core/result.h"

namespace pointwright {

/// What the header and, for point clouds, the attribute descriptors say.
struct DracoClaim {
  bool is_mesh = false;
  std::string encoding;      ///< "sequential", "kd_tree", "mesh_sequential", "mesh_edgebreaker"
  std::uint64_t points = 0;  ///< samples of a cloud, vertices of a mesh
  std::uint64_t faces = 0;   ///< of a mesh
  /// Of all attributes of a sample once decoded; 0 for meshes (their descriptors are coded).
  std::uint64_t sample_bytes = 0;
};

/// Lets a file pass to the library only if it is of a current bitstream (clouds 2.2 and 2.3, meshes 2.2), its
/// metadata is well-formed, and what it claims is in proportion to its bytes: at most 1000 samples (or faces)
/// a byte, at most 64 KiB of decoded attributes a byte, one to 64 attributes in one group, each with 1 to 16
/// components of a known type. A million samples on one place in 58 bytes are legal Draco and refused
/// nonetheless: no scan is like that.
/// Errors: kUnsupportedFormat, kMalformedData (with the byte), kEmptyCloud, kTooLarge
Result<DracoClaim> draco_gate(std::span<const std::byte> bytes, std::uint64_t max_samples);

}  // namespace pointwright
