#pragma once

#include <string>

#include "server/sessions/surface_state.h"

namespace pointwright::server {

/// 64 hexadecimal digits that the positions, normals and ids of the finest level's samples decide, to the
/// bit: SHA-256 over those of its blocks of samples.
/// Cost:        O(N), all threads
/// Determinism: the blocks are fixed
std::string surface_hash(const SurfaceState& state);

}  // namespace pointwright::server
