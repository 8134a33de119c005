#pragma once
// What a session is made from, and what it computes with.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/sessions/compute_pool.h"
#include "server/sessions/document.h"
#include "server/sessions/keeper.h"
#include "server/sessions/surface_state.h"

namespace pointwright::server {

/// Some samples of a cloud, as the cloud has them to the bit.
struct ChosenSamples {
  std::shared_ptr<const Cloud> cloud;  ///< ids count up in the caller's order
  /// By id: the index of the sample in the caller's order of the whole cloud.
  std::shared_ptr<const std::vector<std::uint32_t>> cloud_index;
};

/// A session on a uniform subsample of its cloud: what is known before the samples are chosen.
struct PreviewParams {
  protocol::PreviewSize size;
  Vec3d origin = Vec3d::Zero();
  protocol::ModelBounds bounds;  ///< of the whole cloud
  /// Of the whole cloud: what scales are fractions of, so that recipes fit it.
  float diagonal = 0.0F;
  /// Chooses them: the same ones each time. Called once, while the session is built.
  std::function<Outcome<ChosenSamples>(const ExecutionContext&)> choose;
};

/// What a session is made from.
struct SessionParams {
  std::string id;
  std::string name;
  std::string owner;  ///< the id of a token; empty: made where none were in use
  std::string cloud_id;
  std::shared_ptr<const Cloud> cloud;  ///< null: a preview's samples are chosen first
  std::optional<PreviewParams> preview = std::nullopt;
  HierarchyParams hierarchy;
  std::uint64_t history_bytes = 0;
  std::size_t max_edits = 0;
  std::size_t max_operations = 0;
  std::size_t max_painting_vertices = 1'000'000;
  std::size_t max_named_regions = 16;
  std::shared_ptr<SampleRoom> room = std::make_shared<SampleRoom>(kNoParent);  ///< for its samples
  protocol::TimePoint created = std::chrono::system_clock::now();
  std::shared_ptr<SessionKeeper> keeper = nullptr;  ///< null: it ends with the process
  std::shared_ptr<const Document> kept = nullptr;   ///< what it was before; null: it is new
};

/// What a session computes with: `background` for what lasts for seconds, `interactive` for a waiting hand.
struct SessionServices {
  ComputePool& interactive;
  ComputePool& background;
  HierarchyBuilder build;
  Resampler resample;
  /// Told how many milliseconds each step took; may be empty.
  std::function<void(const std::string&, double)> note_time = {};
};

}  // namespace pointwright::server
