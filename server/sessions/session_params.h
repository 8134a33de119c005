#pragma once
// What a session is made from, and what it computes with.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "server/sessions/compute_pool.h"
#include "server/sessions/surface_state.h"

namespace pointwright::server {

/// What a session is made from.
struct SessionParams {
  std::string id;
  std::string name;
  std::string cloud_id;
  std::shared_ptr<const Cloud> cloud;
  HierarchyParams hierarchy;
  std::uint64_t history_bytes = 0;
  std::size_t max_edits = 0;
  std::size_t max_operations = 0;
  std::size_t max_painting_vertices = 1'000'000;
  std::shared_ptr<SampleRoom> room = std::make_shared<SampleRoom>(kNoParent);  ///< for its samples
};

/// What a session computes with: `background` for what lasts for seconds, `interactive` for a waiting hand.
struct SessionServices {
  ComputePool& interactive;
  ComputePool& background;
  HierarchyBuilder build;
  Resampler resample;
};

}  // namespace pointwright::server
